"""Figures over time, against the walk's angles, penetrations, forces and one heel strike."""

import dataclasses

import equinox as eqx
import numpy as np
import pytest
from matplotlib.figure import Figure

import jaxbiped as jb
from jaxbiped.plot import contact_forces, leg_angles, penetrations
from tests.drawn import legend_of


def _curve(ax, leg):
    (line,) = [line for line in ax.lines if line.get_label() == f"leg {leg}"]
    return line.get_data()


def test_angles_at_the_solvers_steps(seed_walk):
    _, walk = seed_walk
    (ax,) = leg_angles(*seed_walk).axes
    steps = np.asarray(walk.t)[1:-1]
    for line, angle in zip(ax.lines, (walk.state.theta_1, walk.state.theta_2), strict=True):
        t, drawn = line.get_data()
        np.testing.assert_array_equal(drawn[np.searchsorted(t, steps)], np.asarray(angle)[1:-1])
        assert (t[0], t[-1]) == (0.0, 2.0)
    assert legend_of(ax) == ["leg 1", "leg 2"]


def test_depth_in_millimetres_while_a_foot_touches(seed_walk):
    _, walk = seed_walk
    (ax,) = penetrations(*seed_walk).axes
    assert ax.get_ylim()[0] == 0.0
    for leg, line in enumerate(ax.lines, start=1):
        t, drawn = line.get_data()
        state = walk.at(t)
        angle, rate = (state.theta_1, state.omega_1) if leg == 1 else (state.theta_2, state.omega_2)
        depth = 1e3 * (0.08 - np.asarray(state.hip_z) + 0.32 * np.cos(np.asarray(angle)))
        touching = (depth > 1e-6) & (np.asarray(rate) < -1e-6)
        np.testing.assert_allclose(drawn[touching], depth[touching], atol=2e-6)
        assert drawn[touching].max() == pytest.approx(0.69, abs=0.02)
        swinging = np.asarray(rate) > 0.0
        assert np.isnan(drawn[swinging & (depth > 0.0)]).all()
        assert np.isnan(drawn).mean() > 0.3
        assert np.nanmin(drawn) == 0.0


def test_feet_in_the_air_have_no_depth(seed_walk):
    scene, _ = seed_walk
    start = jb.seed_state()
    flight = jb.simulate(scene, start._replace(hip_z=start.hip_z + 0.2), duration=0.02)
    (ax,) = penetrations(scene, flight).axes
    assert all(np.isnan(line.get_ydata()).all() for line in ax.lines)
    assert ax.get_ylim() == pytest.approx((0.0, 1.1e-3))


def test_a_whole_walk_shows_the_peaks_of_both_feet_and_tells_legs_apart(seed_walk):
    scene, walk = seed_walk
    normal_axes, strike_axes, tangential_axes, _ = axes = contact_forces(scene, walk).axes
    for leg, force in enumerate(jb.dynamics.foot_forces(scene, walk.state), start=1):
        _, normal = _curve(normal_axes, leg)
        assert normal.max() == pytest.approx(float(force.normal.max()), rel=1e-3)
        assert normal.max() >= float(force.normal.max()) * (1 - 1e-9)
        _, tangential = _curve(tangential_axes, leg)
        assert tangential.min() <= float(force.tangential.min()) * (1 - 1e-9)
    assert "(N)" in normal_axes.get_ylabel()
    assert "(s)" in tangential_axes.get_xlabel()
    assert strike_axes.texts[0].get_text().endswith(" N")
    for ax in axes:  # without colour, too
        first, second = [line for line in ax.lines if line.get_label().startswith("leg")]
        assert first.get_linestyle() != second.get_linestyle()


def test_a_heel_strike_is_enlarged(seed_walk):
    scene, walk = seed_walk
    times, feet = jb.measure.heel_strikes(scene, walk)
    _, normal_axes, _, tangential_axes = contact_forces(scene, walk, strike=1).axes
    assert "(ms)" in tangential_axes.get_xlabel()
    assert f"leg {feet[1]} at {times[1]:.3f} s" in normal_axes.get_title(loc="left")
    t, force = _curve(normal_axes, feet[1])
    assert force[t < -1e-3].max() == 0.0
    assert force[t > 0.05].min() > 10.0
    peak = jb.footsteps(scene, walk).peak_normal_N[1]
    assert force.max() == pytest.approx(peak, rel=1e-3)
    shade = normal_axes.patches[0]
    assert shade.get_width() == pytest.approx(0.134, abs=0.01)
    _, behind = _curve(normal_axes, 3 - feet[1])
    assert behind[t > 0.2].max() == 0.0
    with pytest.raises(jb.ArgumentError, match=f"{len(times)} heel strikes"):
        contact_forces(scene, walk, strike=len(times))


def test_the_strike_that_ends_a_walk_is_not_the_one_enlarged(seed_walk):
    """Nothing follows it that could be drawn."""
    walk = jb.simulate(seed_walk[0], jb.seed_state(), footsteps=2)
    times, feet = jb.measure.heel_strikes(seed_walk[0], walk)
    assert times[-1] == pytest.approx(float(walk.t[-1]), abs=1e-9)
    axes = contact_forces(seed_walk[0], walk).axes
    assert f"leg {feet[-2]} at {times[-2]:.3f} s" in axes[1].get_title(loc="left")
    assert _curve(axes[1], feet[-2])[0].max() == pytest.approx(4.5)


def test_panels_are_those_of_what_there_is(seed_walk):
    """No tangential panel without friction, no second column without a heel strike."""
    scene, walk = seed_walk
    slippery = eqx.tree_at(lambda s: s.friction, scene, jb.laws.Frictionless())
    slid = dataclasses.replace(walk, scene_key=None)  # the same motion, taken for another scene's
    whole, strike = contact_forces(slippery, slid).axes
    assert "F_N" in whole.get_ylabel()
    assert "(s)" in whole.get_xlabel()
    assert "(ms)" in strike.get_xlabel()
    short = jb.simulate(scene, jb.seed_state(), duration=0.1)
    assert len(contact_forces(scene, short).axes) == 2
    figure = Figure(layout="constrained")
    upper, lower = figure.subfigures(2, 1)
    assert contact_forces(scene, walk, figure=lower) is figure
    assert not upper.axes
    assert len(lower.axes) == 4
    assert np.isfinite(lower.axes[0].get_ylim()).all()
