"""What holds for every figure of a walk, against words, units and the axes' limits."""

import dataclasses
import subprocess
import sys

import jax
import jax.numpy as jnp
import pytest
from matplotlib.figure import Figure

import jaxbiped as jb
from jaxbiped import plot
from tests.drawn import assert_is_drawn, labels_of, points_of

ANGLE, TIME = r"leg angle, $\theta$ (rad)", "time, $t$ (s)"
LABELS = {
    plot.gait_strobe: {"horizontal position, $X$ (m)", "height, $Z$ (m)"},
    plot.phase_portrait: {ANGLE, r"leg rate, $\omega$ (rad/s)"},
    plot.leg_angles: {TIME, ANGLE},
    plot.penetrations: {TIME, r"penetration, $\delta$ (mm)"},
    plot.contact_forces: {
        TIME, "time after the foot touches, $t$ (ms)", "normal force, $F_N$ (N)",
        "tangential force, $F_T$ (N)",
    },
}  # fmt: skip
FIGURES = list(LABELS)


@pytest.fixture(scope="module")
def endings():
    """A fall and a stop."""
    found = []
    for slope in (0.04, 0.005):
        scene = jb.seed_scene(slope=slope)
        found.append((scene, jb.simulate(scene, jb.seed_state(), duration=10.0)))
    assert [str(walk.outcome) for _, walk in found] == ["fell forward", "stopped"]
    return found


@pytest.mark.parametrize("draw", FIGURES)
def test_motions_that_end_early_are_drawn(draw, endings):
    """To their end, and no further."""
    for scene, walk in endings:
        figure = draw(scene, walk)
        assert isinstance(figure, Figure)
        assert_is_drawn(figure)
        assert labels_of(figure) == LABELS[draw]
        if draw is plot.gait_strobe:
            continue  # its poses are those of test_motion_pictures.py
        first, end = points_of(figure.axes[0])[0], walk.final
        if draw is plot.phase_portrait:
            expected = (float(end.theta_1), float(end.omega_1))
            assert tuple(first[-1]) == pytest.approx(expected, abs=1e-9)
        else:
            assert first[-1, 0] == pytest.approx(float(walk.t[-1]), abs=1e-12)
            assert first[0, 0] == 0.0


@pytest.mark.parametrize("draw", [*FIGURES, plot.animate])
def test_the_continuous_solution_is_needed(draw, seed_walk):
    scene, walk = seed_walk
    with pytest.raises(ValueError, match='save="steps"'):
        draw(scene, dataclasses.replace(walk, dense=None))


@pytest.mark.parametrize("draw", [*FIGURES, plot.animate])
def test_a_batch_is_refused(draw, seed_walk):
    scene, walk = seed_walk
    batch = jax.tree_util.tree_map(lambda leaf: jnp.asarray(leaf)[None], walk)
    with pytest.raises(ValueError, match="batch"):
        draw(scene, batch)


@pytest.mark.parametrize("draw", [*FIGURES, plot.animate, plot.time_series, plot.view])
def test_a_walk_of_another_scene_is_refused(draw, seed_walk):
    with pytest.raises(jb.ArgumentError, match="was simulated with another one"):
        draw(jb.seed_scene(slope=0.03), seed_walk[1])


def test_pyplot_is_left_alone():
    code = (
        "import sys, jaxbiped; assert 'matplotlib' not in sys.modules;"
        "import jaxbiped.plot; assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
