"""Family of a scene's gaits, and how they change with its parameters."""

from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped._types import JsonObject
from jaxbiped.sweep._attractor import Attractor
from jaxbiped.sweep._broadcast import broadcast_leaves
from jaxbiped.sweep._goals import NO_GAIT, Goals


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
        own, new = self.cycles, other.cycles
        if not any(self.rows):
            return np.zeros(1, dtype=int)
        return np.array([new.index(p) + i - own.index(p) for i, p in enumerate(own)])

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
        size = self.scales.shape[1]
        count = len(cycles)
        goals = Goals(
            np.zeros((count, size)),
            np.zeros((count, size - 1, size)),
            np.zeros((count, size - 1, size - 1)),
            np.zeros((count, 2, size)),
            np.zeros(count),
            np.full(count, NO_GAIT),
            self.scales[k],
        )
        for place, gait in zip(_places(self.rows[k], cycles), self.rows[k], strict=True):
            goals.points[place] = gait.point
            goals.metrics[place] = gait.metric
            goals.models[place] = gait.model
            goals.slowest[place] = gait.slowest
            goals.contractions[place] = gait.contraction
            goals.radii[place] = gait.radius
        return goals


def _places(row: tuple[Attractor, ...], cycles: tuple[int, ...]) -> list[int]:
    """Where each gait of a row stands among the cycles that there is room for."""
    free = list(range(len(cycles)))
    places = []
    for gait in row:
        place = next(i for i in free if cycles[i] == gait.cycle_footsteps)
        free.remove(place)
        places.append(place)
    return places
