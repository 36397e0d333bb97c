"""Predicted gait: what a scene's gait would show of what was measured, and its derivatives."""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped._types import as_float
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.identify._measured_gait import MeasuredAngles, MeasuredGait
from jaxbiped.scene._parameters import with_parameters
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.scene._scene import Scene

AnyScene: TypeAlias = Scene | RigidScene
_DIFFERENCE = 3e-3
"""Relative change of a parameter for the derivatives of angles over time. Their part that is the
solve's error is then below 1e-4 of an angle's elasticity."""


class Prediction(NamedTuple):
    """Of n numbers and k parameters.

    Attributes:
        values: shape (n,).
        slopes: derivatives with respect to the parameters in units of their sizes, shape (n, k).
        slope_errors: their estimated errors.
        state: of the gait on the section; `state_slopes` its derivatives, leaves of shape (k,).
        found: whether there is a gait.
    """

    values: np.ndarray
    slopes: np.ndarray
    slope_errors: np.ndarray
    state: PyTree
    state_slopes: PyTree
    found: bool

    def state_at(self, moved: np.ndarray) -> PyTree:
        """The state where parameters are so many sizes further, to first order."""
        return jtu.tree_map(
            lambda leaf, slope: as_float(np.asarray(leaf) + float(slope @ moved)),
            self.state,
            self.state_slopes,
        )


def predict(
    scene: AnyScene,
    measured: MeasuredGait,
    parameters: dict[str, float],
    sizes: np.ndarray,
    guess: PyTree | None,
    *,
    accuracy: str,
    engine: str,
) -> Prediction:
    """The gait of a scene under these parameters, as far as it was measured.

    Args:
        scene: the walker.
        measured: what is wanted, and under which conditions.
        parameters: values of the k parameters by name.
        sizes: by how much each moves, shape (k,).
        guess: a state near the gait; None to search it.
        accuracy, engine: as for `find_gait`.
    """
    names = tuple(parameters)

    def gait_at(values: dict[str, float], guess: PyTree | None, wanted: tuple[str, ...]) -> Gait:
        own = with_parameters(scene, {**values, **measured.conditions})
        return find_gait(
            jtu.tree_map(as_float, own),
            guess,
            footsteps=measured.footsteps,
            parameters=wanted,
            accuracy=accuracy,
            radius_sensitivities=False,
            engine=engine,
        )

    gait = gait_at(parameters, guess, names)
    found = gait.outcome is Search.FOUND and bool(gait.sound)
    values, slopes, errors = (
        np.array([np.asarray(getattr(part, name)) for name in measured.measures])
        for part in (gait.measures, gait.sensitivities, gait.sensitivity_errors)
    )
    slopes, errors = (part.reshape(-1, len(names)) * sizes for part in (slopes, errors))
    if measured.angles is not None and found:
        over_time = measured.angles
        along = _slopes_of_angles(gait_at, gait, over_time, parameters, sizes)
        values = np.append(values, angles_at(gait, over_time))
        slopes = np.concatenate([slopes, along])
        errors = np.concatenate([errors, np.zeros_like(along)])
    state = gait.measures.state
    state_slopes = jtu.tree_map(lambda leaf: np.asarray(leaf) * sizes, gait.sensitivities.state)
    return Prediction(values, slopes, errors, state, state_slopes, found)


def angles_at(gait: Gait, angles: MeasuredAngles) -> np.ndarray:
    """The leg angles that were measured, of a gait: between its solver's steps by cubics.

    Raises:
        ArgumentError: times beyond the first footstep.
    """
    from scipy.interpolate import CubicHermiteSpline

    times, states = gait.orbit
    clock = np.asarray(times)[0]
    known = np.isfinite(clock)
    last = float(np.max(clock[known]))
    latest = float(np.max(np.asarray(angles.times)))
    if latest > 1.05 * last:
        raise ArgumentError(
            f"times = {latest:g} is not allowed: the footstep of this gait lasts {last:g} s."
        )
    columns = []
    for name in angles.known:
        rate = getattr(states, name.replace("theta", "omega"))
        spline = CubicHermiteSpline(
            clock[known], np.asarray(getattr(states, name))[0][known], np.asarray(rate)[0][known]
        )
        columns.append(spline(np.asarray(angles.times)))
    return np.concatenate(columns)


def _slopes_of_angles(
    gait_at: Callable[[dict[str, float], PyTree, tuple[str, ...]], Gait],
    gait: Gait,
    angles: MeasuredAngles,
    parameters: dict[str, float],
    sizes: np.ndarray,
) -> np.ndarray:
    """Central differences of the angles at fixed times, NaN where a gait is lost."""
    columns = []
    for k, (name, size) in enumerate(zip(parameters, sizes, strict=True)):
        ends = []
        for sign in (1.0, -1.0):
            moved = np.zeros(len(sizes))
            moved[k] = sign * _DIFFERENCE
            slopes = gait.sensitivities.state
            near = jtu.tree_map(
                lambda leaf, slope, moved=moved: as_float(leaf + float(slope @ (sizes * moved))),
                gait.measures.state,
                jtu.tree_map(np.asarray, slopes),
            )
            values = parameters | {name: parameters[name] + sign * _DIFFERENCE * size}
            ends.append(angles_at(gait_at(values, near, ()), angles))
        columns.append((ends[0] - ends[1]) / (2.0 * _DIFFERENCE))
    return np.stack(columns, axis=-1)
