"""Family of a scene's gaits over its parameters, and their search."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped._types import JsonObject, as_float
from jaxbiped.dynamics._state import state_of_recurring
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._search_starts import default_guess
from jaxbiped.hybrid._sections import AbstractSection
from jaxbiped.scene._parameter_access import SomeScene, with_parameters
from jaxbiped.scene._scene import AbstractScene
from jaxbiped.sweep._attractor import (
    Attractor,
    attractor_without_radius,
    component_scales,
    turned_offsets,
    with_radius,
)
from jaxbiped.sweep._convergence_test import NO_GAIT, Goals
from jaxbiped.sweep._follow_starts import Effort, broadcast_leaves

_SAME = 1e-5
"""Distance in the components' sizes up to which two states on the section are of one gait, where
its convergence is quick."""

Guesses = Mapping[int, Sequence[tuple[int, Sequence[float]]]]
"""By row of a family: footsteps in a cycle and states, without `ROOT_x`, from which to search."""


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
                        **gait.advance,
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
    scene: AbstractScene,
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
    scenes = [scene_with(scene, names, values) for values in table]

    def seek(k: int, near: PyTree) -> tuple[Attractor, ...]:
        guesses = [near] if default_guess(scene) is None else [near, None]
        found = _stable_gaits(scenes[k], guesses, scene.cycle_footsteps, effort.section)
        return tuple(with_radius(scenes[k], gait, effort) for gait in found)

    rows, states = _rows_from_neighbours(table, seek, guess)
    scales = [component_scales(own, state) for own, state in zip(scenes, states, strict=True)]
    return Family(names, table, rows, states, np.stack(scales))


def _rows_from_neighbours(
    table: np.ndarray, seek: Callable[[int, PyTree], tuple[Attractor, ...]], guess: PyTree
) -> tuple[tuple[tuple[Attractor, ...], ...], tuple[PyTree, ...]]:
    """Gaits of each combination, sought from the nearest that is known, and states to begin at."""
    spans = np.where(np.ptp(table, axis=0) > 0.0, np.ptp(table, axis=0), 1.0)
    rows: list[tuple[Attractor, ...]] = [()] * len(table)
    # Forward, then back: a gait may be found from one side only.
    for k in [*range(len(table)), *reversed(range(len(table)))]:
        if not rows[k]:
            known = [j for j, row in enumerate(rows) if row]
            off = [np.linalg.norm((table[j] - table[k]) / spans) for j in known]
            rows[k] = seek(k, rows[known[int(np.argmin(off))]][0].state if known else guess)
    known = [k for k, row in enumerate(rows) if row]
    states = []
    for k in range(len(table)):
        off_rows = [(abs(j - k), j) for j in known]
        state = rows[min(off_rows)[1]][0].state if known else guess
        states.append(jtu.tree_map(np.asarray, state))
    return tuple(rows), tuple(states)


def with_gaits(scene: AbstractScene, family: Family, effort: Effort, guesses: Guesses) -> Family:
    """The family that also knows the gaits to which these guesses lead."""
    rows = list(family.rows)
    for k, each in guesses.items():
        own, scales = scene_with(scene, family.names, family.table[k]), family.scales[k]
        for length, point in each:
            start = state_of_recurring(type(family.states[k]), point)
            seen = _stable_gaits(own, [start], length, effort.section)
            fresh = _unknown_among(seen, rows[k], scales)
            rows[k] = _in_order((*rows[k], *(with_radius(own, gait, effort) for gait in fresh)))
    # What starts take that they are not told stays, else they would be other starts.
    return family._replace(rows=tuple(rows))


def _unknown_among(
    gaits: Sequence[Attractor], known: Sequence[Attractor], scales: np.ndarray
) -> list[Attractor]:
    return [gait for gait in gaits if not any(_is_same_orbit(gait, old, scales) for old in known)]


def _in_order(gaits: Iterable[Attractor]) -> tuple[Attractor, ...]:
    """Stable by the cycles' lengths, from which positions follow."""
    return tuple(sorted(gaits, key=lambda gait: gait.cycle_footsteps))


def scene_with(scene: SomeScene, names: Sequence[str], values: np.ndarray) -> SomeScene:
    """The scene of one combination of parameters."""
    changed = with_parameters(scene, dict(zip(names, values, strict=True)))
    return jtu.tree_map(as_float, changed)


def _stable_gaits(
    scene: AbstractScene,
    guesses: Sequence[PyTree],
    length: int,
    section: AbstractSection | None,
) -> tuple[Attractor, ...]:
    """The stable gait that the first successful guess leads to, of its minimal cycle, or none.

    Its radius is not known yet.
    """

    def find(near: PyTree, count: int) -> Gait:
        begin = None if near is None else jtu.tree_map(as_float, near)
        return find_gait(scene, begin, footsteps=count, section=section, parameters=())

    gait = _stable_gait(find, guesses, length)
    return () if gait is None else (attractor_without_radius(scene, gait, section),)


def _stable_gait(
    find: Callable[[PyTree, int], Gait], guesses: Sequence[PyTree], length: int
) -> Gait | None:
    for guess in guesses:
        near, count = guess, length
        while True:
            gait = find(near, count)
            least = int(gait.cycle_footsteps)
            if not bool(gait.stable) or least == count:
                break
            near, count = gait.measures.state, least
        if bool(gait.stable):
            return gait
    return None


def _is_same_orbit(a: Attractor, b: Attractor, scales: np.ndarray) -> bool:
    """Whether two finds are of one orbit, which may begin at any of its crossings."""
    off = np.linalg.norm(turned_offsets(a.state, a.point - b.crossings) / scales, axis=1)
    # Where hardly anything is left out of a cycle's change, Newton's residual says little.
    return a.cycle_footsteps == b.cycle_footsteps and bool(
        off.min() < _SAME / (1.0 - b.contraction)
    )
