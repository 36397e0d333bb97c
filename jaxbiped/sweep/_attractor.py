"""Attractor: a stable gait, and how far it certainly attracts starts.

A start that comes within the radius of certain attraction need be followed no further.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped._types import JsonObject, as_float
from jaxbiped.basins._label_oracle import spread_directions
from jaxbiped.basins._labels import Label
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._state import (
    recurring_leaves,
    recurring_names,
    recurring_periods,
    state_of_recurring,
    turned_difference,
)
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.hybrid._admissible_directions import projection_of
from jaxbiped.hybrid._sections import AbstractSection, section_of
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene._scene import AbstractScene
from jaxbiped.sweep._convergence_test import Goals
from jaxbiped.sweep._follow_starts import Effort, broadcast_leaves, follow_starts

_SHELLS = 1e-5 * 1.5 ** np.arange(30)
"""Distances that are tried."""
_STRIDE = 5
"""Every so many shells are tried first, then those between the last that is good and the next."""
_HALVED, _MOST_CYCLES = 0.5, 16
"""Samples are followed until the linear model leaves this share of their distance, or so long."""
_NOISE = 100.0
"""Distance that the solver may make of none in a cycle, in units of its tolerance."""
_DIRECTIONS = 128
_SHARE = 0.7
"""Of the largest distance from which every sample came nearer."""


class Attractor(NamedTuple):
    """A stable gait of a scene; its state without `ROOT_x`, or what else is cyclic in a hybrid
    system, has m components.

    Attributes:
        cycle_footsteps: number of footsteps of its cycle.
        duration: duration of the cycle [s].
        step_length: advance along the slope in a cycle [m]; of a hybrid system, that of its first
            cyclic coordinate, None without one.
        state: state on the section, a `State` or `RigidState` of numbers.
        multipliers: Floquet multipliers, largest first, shape (m − 1,).
        metric: W, shape (m − 1, m): near the gait, |W (x − x*)| falls by the factor `contraction`
            in a cycle.
        contraction: factor by which that distance falls, below 1.
        radius: distance within which every start is taken to converge, because a whole sample of
            starts on shells up to there came nearer (see `with_radius`). Negative if it was not
            measured, or if none came nearer.
        model: B, shape (m − 1, m − 1): to first order, a cycle multiplies W (x − x*) by B.
        slowest: ℓ, shape (2, m): |ℓ (x − x*)| is the offset along the leading multiplier's
            direction, in the metric.
        crossings: states on the section at every footstep of the cycle, shape (cycle_footsteps, m).
    """

    cycle_footsteps: int
    duration: float
    step_length: float | None
    state: PyTree
    multipliers: np.ndarray
    metric: np.ndarray
    contraction: float
    radius: float
    model: np.ndarray
    slowest: np.ndarray
    crossings: np.ndarray

    @property
    def point(self) -> np.ndarray:
        """Its state on the section without `ROOT_x`, shape (m,)."""
        return np.stack(recurring_leaves(self.state))

    @property
    def advance(self) -> JsonObject:
        """Its step length, ready for JSON; empty without one."""
        return {} if self.step_length is None else {"step_length_m": float(self.step_length)}

    @property
    def goal(self) -> tuple[npt.ArrayLike, ...]:
        """Its entry in the first fields of `Goals`, all but the scales."""
        return (self.point, self.metric, self.model, self.slowest, self.contraction, self.radius)

    def distance(self, states: np.ndarray) -> np.ndarray:
        """Distance in the metric, (n,), of states on the section without `ROOT_x`, (n, m)."""
        return np.linalg.norm(self.offsets_of(states) @ self.metric.T, axis=1)

    def offsets_of(self, states: np.ndarray) -> np.ndarray:
        """Offsets of such states from its point, modulo their periods, (n, m)."""
        return turned_offsets(self.state, states - self.point)


def turned_offsets(state: PyTree, offsets: np.ndarray) -> np.ndarray:
    """Offsets of recurring coordinates modulo the periods that those of a state have, (n, m)."""
    periods = recurring_periods(state)
    if not periods:
        return offsets
    return np.stack(list(map(turned_difference, offsets.T, periods)), axis=-1)


def attractor_without_radius(
    scene: AbstractScene, gait: Gait, section: AbstractSection | None = None
) -> Attractor:
    """A gait's metric, from its return map's derivative; its radius is not known yet.

    The metric is Lyapunov's for the derivative A on the section: with a contraction q between the
    spectral radius and 1, P = Σ (A/q)ᵏᵀ S (A/q)ᵏ gives |A e| ≤ q |e|, S measuring each component
    in its own size (`component_scales`).

    Raises:
        ArgumentError: the search found none, or the gait is not stable.
    """
    import scipy.linalg

    if int(gait.ending) != int(Search.FOUND) or not bool(gait.stable):
        raise ArgumentError(
            f"gait = {gait.outcome} with spectral radius {float(gait.measures.spectral_radius):g} "
            "is not allowed: starts converge only to a gait that was found and is stable."
        )
    state = jtu.tree_map(np.asarray, gait.measures.state)
    tangents = section_tangents(scene, state, section)
    size = len(recurring_names(state))
    slopes = tangents.T @ np.asarray(gait.return_jacobian)[:size] @ tangents
    contraction = 0.5 * (1.0 + float(gait.measures.spectral_radius))
    weights = tangents.T @ np.diag(component_scales(scene, state) ** -2.0) @ tangents
    squared = scipy.linalg.solve_discrete_lyapunov(slopes.T / contraction, weights)
    factor = np.linalg.cholesky(0.5 * (squared + squared.T))
    values, vectors = np.linalg.eig(slopes)
    first = np.argmax(np.abs(values))
    left = np.linalg.pinv(vectors)[first] * np.linalg.norm(factor.T @ vectors[:, first])
    advance = gait.measures.step_length
    return Attractor(
        cycle_footsteps=int(gait.cycle_footsteps),
        duration=float(gait.measures.period),
        step_length=None if advance is None else float(advance),
        state=state,
        multipliers=np.asarray(gait.multipliers),
        metric=factor.T @ tangents.T,
        contraction=contraction,
        radius=-1.0,
        model=factor.T @ slopes @ np.linalg.inv(factor.T),
        slowest=np.stack([left.real, left.imag]) @ tangents.T,
        crossings=np.stack(recurring_leaves(gait.orbit[1]), axis=-1)[:, 0],
    )


def section_tangents(
    scene: AbstractScene, state: PyTree, section: AbstractSection | None = None
) -> np.ndarray:
    """Orthonormal directions in which the section extends at a state, shape (m, m − 1)."""
    import scipy.linalg

    slope = _section_slope(section_of(scene, section), scene, jtu.tree_map(as_float, state))
    normal = np.stack(recurring_leaves(slope))
    return scipy.linalg.null_space(normal[None])


@cached_jit
def _section_slope(section: AbstractSection, scene: Any, state: PyTree) -> PyTree:
    return jax.grad(lambda y: section.value(scene, y))(state)


def component_scales(scene: AbstractScene, state: PyTree) -> np.ndarray:
    """Size of each component of a state without `ROOT_x`, shape (m,), SI units.

    Angles 1, velocities √(g l), rates √(g/l), the root point's height the penetration of the
    deepest foot of the stance leg. Those of a hybrid system are in its state's `scales`.
    """
    return np.array(recurring_leaves(system_of(scene).sizes(scene, state)))


def with_radius(scene: AbstractScene, attractor: Attractor, effort: Effort) -> Attractor:
    """The attractor with its radius measured: all starts of one shell after another.

    On each shell starts lie in many directions. The radius is a share of the last distance up to
    which every one of them returned and had come nearer, by at least half of what the metric
    promises. Where that is little in a cycle they are followed for several: on the way to a gait
    with a multiplier near −1, or a pair near the circle, a distance may well grow for once.
    """
    cycles = _cycles_to_halve(attractor.multipliers)
    radius = _radius_of(lambda shells: _draws_in(scene, attractor, shells, cycles, effort))
    return attractor._replace(radius=radius)


def _cycles_to_halve(multipliers: np.ndarray) -> int:
    """After how many cycles half of an offset is left, some at most."""
    rho = float(np.max(np.abs(multipliers)))
    needed = np.ceil(np.log(_HALVED) / np.log(np.clip(rho, 1e-9, 1.0 - 1e-9)))
    return int(np.clip(needed, 1, _MOST_CYCLES))


def _radius_of(draws_in: Callable[[np.ndarray], np.ndarray]) -> float:
    """A share of the last shell that is drawn in as all before it are; −1 where none is."""

    def leading(shells: np.ndarray) -> int:
        """How many of the shells, from the first on, are drawn in."""
        return int(np.cumprod(draws_in(shells)).sum())

    good = _STRIDE * leading(_SHELLS[_STRIDE - 1 :: _STRIDE])
    between = _SHELLS[good : good + _STRIDE - 1]
    good += leading(between) if len(between) else 0
    return _SHARE * float(_SHELLS[good - 1]) if good else -1.0


def _draws_in(
    scene: AbstractScene,
    attractor: Attractor,
    shells: np.ndarray,
    cycles: int,
    effort: Effort,
) -> np.ndarray:
    """Whether all samples at each of these distances are nearer after so many cycles.

    What is held stays so in all of them, and those that pass a stop do not count.
    """
    import scipy.linalg

    size = len(recurring_names(attractor.state))
    directions = spread_directions(_DIRECTIONS, size - 1)
    # The metric maps the section one to one: offsets whose images lie on shells.
    tangents = section_tangents(scene, attractor.state, effort.section)
    back = tangents @ np.linalg.inv(attractor.metric @ tangents)
    held = np.eye(size) - projection_of(scene, attractor.state)
    if held.any():
        own = tangents @ scipy.linalg.null_space(held @ tangents)
        reached = scipy.linalg.orth(attractor.metric @ own)
        directions = spread_directions(_DIRECTIONS, reached.shape[1]) @ reached.T
    offsets = (shells[:, None, None] * directions).reshape(-1, size - 1) @ back.T
    count = len(offsets)
    leaves = list((attractor.point + offsets).T)
    starts = state_of_recurring(type(attractor.state), leaves, np.zeros(count))
    # Followed wherever they go: the linear model decides nothing.
    nothing = np.full_like(attractor.model, np.inf)
    aim = attractor._replace(model=nothing, contraction=1.0, radius=-1.0)
    scales = component_scales(scene, attractor.state)
    goals = Goals(*[*(np.stack([each]) for each in aim.goal), scales])
    system = system_of(scene)
    strikes = cycles * attractor.cycle_footsteps + (0 if system.footsteps_end_on_section else 1)
    found = follow_starts(
        scene,
        starts,
        broadcast_leaves(goals, count),
        (attractor.cycle_footsteps,),
        effort._replace(footsteps=strikes, gap_share=0.0),
    )
    returned = (found.label == int(Label.UNRESOLVED)) & np.isfinite(found.final).all(axis=1)
    after = attractor.distance(np.where(returned[:, None], found.final, attractor.point))
    left = attractor.contraction**cycles
    noise = _NOISE * effort.rtol * (1.0 - left) / (1.0 - attractor.contraction)
    allowed = np.maximum(0.5 * (1.0 + left) * np.repeat(shells, len(directions)), noise)
    impossible = system.lies_beyond(scene, starts)
    nearer: np.ndarray = np.asarray(returned & (after <= allowed) | impossible)
    return np.asarray(nearer.reshape(len(shells), -1).all(axis=1))
