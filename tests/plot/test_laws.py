"""Figures of contact laws, against the laws themselves."""

import dataclasses

import numpy as np
import pytest
from matplotlib.figure import Figure

import jaxbiped as jb
from jaxbiped import plot
from tests.drawn import assert_is_drawn, legend_of, points_of
from tests.scene.laws.drop import restitutions

SEED = dict(K=1e6, c=2e5, n=1.5, mass=2.0)
FRICTION = dict(mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1000.0)


def _curves(ax):
    return [np.asarray(line.get_xydata(), float).T for line in ax.lines]


def test_forces_at_each_rate():
    law = jb.laws.HuntCrossley(K=1e6, hysteresis=3.0)
    figure = plot.normal_law(law, depth=5e-4, rates=(-0.1, 0.2))
    left, right = figure.axes
    (depth, slow), (_, fast) = _curves(left)
    assert depth.max() == pytest.approx(0.5)
    np.testing.assert_allclose(slow[-1], 1e6 * 5e-4**1.5 * 0.7)
    np.testing.assert_allclose(fast[-1], 1e6 * 5e-4**1.5 * 1.6)
    assert legend_of(left) == ["−0.1 m/s", "0.2 m/s"]
    assert left.get_xlim() == (depth.min(), depth.max())
    for ax in (left, right):
        assert "(mm)" in ax.get_xlabel()
        assert "(N)" in ax.get_ylabel()


@pytest.mark.parametrize("name", ["kelvin-voigt", "tsuji"])
def test_the_loop_has_the_area_of_the_energy_lost(name):
    law, mass, speed = jb.laws.normal_law_like(name, **SEED), 2, 0.1
    figure = plot.normal_law(law, mass=mass, approach_speed=speed)
    right = figure.axes[1]
    (expected,) = restitutions(law, [speed], mass=mass)
    assert f"restitution {expected:.3f}" in right.get_title(loc="left")
    (depth_in, force_in), (depth_out, force_out) = _curves(right)
    assert depth_in[-1] == depth_out[0] == pytest.approx(max(depth_in))
    assert (depth_out[-1], force_out[-1]) == (0.0, 0.0)
    work = np.trapezoid(force_in, 1e-3 * depth_in) + np.trapezoid(force_out, 1e-3 * depth_out)
    assert work == pytest.approx(0.5 * mass * speed**2 * (1 - expected**2), rel=1e-2)
    assert_is_drawn(figure)


def test_an_elastic_law_has_one_curve_and_gives_all_back():
    left, right = plot.normal_law(jb.laws.Hertz(K=1e6)).axes
    assert len(left.lines) == 1
    assert legend_of(left) == ["0 m/s"]
    weak = plot.normal_law(jb.laws.KelvinVoigt(1e6, 0.5)).axes[0]
    assert len(weak.lines) == 4  # however small the damping
    assert right.get_title(loc="left").endswith("restitution 1.000")


BRISTLES = ("dahl", "lugre")


@pytest.mark.parametrize("name", [name for name in jb.laws.FRICTION_LAWS if name not in BRISTLES])
def test_friction_over_load_against_slip(name):
    law = jb.laws.friction_law_like(name, **FRICTION)
    figure = plot.friction_law(law)
    (ax,) = figure.axes
    _, (slip, ratio) = _curves(ax)
    np.testing.assert_allclose(ratio, law.force(np.full(slip.shape, 20.0), slip) / 20.0, atol=1e-15)
    np.testing.assert_allclose(slip, -slip[::-1], atol=1e-15)
    if name not in ("viscous", "frictionless"):
        # The law's own speed and what lies far beyond are both seen.
        assert 5e-3 < slip[-1] < 1.0
        assert 0.05 < np.mean(np.abs(slip) < 1e-4) < 0.5
    assert "(m/s)" in ax.get_xlabel()
    assert "(–)" in ax.get_ylabel()


def test_a_range_and_axes_may_be_given():
    figure = plot.friction_law(jb.laws.Viscous(k=3.0))
    (ax,) = figure.axes
    assert plot.friction_law(jb.laws.Viscous(k=2.0), fastest=0.3, ax=ax) is figure
    assert ax.get_xlim() == (-0.3, 0.3)
    _, first, _, second = _curves(ax)
    np.testing.assert_allclose(first[1], -3.0 * first[0])
    np.testing.assert_allclose(second[1], -2.0 * second[0])
    assert (second[0].min(), second[0].max()) == (-0.3, 0.3)
    assert_is_drawn(figure)
    whole = Figure()
    half, _ = whole.subfigures(1, 2)
    assert plot.normal_law(jb.laws.Hertz(K=1e6), figure=half) is whole


@pytest.mark.parametrize(
    ("draw", "match"),
    [
        (lambda: plot.normal_law(jb.laws.Viscous(k=1.0)), "law = "),
        (lambda: plot.friction_law(jb.laws.Hertz(K=1.0)), "law = "),
        (plot.friction_law, "laws is empty"),
        (lambda: plot.normal_law(jb.laws.Hertz(K=1.0), depth=0.0), "depth = 0"),
        (lambda: plot.normal_law(jb.laws.Hertz(K=1.0), mass=-1.0), "mass = -1"),
        (lambda: plot.normal_law(jb.laws.Hertz(K=1.0), approach_speed=0.0), "approach_speed = 0"),
        (lambda: plot.friction_law(jb.laws.Viscous(k=1.0), load=0.0), "load = 0"),
        (lambda: plot.friction_law(jb.laws.Viscous(k=1.0), fastest=-1.0), "fastest = -1"),
    ],
)
def test_bad_arguments_are_named(draw, match):
    with pytest.raises(jb.ArgumentError, match=f"^{match}"):
        draw()


@pytest.mark.parametrize("name", BRISTLES)
def test_bristles_make_a_loop(name):
    law = jb.laws.friction_law_like(name, **FRICTION)
    figure = plot.bristle_law(law, slip_speed=1e-5)
    (ax,) = figure.axes
    _, first, back, again = _curves(ax)
    assert first[1][0] < 0.1 < first[1][-1]
    # Steady slip meets the law's coefficient, and the loop is odd.
    steady = law.mu if name == "dahl" else law.mu_static
    assert first[1][-1] == pytest.approx(float(steady), rel=1e-2)
    np.testing.assert_allclose(back[1][-1], -again[1][-1], rtol=1e-3)
    # It gives back less than it took.
    assert np.trapezoid(again[1], again[0]) + np.trapezoid(back[1], back[0]) > 0.0
    assert "(mm)" in ax.get_xlabel()
    assert_is_drawn(figure)
    with pytest.raises(jb.ArgumentError, match="slip_speed = 0"):
        plot.bristle_law(law, slip_speed=0.0)
    with pytest.raises(jb.ArgumentError, match="law = Viscous"):
        plot.bristle_law(jb.laws.Viscous(k=1.0))


def test_laws_of_friction_side_by_side():
    """Each curve is its law's own; laws of one kind are named by what differs."""
    own = jb.seed_scene().friction
    laws = (own, dataclasses.replace(own, mu_kinetic=0.1), jb.laws.BrownMcPhee.like_seed(own))
    (ax,) = plot.friction_law(*laws).axes
    names = legend_of(ax)
    assert names == [
        r"Bengisu and Akay, $\mu$ = 0.4",
        r"Bengisu and Akay, $\mu$ = 0.1",
        "Brown and McPhee",
    ]
    for law, name in zip(laws, names, strict=True):
        slip, force = points_of(ax, name)[0].T
        expected = law.force(np.full(slip.shape, 20.0), slip) / 20.0
        np.testing.assert_allclose(force, expected, atol=1e-12)
    curves = [line for line in ax.lines if line.get_label() in names]
    assert len({str(line._dash_pattern) for line in curves}) == 3
    assert len({line.get_color() for line in curves}) == 3
