"""Family of a scene's gaits over its parameters: their search, and how far each attracts starts.

A start that comes within the radius of certain attraction need be followed no further.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple, cast

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
from jaxbiped.dynamics._contacts import feet
from jaxbiped.dynamics._footfalls import leg_depth
from jaxbiped.dynamics._state import recurring_leaves, state_of_recurring
from jaxbiped.dynamics._surfaces import AbstractSection
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.scene._parameter_access import SomeScene, with_parameters
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.solve._accuracy import sizes_of
from jaxbiped.sweep._convergence_test import NO_GAIT, Goals
from jaxbiped.sweep._follow_starts import Effort, broadcast_leaves, follow_starts, passes_a_stop
from jaxbiped.variational._hybrid_system import projection_of, section_of

_SHELLS = 1e-5 * 1.5 ** np.arange(30)
"""Distances that are tried."""
_STRIDE = 5
"""Every so many shells are tried first, then those between the last that is good and the next."""
_HALVED, _MOST_CYCLES = 0.5, 16
"""Samples are followed until the linear model leaves this share of their distance, or so long."""
_NOISE = 100.0
"""Distance that the solver may make of none in a cycle, in units of its tolerance."""
_DIRECTIONS = 128
_SHALLOW = 1e-9
"""Depth of a foot in units of length up to which it just touches."""
_SHARE = 0.7
"""Of the largest distance from which every sample came nearer."""
_SAME = 1e-5
"""Distance in the components' sizes up to which two states on the section are of one gait, where
its convergence is quick."""

Guesses = Mapping[int, Sequence[tuple[int, Sequence[float]]]]
"""By row of a family: footsteps in a cycle and states, without `ROOT_x`, from which to search."""


class Attractor(NamedTuple):
    """A stable gait of a scene; its state without `ROOT_x` has m components.

    Attributes:
        cycle_footsteps: number of footsteps of its cycle.
        duration: duration of the cycle [s].
        step_length: advance along the slope in a cycle [m].
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
    step_length: float
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
    def goal(self) -> tuple[npt.ArrayLike, ...]:
        """Its entry in the first fields of `Goals`, all but the scales."""
        return (self.point, self.metric, self.model, self.slowest, self.contraction, self.radius)

    def distance(self, states: np.ndarray) -> np.ndarray:
        """Distance in the metric, (n,), of states on the section without `ROOT_x`, (n, m)."""
        return np.linalg.norm((states - self.point) @ self.metric.T, axis=1)


def attractor_without_radius(scene: Scene | RigidScene, gait: Gait) -> Attractor:
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
    tangents = section_tangents(scene, state)
    size = len(state) - 1
    slopes = tangents.T @ np.asarray(gait.return_jacobian)[:size] @ tangents
    contraction = 0.5 * (1.0 + float(gait.measures.spectral_radius))
    weights = tangents.T @ np.diag(component_scales(scene, state) ** -2.0) @ tangents
    squared = scipy.linalg.solve_discrete_lyapunov(slopes.T / contraction, weights)
    factor = np.linalg.cholesky(0.5 * (squared + squared.T))
    values, vectors = np.linalg.eig(slopes)
    first = np.argmax(np.abs(values))
    left = np.linalg.pinv(vectors)[first] * np.linalg.norm(factor.T @ vectors[:, first])
    return Attractor(
        cycle_footsteps=int(gait.cycle_footsteps),
        duration=float(gait.measures.period),
        step_length=float(gait.measures.step_length),
        state=state,
        multipliers=np.asarray(gait.multipliers),
        metric=factor.T @ tangents.T,
        contraction=contraction,
        radius=-1.0,
        model=factor.T @ slopes @ np.linalg.inv(factor.T),
        slowest=np.stack([left.real, left.imag]) @ tangents.T,
        crossings=np.stack(recurring_leaves(gait.orbit[1]), axis=-1)[:, 0],
    )


def section_tangents(scene: Scene | RigidScene, state: PyTree) -> np.ndarray:
    """Orthonormal directions in which the section extends at a state, shape (m, m − 1)."""
    import scipy.linalg

    slope = _section_slope(section_of(scene, None), scene, jtu.tree_map(as_float, state))
    normal = np.stack(recurring_leaves(slope))
    return scipy.linalg.null_space(normal[None])


@cached_jit
def _section_slope(section: AbstractSection, scene: Scene | RigidScene, state: PyTree) -> PyTree:
    return jax.grad(lambda y: section.value(scene, y))(state)


def component_scales(scene: Scene | RigidScene, state: PyTree) -> np.ndarray:
    """Size of each component of a state without `ROOT_x`, shape (m,), SI units.

    Angles 1, velocities √(g l), rates √(g/l), the root point's height the penetration of the
    deepest foot of the stance leg.
    """
    _, sizes = sizes_of(scene, state)
    if scene.compliant:
        structure = scene.mechanism.structure
        found = leg_depth(structure, feet(cast(Scene, scene), state), structure.stance_leg)
        depth, length = abs(float(found)), float(scene.mechanism.height)
        # A start whose foot just touches tells no depth.
        height = depth if depth > _SHALLOW * length else length
        sizes = sizes._replace(**{structure.coordinates[1]: height})
    return np.array(recurring_leaves(sizes))


def with_radius(scene: Scene | RigidScene, attractor: Attractor, effort: Effort) -> Attractor:
    """The attractor with its radius measured: all starts of one shell after another.

    On each shell starts lie in many directions. The radius is a share of the last distance up to
    which every one of them returned and had come nearer, by at least half of what the metric
    promises. Where that is little in a cycle they are followed for several: on the way to a gait
    with a multiplier near −1, or a pair near the circle, a distance may well grow for once.
    """
    rho = float(np.max(np.abs(attractor.multipliers)))
    needed = np.ceil(np.log(_HALVED) / np.log(np.clip(rho, 1e-9, 1.0 - 1e-9)))
    cycles = int(np.clip(needed, 1, _MOST_CYCLES))

    def leading(shells: np.ndarray) -> int:
        """How many of the shells, from the first on, are drawn in."""
        return int(np.cumprod(_draws_in(scene, attractor, shells, cycles, effort)).sum())

    good = _STRIDE * leading(_SHELLS[_STRIDE - 1 :: _STRIDE])
    between = _SHELLS[good : good + _STRIDE - 1]
    good += leading(between) if len(between) else 0
    return attractor._replace(radius=_SHARE * float(_SHELLS[good - 1]) if good else -1.0)


def _draws_in(
    scene: Scene | RigidScene,
    attractor: Attractor,
    shells: np.ndarray,
    cycles: int,
    effort: Effort,
) -> np.ndarray:
    """Whether all samples at each of these distances are nearer after so many cycles.

    What is held stays so in all of them, and those that pass a stop do not count.
    """
    import scipy.linalg

    size = len(attractor.state) - 1
    directions = spread_directions(_DIRECTIONS, size - 1)
    # The metric maps the section one to one: offsets whose images lie on shells.
    tangents = section_tangents(scene, attractor.state)
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
    strikes = cycles * attractor.cycle_footsteps + (1 if scene.compliant else 0)
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
    impossible = passes_a_stop(scene, starts._asdict())
    nearer: np.ndarray = np.asarray(returned & (after <= allowed) | impossible)
    return np.asarray(nearer.reshape(len(shells), -1).all(axis=1))


class Family(NamedTuple):
    """Stable gaits for each of P combinations of parameters (one, where none differ).

    Attributes:
        names: of the q parameters that differ, none for ().
        table: their values, shape (P, q).
        rows: the gaits of each combination, P tuples; any may be empty.
        states: for each combination, a state on the section where starts take what they are not
            told: that of the gait that was found first, else a neighbour's, else the guess.
        scales: size of each component of the state, shape (P, m).
    """

    names: tuple[str, ...]
    table: np.ndarray
    rows: tuple[tuple[Attractor, ...], ...]
    states: tuple[PyTree, ...]
    scales: np.ndarray

    @property
    def cycles(self) -> tuple[int, ...]:
        """Cycle lengths for which the labelling loop has room: for every row's gaits."""
        most: Counter[int] = Counter()
        for row in self.rows:
            most |= Counter(gait.cycle_footsteps for gait in row)
        return tuple(sorted(most.elements())) or (1,)

    def goals(
        self, parameters: Mapping[str, np.ndarray], count: int
    ) -> tuple[Goals, tuple[int, ...]]:
        """For n starts with these parameters: what they may converge to, and the cycle lengths.

        Raises:
            ArgumentError: parameters for which no gait was looked for.
        """
        cycles = self.cycles
        tables = [self._goals_of(k, cycles) for k in range(len(self.rows))]
        if not self.names:
            # The gaits are those of the scene's own parameters, not of others.
            own = tables[0]
            if parameters:
                own = own._replace(radii=np.full_like(own.radii, NO_GAIT))
            return broadcast_leaves(own, count), cycles
        rows = self.row_of(parameters)
        columns = zip(*tables, strict=True)
        return Goals(*[np.stack(column)[rows] for column in columns]), cycles

    def places_in(self, other: "Family") -> np.ndarray:
        """Where another family, with more gaits, has what this one has at each position."""
        if not any(self.rows):
            return np.zeros(1, dtype=int)
        return np.array(_places(self.cycles, other.cycles))

    def row_of(self, parameters: Mapping[str, np.ndarray]) -> np.ndarray:
        """The combination that each start has, shape (n,).

        Raises:
            ArgumentError: parameters for which no gait was looked for.
        """
        if set(parameters) != set(self.names):
            raise ArgumentError(
                f"parameters = {sorted(parameters)} is not allowed: the gaits are known for "
                f"{sorted(self.names)}."
            )
        given = np.stack([parameters[name] for name in self.names], axis=1)
        known = {tuple(values): k for k, values in enumerate(self.table)}
        unique, which = np.unique(given, axis=0, return_inverse=True)
        try:
            places = np.array([known[tuple(values)] for values in unique], dtype=int)
        except KeyError as missing:
            pairs = zip(self.names, missing.args[0], strict=True)
            shown = ", ".join(f"{name} = {value:g}" for name, value in pairs)
            raise ArgumentError(
                f"{shown} is not allowed: no gait was looked for there; prepare the labelling "
                "with these parameters."
            ) from None
        return np.asarray(places[which.reshape(-1)])

    def described(self) -> list[JsonObject]:
        """Each row's parameters and gaits, ready for JSON."""
        return [
            {
                "parameters": dict(zip(self.names, map(float, values), strict=True)),
                "gaits": [
                    {
                        "cycle_footsteps": gait.cycle_footsteps,
                        "duration_s": float(gait.duration),
                        "step_length_m": float(gait.step_length),
                        "multipliers": [[float(v.real), float(v.imag)] for v in gait.multipliers],
                        "point": [float(x) for x in gait.point],
                        "radius": float(gait.radius),
                    }
                    for gait in row
                ],
            }
            for values, row in zip(self.table, self.rows, strict=True)
        ]

    def _goals_of(self, k: int, cycles: tuple[int, ...]) -> Goals:
        m = self.scales.shape[1]
        shapes = (m,), (m - 1, m), (m - 1, m - 1), (2, m), ()
        none: tuple[npt.ArrayLike, ...] = (*map(np.zeros, shapes), NO_GAIT)
        entries = [none] * len(cycles)
        own = tuple(gait.cycle_footsteps for gait in self.rows[k])
        for place, gait in zip(_places(own, cycles), self.rows[k], strict=True):
            entries[place] = gait.goal
        return Goals(*[*map(np.stack, zip(*entries, strict=True)), self.scales[k]])


def _places(own: tuple[int, ...], room: tuple[int, ...]) -> list[int]:
    """Where gaits with cycles of these lengths stand among the lengths that there is room for."""
    return [room.index(length) + own[:i].count(length) for i, length in enumerate(own)]


def find_family(
    scene: Scene | RigidScene,
    effort: Effort,
    *,
    parameters: Mapping[str, Sequence[float] | np.ndarray],
    guess: PyTree,
) -> Family:
    """The gait of one cycle, a step or a stride, for every combination of the parameters' values.

    Each search begins from the nearest gait found so far, the first from the guess, and one that
    fails goes on without a guess.
    """
    names = tuple(parameters)
    grids = np.meshgrid(*[np.asarray(parameters[name], float) for name in names], indexing="ij")
    table = np.stack([grid.ravel() for grid in grids], axis=1) if names else np.zeros((1, 0))
    spans = np.where(np.ptp(table, axis=0) > 0.0, np.ptp(table, axis=0), 1.0)
    scenes = [scene_with(scene, names, values) for values in table]
    rows: list[tuple[Attractor, ...]] = [()] * len(table)
    # Forward, then back: a gait may be found from one side only.
    for k in [*range(len(table)), *reversed(range(len(table)))]:
        if not rows[k]:
            known = [j for j, row in enumerate(rows) if row]
            off = [np.linalg.norm((table[j] - table[k]) / spans) for j in known]
            near = rows[known[int(np.argmin(off))]][0].state if known else guess
            least = scene.mechanism.structure.cycle_footsteps
            found = _stable_gaits(scenes[k], [near, None], least)
            rows[k] = tuple(with_radius(scenes[k], gait, effort) for gait in found)
    known = [k for k, row in enumerate(rows) if row]
    states = []
    for k in range(len(table)):
        off_rows = [(abs(j - k), j) for j in known]
        state = rows[min(off_rows)[1]][0].state if known else guess
        states.append(jtu.tree_map(np.asarray, state))
    scales = [component_scales(own, state) for own, state in zip(scenes, states, strict=True)]
    return Family(names, table, tuple(rows), tuple(states), np.stack(scales))


def with_gaits(
    scene: Scene | RigidScene, family: Family, effort: Effort, guesses: Guesses
) -> Family:
    """The family that also knows the gaits to which these guesses lead."""
    rows = list(family.rows)
    for k, each in guesses.items():
        own, scales = scene_with(scene, family.names, family.table[k]), family.scales[k]
        for length, point in each:
            start = type(family.states[k])(0.0, *point)
            new = [
                with_radius(own, gait, effort)
                for gait in _stable_gaits(own, [start], length)
                if not any(_is_same_orbit(gait, old, scales) for old in rows[k])
            ]
            # Stable by the cycles' lengths, from which positions follow.
            rows[k] = tuple(sorted([*rows[k], *new], key=lambda gait: gait.cycle_footsteps))
    # What starts take that they are not told stays, else they would be other starts.
    return family._replace(rows=tuple(rows))


def scene_with(scene: SomeScene, names: Sequence[str], values: np.ndarray) -> SomeScene:
    """The scene of one combination of parameters."""
    changed = with_parameters(scene, dict(zip(names, values, strict=True)))
    return jtu.tree_map(as_float, changed)


def _stable_gaits(
    scene: Scene | RigidScene, guesses: Sequence[PyTree], length: int
) -> tuple[Attractor, ...]:
    """The stable gait that the first successful guess leads to, of its minimal cycle, or none.

    Its radius is not known yet.
    """
    for guess in guesses:
        near, count = guess, length
        while True:
            gait = find_gait(
                scene,
                None if near is None else jtu.tree_map(as_float, near),
                footsteps=count,
                parameters=(),
            )
            least = int(gait.cycle_footsteps)
            if not bool(gait.stable) or least == count:
                break
            near, count = gait.measures.state, least
        if bool(gait.stable):
            return (attractor_without_radius(scene, gait),)
    return ()


def _is_same_orbit(a: Attractor, b: Attractor, scales: np.ndarray) -> bool:
    """Whether two finds are of one orbit, which may begin at any of its crossings."""
    off = np.linalg.norm((a.point - b.crossings) / scales, axis=1)
    # Where hardly anything is left out of a cycle's change, Newton's residual says little.
    return a.cycle_footsteps == b.cycle_footsteps and bool(
        off.min() < _SAME / (1.0 - b.contraction)
    )
