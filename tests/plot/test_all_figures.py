"""What holds for every figure, against units, labels and the axes' limits."""

import dataclasses
import subprocess
import sys

import jax
import jax.numpy as jnp
import pytest
from matplotlib.figure import Figure

import jaxbiped as jb
from jaxbiped import plot
from tests.drawn import assert_is_drawn, points_of

FIGURES = [
    plot.gait_strobe,
    plot.phase_portrait,
    plot.leg_angles,
    plot.penetrations,
    plot.contact_forces,
]


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
        if draw is plot.gait_strobe:
            continue  # its poses are those of test_strobe.py
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


def test_pyplot_is_left_alone():
    code = (
        "import sys, jaxbiped; assert 'matplotlib' not in sys.modules;"
        "import jaxbiped.plot; assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
