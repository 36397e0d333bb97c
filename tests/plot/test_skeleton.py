"""Figures of mechanisms, against where their bodies and feet are, by names."""

import math

import numpy as np
import pytest
from matplotlib.collections import LineCollection

import jaxbiped as jb
from jaxbiped import plot
from jaxbiped.measure._samples import evaluate_along
from jaxbiped.plot._notebook import _gait_figure, _with_error
from jaxbiped.plot._skeleton import body_motion, poses, skeleton_of
from jaxbiped.plot.style import LEG_COLOURS
from tests.drawn import assert_is_drawn, legend_of
from tests.mechanisms import WALKERS, scene_of, start_of
from tests.plot.test_gait_charts import _gait as made_gait


class Walks(dict):
    """A short motion of each mechanism, by name: each is walked where it is first asked for."""

    def __missing__(self, name):
        scene = scene_of(name)
        self[name] = scene, jb.simulate(scene, start_of(name, scene), duration=0.1)
        return self[name]


@pytest.fixture(scope="module")
def walks():
    return Walks()


@pytest.mark.parametrize("name", ["coupled", "kneed", "flat"])
def test_feet_and_mass_centres_are_where_the_equations_have_them(name, walks):
    scene, walk = walks[name]
    shown = poses(scene, evaluate_along(scene, walk.state, body_motion))
    sine, cosine = math.sin(scene.ground.slope), math.cos(scene.ground.slope)
    for drawn, foot in zip(shown.feet, jb.dynamics.feet(scene, walk.state), strict=True):
        x, z = np.asarray(foot.x), np.asarray(foot.z)
        expected = np.stack([cosine * x + sine * z, cosine * z - sine * x], axis=-1)
        np.testing.assert_allclose(drawn, expected, rtol=0.0, atol=1e-12)
    weight = float(scene.mechanism.total_mass) * float(scene.ground.g)
    heights = sum(
        float(body.mass) * centre[:, 1]
        for body, centre in zip(scene.mechanism.bodies, shown.centres, strict=True)
    )
    mass = scene.mechanism.root_mass
    heights = heights + (0.0 if mass is None else float(mass) * shown.root[:, 1])
    potential = np.asarray(jb.dynamics.energies(scene, walk.state).gravitational)
    drop = (heights - heights[0]) * float(scene.ground.g)
    np.testing.assert_allclose(drop, potential - potential[0], atol=1e-9 * weight)


def test_each_body_hangs_on_the_one_before_it():
    """A chain of three: places and directions are summed up link by link."""
    link = dict(mass=1.0, inertia=0.01)
    chain = jb.Mechanism(
        bodies=[
            jb.Body("a", **link, centre=0.1),
            jb.Body("b", **link, centre=0.1, parent="a", at=0.5),
            jb.Body("c", **link, centre=0.1, parent="b", at=0.3),
        ],
        feet=[jb.Foot("c", centre=0.2)],
    )
    angles = np.array([0.3, -0.2, 0.5])
    motion = dict(hip_x=np.zeros(1), hip_z=np.ones(1))
    motion |= {f"theta_{k}": angle[None] for k, angle in zip("abc", angles, strict=True)}
    shown = skeleton_of(chain).pose(motion, 0.0)
    ends = np.cumsum(np.array([0.5, 0.3, 0.2]) * np.exp(1j * angles))
    for place, end in zip((*shown.hinges[1:], *shown.feet), ends, strict=True):
        np.testing.assert_allclose(place[0], (end.imag, 1.0 - end.real), atol=1e-15)


def test_lines_go_from_hinge_to_hinge_round_feet_and_to_lonely_mass_centres():
    lines = {
        name: {part.name: part.path for part in skeleton_of(WALKERS[name]).parts}
        for name in ("kneed", "flat", "torso")
    }
    assert lines["kneed"]["thigh_1"] == ((0.0, 0.0), (0.184, 0.0))
    assert lines["kneed"]["shank_1"] == ((0.0, 0.0), (0.136, 0.0))
    assert lines["flat"]["foot_2"] == ((0.0, 0.0), (0.03, -0.04), (0.03, 0.08), (0.0, 0.0))
    assert lines["torso"]["torso"] == ((0.0, 0.0), (-0.10, 0.0))
    wheel = jb.Mechanism(
        root="hub",
        bodies=(jb.Body("wheel", mass=1.0, inertia=0.5, centre=0.0),),
        feet=tuple(jb.Foot("wheel", centre=(1.0, float(k)), leg=f"spoke_{k}") for k in (1, 2)),
    )
    (rim,) = skeleton_of(wheel).parts
    assert rim.path == ((0.0, 0.0), (1.0, 1.0), (0.0, 0.0), (1.0, 2.0), (0.0, 0.0))


def test_the_page_is_sent_all_that_it_draws():
    """Two feet of one leg, and a torso that stands above the hip."""
    sent = skeleton_of(WALKERS["flat"]).numbers()
    assert (sent["root"], sent["noun"], sent["above"]) == ("hip", "body", 0.0)
    assert sent["height"] == pytest.approx(0.36 + 0.03 + 0.01)
    assert sent["parts"][3] == {
        "name": "foot_2", "label": "foot_2", "look": "leg-2 deep-1", "parent": 1,
        "hinge": (0.36, 0.0), "centre": (0.02, 0.0),
        "path": ((0.0, 0.0), (0.03, -0.04), (0.03, 0.08), (0.0, 0.0)),
    }  # fmt: skip
    assert sent["feet"][3] == {
        "label": "foot_2.toe", "look": "leg-2 deep-1", "part": 3, "leg": 1, "centre": (0.03, 0.08),
        "radius": 0.01,
    }  # fmt: skip
    assert sent["legs"] == [
        {"label": "foot_1", "look": "leg-1"}, {"label": "foot_2", "look": "leg-2"}
    ]  # fmt: skip
    torso = skeleton_of(WALKERS["torso"]).numbers()
    assert torso["above"] == pytest.approx(0.10)
    assert torso["parts"][2]["look"] == "leg-3"
    assert skeleton_of(jb.seed_scene().mechanism).numbers()["noun"] == "leg"


def test_what_belongs_to_a_leg_has_its_colour():
    parts = {part.name: part.look for part in skeleton_of(WALKERS["five"]).parts}
    assert [parts[f"thigh_{i}"].colour for i in (1, 2)] == list(LEG_COLOURS[:2])
    assert parts["trunk"].colour == LEG_COLOURS[2]
    assert [look.depth for look in parts.values()] == [0, 0, 1, 0, 1]
    assert len({look.colour for look in parts.values()}) == 5


@pytest.mark.parametrize(
    ("name", "bodies"),
    [
        ("coupled", ["leg_1", "leg_2", "torso"]),
        ("kneed", ["thigh_1", "shank_1", "thigh_2", "shank_2"]),
    ],
)
def test_legends_name_all_bodies(name, bodies, walks):
    scene, walk = walks[name]
    strobe = plot.gait_strobe(scene, walk)
    (ax,) = strobe.axes
    assert legend_of(ax) == [*bodies, "slope 0.03 rad"]
    assert sum(isinstance(each, LineCollection) for each in ax.collections) == len(bodies)
    (ax,) = plot.leg_angles(scene, walk).axes
    assert legend_of(ax) == bodies
    assert ax.get_ylabel() == r"body angle, $\theta$ (rad)"
    for figure in (strobe, ax.figure, plot.phase_portrait(scene, walk, bodies=bodies[-1:])):
        assert_is_drawn(figure)


def test_an_angle_that_a_coupling_fixes_is_drawn(walks):
    scene, walk = walks["coupled"]
    (ax,) = plot.time_series(scene, walk, "theta_torso", "theta_leg_1", "theta_leg_2").axes
    torso, one, two = (line.get_ydata() for line in ax.lines)
    np.testing.assert_allclose(torso, 0.5 * (one + two), atol=1e-12)
    assert ax.get_ylabel() == "angle (rad)"
    (ax,) = plot.time_series(scene, walk, "hip_vx").axes
    assert ax.get_ylabel() == r"hip velocity along the slope, $\dot x_S$ (m/s)"


def test_each_foot_of_a_leg_has_its_line(walks):
    scene, walk = walks["flat"]
    names = ["foot_1.heel", "foot_1.toe", "foot_2.heel", "foot_2.toe"]
    figure = plot.contact_forces(scene, walk)
    normal = figure.axes[0]
    assert [line.get_label() for line in normal.lines] == names
    assert len({line.get_color() for line in normal.lines}) == 4
    assert "Heel strike of foot_2" in figure.axes[1].get_title(loc="left")
    # Double support is of legs: two of these four feet carry.
    assert figure.axes[1].patches
    assert legend_of(plot.penetrations(scene, walk).axes[0]) == names


def test_a_torso_is_within_the_picture(walks):
    scene, walk = walks["coupled"]
    animation = plot.animate(scene, walk)
    ax = animation._fig.axes[0]
    animation._func(0)
    line = next(line for line in ax.lines if line.get_label() == "torso")
    assert line.get_ydata().max() < ax.get_ylim()[1]
    animation._draw_was_started = True


@pytest.mark.parametrize(
    ("draw", "words"),
    [
        (lambda *walk: plot.time_series(*walk), "names is empty"),
        (lambda *walk: plot.time_series(*walk, "theta_nose"), "theta_nose"),
        (lambda *walk: plot.time_series(*walk, "hip_x", "hip_vx"), "m, m/s"),
        (lambda *walk: plot.phase_portrait(*walk, bodies=("nose",)), "nose"),
        (lambda *walk: plot.phase_portrait(*walk, legs=(3,)), "legs 1 to 2"),
    ],
)
def test_what_is_not_there_is_not_drawn(draw, words, walks):
    with pytest.raises(jb.ArgumentError, match=words):
        draw(*walks["kneed"])


@pytest.mark.parametrize(
    ("scene", "bodies"),
    [
        (jb.ladder()["rigid"], ["leg 1", "leg 2"]),
        (jb.models.hsu_chen(), ["thigh_1", "shank_1", "thigh_2", "shank_2"]),
        (jb.models.rimless_wheel(), ["wheel"]),
    ],
)
def test_the_orbit_of_a_gait_has_its_own_walker_s_bodies(scene, bodies):
    gait = jb.find_gait(scene, parameters=(), radius_sensitivities=False)
    (ax,) = plot.gait_orbit(gait).axes
    curves = {line.get_label(): line.get_xydata() for line in ax.lines if len(line.get_xdata()) > 1}
    assert list(curves) == bodies
    state = gait.measures.state
    for name, curve in curves.items():
        name = name.removeprefix("leg ")
        begin = [getattr(state, f"{word}_{name}") for word in ("theta", "omega")]
        np.testing.assert_allclose(curve[0], begin, atol=1e-9)


@pytest.mark.parametrize(
    ("value", "error", "cells"),
    [
        (0.123456789, 3e-5, ("0.123457", "3e-05")),
        (12.3456, 0.02, ("12.346", "0.02")),
        (12.3456, 2.0, ("12.3", "2")),
        (1234.56, 20.0, ("1235", "2e+01")),
        (123456.7, 300.0, ("123457", "3e+02")),
        (0.5, np.inf, ("0.5", "")),
        (0.25, 0.0, ("0.25", "0")),
    ],
)
def test_a_value_has_a_digit_more_than_its_error(value, error, cells):
    """And no digit behind the point where the error is of tens."""
    assert _with_error(value, error) == cells


def test_the_orbit_stands_left_of_the_multipliers():
    left, right = (ax.get_position() for ax in _gait_figure(made_gait()).axes[:2])
    assert left.x1 < right.x0
    assert left.y0 < right.y1
    assert right.y0 < left.y1
