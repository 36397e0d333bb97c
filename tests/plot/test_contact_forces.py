"""The figure of contact forces, against the forces of the walk and one heel strike."""

import dataclasses

import equinox as eqx
import numpy as np
import pytest
from matplotlib.figure import Figure

import jaxbiped as jb
from jaxbiped.plot import contact_forces


def _curve(ax, leg):
    (line,) = [line for line in ax.lines if line.get_label() == f"leg {leg}"]
    return line.get_data()


def test_whole_walk_shows_the_peaks_of_both_feet(seed_walk):
    scene, walk = seed_walk
    figure = contact_forces(scene, walk)
    normal_axes, strike_axes, tangential_axes, _ = figure.axes
    forces = jb.dynamics.foot_forces(scene, walk.state)
    for leg, force in enumerate(forces, start=1):
        _, normal = _curve(normal_axes, leg)
        assert normal.max() == pytest.approx(float(force.normal.max()), rel=1e-3)
        assert normal.max() >= float(force.normal.max()) * (1 - 1e-9)
        _, tangential = _curve(tangential_axes, leg)
        assert tangential.min() <= float(force.tangential.min()) * (1 - 1e-9)
    assert "(N)" in normal_axes.get_ylabel()
    assert "(N)" in tangential_axes.get_ylabel()
    assert "(s)" in tangential_axes.get_xlabel()
    assert strike_axes.texts[0].get_text().endswith(" N")


def test_legs_differ_without_colour_too(seed_walk):
    for ax in contact_forces(*seed_walk).axes:
        first, second = (
            next(line for line in ax.lines if line.get_label() == f"leg {leg}") for leg in (1, 2)
        )
        assert first.get_linestyle() != second.get_linestyle()


def test_a_heel_strike_is_enlarged(seed_walk):
    scene, walk = seed_walk
    times, feet = jb.measure.heel_strikes(scene, walk)
    figure = contact_forces(scene, walk, strike=1)
    _, normal_axes, _, tangential_axes = figure.axes
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


def test_strikes_are_counted(seed_walk):
    scene, walk = seed_walk
    count = len(jb.measure.heel_strikes(scene, walk).time_s)
    with pytest.raises(jb.ArgumentError, match=f"{count} heel strikes"):
        contact_forces(scene, walk, strike=count)


def test_no_friction_no_tangential_panel(seed_walk):
    scene, walk = seed_walk
    slippery = eqx.tree_at(lambda s: s.friction, scene, jb.laws.Frictionless())
    slid = dataclasses.replace(walk, scene_key=None)  # the same motion, taken for another scene's
    whole, strike = contact_forces(slippery, slid).axes
    assert "F_N" in whole.get_ylabel()
    assert "(s)" in whole.get_xlabel()
    assert "(ms)" in strike.get_xlabel()


def test_no_heel_strike_no_second_column():
    scene = jb.seed_scene()
    figure = contact_forces(scene, jb.simulate(scene, jb.seed_state(), duration=0.1))
    assert len(figure.axes) == 2


def test_draws_into_a_subfigure(seed_walk):
    whole = Figure(layout="constrained")
    upper, lower = whole.subfigures(2, 1)
    assert contact_forces(*seed_walk, figure=lower) is whole
    assert not upper.axes
    assert len(lower.axes) == 4
    assert np.isfinite(lower.axes[0].get_ylim()).all()
