"""Grazing: derivatives of a flight whose foot all but touches the ground, or barely does."""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from _scenes import seed_with
from reference.scipy_solves import scales, states_of

import jaxbiped as jb

from .case import check_numbers

START = np.array([0.0, 0.8, -0.5, -1.2, 0.3, 1.0, 10.0, 0.0])
"""A walker in flight: leg 1 swings past the vertical, leg 2 is held high."""
TIME = 0.08
_POINTS, _SHALLOW = 4000, 1e-6
"""No step of the check is longer than that share of the time, and than a smaller one the shallower
a contact is below that [m]: it is short."""
_LAWS = ("ristow-schafer", "kelvin-voigt", "hertz")
_ACCURACIES = ("balanced", "tight")
_FINE, _SHARE, _LARGEST = 1e-13, 0.2, 1e-6
"""Tolerance of the check, and its differences: a share of the distance from grazing, at most."""


class Grazing(NamedTuple):
    """Derivatives of the final state with respect to the start's height, about grazing.

    Attributes:
        law: of the normal force.
        accuracy: that ours were asked for at.
        heights: of the foot's lowest point had there been no ground [m], shape (n,).
        derivatives, differences: by us and by the check, shape (n, 8), in units of the walker's
            state over its leg length.
    """

    law: str
    accuracy: str
    heights: np.ndarray
    derivatives: np.ndarray
    differences: np.ndarray

    @property
    def flagged(self) -> np.ndarray:
        """Of which heights ours are NaN: told as not determined (booleans), (n,)."""
        return np.any(np.isnan(self.derivatives), axis=1)

    @property
    def errors(self) -> np.ndarray:
        """Largest differences over the largest derivative of that height or 1, shape (n,).

        NaN where there is a flag.
        """
        apart = np.max(np.abs(self.derivatives - self.differences), axis=1)
        return apart / np.maximum(1.0, np.max(np.abs(self.differences), axis=1))


def grazing(*, each: int = 25, laws: int = len(_LAWS)) -> list[Grazing]:
    """Sweeps through grazing, `each` heights above and below it, under up to three laws."""
    heights = np.geomspace(1e-9, 1e-3, each)
    heights = np.concatenate([-heights[::-1], heights])
    return [swept for name in _LAWS[:laws] for swept in _swept(name, heights)]


def grazing_scene(name: str) -> jb.Scene:
    """The seed's walker under a normal law like its own, with feet that may always touch."""
    return dataclasses.replace(seed_with(name), clearance=jb.laws.AlwaysTouching())


def _swept(name: str, heights: np.ndarray) -> list[Grazing]:
    scene = grazing_scene(name)
    p = check_numbers(scene)
    units, touching = scales(p, 8), START[1] - lowest(p)
    differences = np.array([_difference(touching + h, h, p) * p[2] / units for h in heights])
    found = []
    for accuracy in _ACCURACIES:

        def end(height: jax.Array, accuracy: str = accuracy) -> jb.State:
            state = jb.State(*map(jnp.asarray, START))._replace(hip_z=height)
            how = dict(save="end", watch=(), engine="lanes", accuracy=accuracy)
            return jb.simulate(scene, state, duration=TIME, **how).final

        slopes = jax.vmap(jax.jacfwd(end))(jnp.asarray(touching + heights))
        derivatives = np.stack(slopes, axis=1) * p[2] / units
        found.append(Grazing(name, accuracy, heights, derivatives, differences))
    return found


def lowest(p: np.ndarray) -> float:
    """Height of foot 1's lowest point on the flight from `START`, which stays in the air [m]."""
    states = states_of(START, p, TIME, _FINE, points=_POINTS)
    height = states[:, 1] - (p[2] - p[4]) * np.cos(states[:, 2]) - p[4]
    k = int(np.argmin(height))
    a, b, _ = np.polyfit([-1.0, 0.0, 1.0], height[k - 1 : k + 2] - height[k], 2)
    return float(height[k] - b * b / (4.0 * a))


def _difference(height: float, above: float, p: np.ndarray) -> np.ndarray:
    step = min(_LARGEST, _SHARE * abs(above))
    # A contact's duration goes with the root of its depth.
    points = int(_POINTS * np.sqrt(max(1.0, _SHALLOW / abs(above))))
    ends = []
    for sign in (1.0, -1.0):
        start = START.copy()
        start[1] = height + sign * step
        ends.append(states_of(start, p, TIME, _FINE, points=points)[-1])
    return (ends[0] - ends[1]) / (2.0 * step)
