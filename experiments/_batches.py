"""Batches of starts to label: a slice through the seed's basin, draws from it, and their times."""

import functools
import warnings
from collections.abc import Callable
from typing import Any

from _scenes import rigid_seed
from _timing import seconds_of

import jaxbiped as jb

THETA, OMEGA = (-0.5, 0.8), (-4.0, 5.0)
"""The slice: angle [rad] and rate [rad/s] of the swing leg at mid-stance, all else the gait's."""
AXES = ("angle of the swing leg at mid-stance, θ", "its rate, ω")
UNITS = ("rad", "rad/s")
WALKING = int(jb.basins.Label.WALKING)
RIGID = {"theta_stance": (0.1, 0.4), "omega_stance": (-2.4, -0.6)}
"""Starts of the rigid walker just after a strike: stance angle [rad] and its rate [rad/s]."""


def rolling_on(scene: jb.RigidScene, states: jb.dynamics.RigidState) -> jb.dynamics.RigidState:
    """Both feet on the ground."""
    return states._replace(theta_1=-states.theta_2)


def labelling_of(model: str, **options: Any) -> jb.labels.Labelling:
    """Of the seed's walker, "compliant" or "rigid"."""
    return jb.labelling(rigid_seed() if model == "rigid" else jb.seed_scene(), **options)


def starts_of(
    scene: Any, count: int, *, method: str = "uniform", seed: int = 0
) -> jb.starts.Sample:
    """So many random starts: of the compliant walker in the slice."""
    how: dict[str, Any] = dict(method=method, seed=seed)
    if isinstance(scene, jb.RigidScene):
        return jb.starts.sample(scene, RIGID, count, follow=rolling_on, **how)
    bounds = {"theta_swing": THETA, "omega_swing": OMEGA}
    return jb.starts.sample(scene, bounds, count, **how)


def swept(labelling: jb.labels.Labelling, count: int, **options: Any) -> Callable[[], Any]:
    """A sweep of starts, to be run and timed; in memory unless a store is given."""
    starts, how = starts_of(labelling.scene, count), {"chunk": 16384} | options
    return lambda: jb.sweep(labelling, starts, look_for_gaits=False, **how)


@functools.cache  # its gait is found once
def _labelling(model: str, how: tuple[tuple[str, Any], ...]) -> jb.labels.Labelling:
    return labelling_of(model, **dict(how))


def labelled(model: str, starts: jb.starts.Sample, *, look: bool = True, **how: Any) -> Any:
    """A sweep's dataset, which tells what a warning would: of labels in doubt, or out of steps.

    `look`: whether the sweep looks for gaits that the labelling does not know.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return jb.sweep(_labelling(model, tuple(how.items())), starts, look_for_gaits=look)


def least_seconds(work: dict[Any, Callable[[], Any]], rounds: int) -> dict[Any, float]:
    """Least seconds of runs that take turns."""
    return seconds_of(work, rounds, warm=False, statistic=min)
