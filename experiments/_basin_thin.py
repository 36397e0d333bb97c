"""The simplest walker's basin: which starts, how they are labelled, and how far it reaches."""

from typing import Any

import _simplest
import numpy as np

import jaxbiped as jb

THETA, RATE = (0.0, 0.6), (-0.6, 0.0)
"""Stance angle [rad] and its rate [√(g/l)] just after a strike."""
OFF = (-0.015, 0.005)
"""The rate's difference from that of the walker which comes to rest upright, in the strip."""
FOOTSTEPS = 60


def scene_of(slope: float) -> jb.RigidScene:
    """A hip of mass one on massless legs: their own, at the feet, is far below rounding."""
    walker = jb.Walker(m=1e-13, J=0.0, l=1.0, d=1.0, r=0.0, hip_mass=1.0)
    return jb.RigidScene(walker=walker, ground=jb.Ground(slope=slope, g=1.0))


def just_struck(scene: jb.RigidScene, states: jb.dynamics.RigidState) -> jb.dynamics.RigidState:
    """Both feet on the ground, and the swing leg's rate from the impact."""
    theta, rate = states.theta_2, states.omega_2
    return states._replace(theta_1=-theta, omega_1=rate * np.cos(2.0 * theta))


def labelling_of(slope: float, **options: Any) -> jb.Labelling:
    """A labelling that knows the gait, found from the published equations' own."""
    theta, rate = _simplest.fixed_point(slope)
    guess = just_struck(scene_of(slope), jb.dynamics.RigidState(0.0, -theta, theta, rate, rate))
    return jb.labelling(scene_of(slope), guess=guess, footsteps=FOOTSTEPS, **options)


def fractions_of(labelling: jb.Labelling, side: int) -> jb.basins.Fraction:
    """Fraction of a grid over the whole square that walks, with its interval."""
    values = {"omega_stance": _middles(*RATE, side), "theta_stance": _middles(*THETA, side)}
    starts = jb.starts.grid(labelling.scene, values, follow=just_struck)
    found = jb.sweep(labelling, starts, look_for_gaits=False)
    walks = found["label"].values == int(jb.basins.Label.WALKING)
    low, high = jb.basins.wilson_interval(walks.sum(), walks.size)
    return jb.basins.Fraction(float(walks.mean()), float(low), float(high), int(walks.sum()))


def upright(theta: np.ndarray, slope: float) -> np.ndarray:
    """The rate with which the hip just reaches the top of its arc, by its energy."""
    return -np.sqrt(2.0 * (1.0 - np.cos(theta - slope)))


def labels_at(labelling: jb.Labelling) -> Any:
    """A function that labels points (n, 2): stance angle and rate just after a strike."""
    return jb.label_at(labelling, ("theta_stance", "omega_stance"), follow=just_struck)


def strip(labelling: jb.Labelling, slope: float, side: int) -> tuple[np.ndarray, ...]:
    """Angles, differences from the rate that leads upright, and labels, shape (side, side)."""
    theta, off = np.linspace(*THETA, side), np.linspace(*OFF, side)
    grid = np.meshgrid(theta, off)
    points = np.stack([grid[0].ravel(), (upright(grid[0], slope) + grid[1]).ravel()], axis=1)
    return theta, off, labels_at(labelling)(points).reshape(side, side)


def reach(
    labelling: jb.Labelling, gait: np.ndarray, *, max_distance: float = 0.5
) -> dict[str, Any]:
    """How far the basin reaches from the gait each way along each axis, by bisection."""
    found = {}
    for k, name in enumerate(("angle", "rate")):
        for sign, way in ((1.0, "+"), (-1.0, "-")):
            ray = np.eye(2)[k : k + 1] * sign
            push = jb.basins.minimal_fatal_shock(
                labels_at(labelling), gait, scales=np.ones(2), max_distance=max_distance,
                tolerance=1e-6, directions=ray, steps=2000, improved=0,
            )  # fmt: skip
            found[f"{name} {way}"] = {
                "distance": push.distance,
                "label": str(jb.basins.Label(push.label)),
            }
    return found


def compared(labelling: jb.Labelling, slope: float, count: int) -> dict[str, Any]:
    """Whether starts in the strip walk, by the labels and by SciPy on the published equations."""
    spread = np.random.default_rng(0).random((count, 2))
    theta = 0.05 + 0.4 * spread[:, 0]
    off = OFF[0] + (OFF[1] - OFF[0]) * spread[:, 1]
    points = np.stack([theta, upright(theta, slope) + off], axis=1)
    ours = labels_at(labelling)(points) == int(jb.basins.Label.WALKING)
    gait = _simplest.fixed_point(slope)
    theirs = np.array(
        [_simplest.walks(point, gait, slope, footsteps=FOOTSTEPS) for point in points]
    )
    return {
        "starts": count,
        "walking": int(ours.sum()),
        "walking_independently": int(theirs.sum()),
        "disagree": int((ours != theirs).sum()),
    }


def _middles(low: float, high: float, count: int) -> np.ndarray:
    """Middles of so many cells between two ends."""
    return low + (high - low) * (np.arange(count) + 0.5) / count
