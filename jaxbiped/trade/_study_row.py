"""Rows of a study: ways of solving, their errors against a truth, their work, and the cheapest."""

import itertools
import math
import statistics
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxbiped._types import JsonObject

Values = Mapping[str, np.ndarray]
"""What a solve gave, by the name of the error axis."""
_AT_LEAST_ONE = ("multiplier",)
_IN_UNITS = ("state", "step_time")
"""Axes whose values have the scene's units already."""


class Truth(NamedTuple):
    """What counts as true.

    Attributes:
        values: by the name of the error axis.
        scales: units of the errors, likewise: 1 for states and step times, which are told in the
            scene's units; of all else the largest of the values, for multipliers 1 at least.
        floor: by how much two references disagree, in those units: no error below that is known.
    """

    values: Values
    scales: dict[str, float]
    floor: dict[str, float]

    def errors(self, found: Values) -> dict[str, float]:
        """Errors of what a solve gave; infinite where it is no number, or not as many numbers.

        Nothing is told of an axis whose truth has no numbers, as of heel strikes that never came.
        """
        return {
            name: _error(found[name], self.values[name], scale)
            for name, scale in self.scales.items()
            if name in found and np.size(self.values[name])
        }


def truth_of(values: Values, other: Values) -> Truth:
    """The truth by one reference, its floor by the other one.

    Args:
        values: arrays of the first reference, by the name of the error axis.
        other: those of the second; an axis that it lacks has no floor.
    """
    scales = {name: _scale(name, value) for name, value in values.items()}
    truth = Truth(values, scales, {})
    return truth._replace(floor=truth.errors(other))


def _scale(name: str, value: np.ndarray) -> float:
    if name in _IN_UNITS:
        return 1.0
    largest = float(np.max(np.abs(value), initial=0.0))
    return max(largest, 1.0) if name in _AT_LEAST_ONE or largest == 0.0 else largest


def _error(found: np.ndarray, true: np.ndarray, scale: float) -> float:
    if np.shape(found) != np.shape(true):
        return np.inf
    error = float(np.max(np.abs(np.subtract(found, true)), initial=0.0)) / scale
    return error if np.isfinite(error) else np.inf


class Way(NamedTuple):
    """A way of solving at one setting.

    Attributes:
        solver: a name in `SOLVERS`.
        engine: "lanes" or "xla".
        setting: what a user would write for the tolerance, such as "tight" or "rtol=1e-8".
        rtol: the relative tolerance that it stands for.
    """

    solver: str
    engine: str
    setting: str
    rtol: float

    @property
    def name(self) -> str:
        """Method and engine, without the setting."""
        return f"{self.solver} ({self.engine})"


_ENOUGH = 3.0
"""Runs that took so long together are not repeated again [s]."""


class Work(NamedTuple):
    """What a solve took.

    Attributes:
        seconds: median time of a warm run [s].
        cpu_s: median CPU time of a warm run, of all threads together [s].
        compile_s: by how much the first run took longer than a warm one [s].
    """

    seconds: float
    cpu_s: float
    compile_s: float


def work_of(run: Callable[[], Any], repeats: int) -> tuple[Any, Work]:
    """What `run` returns, and the work that it took.

    Args:
        run: solves; what it compiles is kept for its next call.
        repeats: warm runs of which the median counts; fewer where they take over 3 s together.

    Returns:
        What it returned last, and its work.
    """
    first, found = _time_of(run)
    spans: list[tuple[float, float]] = []
    while not spans or (len(spans) < repeats and sum(wall for wall, _ in spans) < _ENOUGH):
        span, found = _time_of(run)
        spans.append(span)
    wall, cpu = (statistics.median(span[k] for span in spans) for k in range(2))
    return found, Work(wall, cpu, max(first[0] - wall, 0.0))


def _time_of(run: Callable[[], Any]) -> tuple[tuple[float, float], Any]:
    """Time and CPU time of a run [s], and what it returned."""
    wall, cpu = time.perf_counter(), time.process_time()
    found = jax.block_until_ready(run())
    return (time.perf_counter() - wall, time.process_time() - cpu), found


OK = "ok"
ASTRAY = 0.05
"""Error, in the units of its axis, from which a solve that came to its end has still failed."""


class Row(NamedTuple):
    """One way of solving at one setting. A way that failed has a row all the same.

    Attributes:
        way: method and engine.
        setting: its tolerance or its step, as a user would write it.
        outcome: "ok", or in words what happened instead.
        errors: by the name of the error axis, in that axis's units; None where it is not finite.
        seconds, cpu_s, compile_s: as in `Work`; None where nothing ran.
        attempted, rejected: steps of the solver, None where they are not known.
    """

    way: str
    setting: str
    outcome: str
    errors: dict[str, float | None]
    seconds: float | None = None
    cpu_s: float | None = None
    compile_s: float | None = None
    attempted: int | None = None
    rejected: int | None = None

    def numbers(self) -> JsonObject:
        """The row ready for JSON."""
        return dict(self._asdict())


def row_of(
    way: str,
    setting: str,
    outcome: str,
    truth: Truth,
    values: Values,
    work: Work,
    *,
    attempted: int | None = None,
    rejected: int | None = None,
) -> Row:
    """The row of a solve, with its errors against the reference.

    Args:
        way: method and engine.
        setting: its tolerance or its step.
        outcome: "ok" where it came to its end, else what happened.
        truth: what its values are compared with.
        values: what it gave, by the name of the error axis.
        work: what it took.
        attempted: steps; rejected: those of them that were.

    Returns:
        A row whose outcome is "wrong" where an error is 0.05 or more although it came to its end.
    """
    errors = truth.errors(values)
    if outcome == OK and any(not error < ASTRAY for error in errors.values()):
        outcome = "wrong"
    told = {name: error if math.isfinite(error) else None for name, error in errors.items()}
    return Row(way, setting, outcome, told, *work, attempted, rejected)


def failed_row(way: str, setting: str, outcome: str) -> Row:
    """The row of a way that was refused or is not installed."""
    return Row(way, setting, outcome, {})


Cost = Callable[[Row], float | None]


def cheapest(rows: Iterable[Row], axis: str, error: float, cost: Cost) -> Row | None:
    """The cheapest row among those that reach an error; None where none does.

    Args:
        rows: of any ways.
        axis: name of the error axis.
        error: largest error allowed, in that axis's units.
        cost: of a row; None where it is not known.
    """
    good = [row for row in rows if _reaches(row, axis, error) and cost(row) is not None]
    return min(good, key=lambda row: _as_number(cost(row)), default=None)


def cost_at(rows: Sequence[Row], axis: str, error: float, cost: Cost) -> float | None:
    """Cost of one way at an error, between its settings along straight lines of the logarithms.

    Compared ways must be compared so: at one tolerance they have different errors.

    Args:
        rows: of one way, from its loosest setting to its finest.
        axis: name of the error axis.
        error: that every compared way is to have, in that axis's units.
        cost: of a row; None where it is not known.

    Returns:
        The least cost at which the way passes that error, None where it never does. A way whose
        loosest setting has a smaller error costs what that costs.
    """
    points = [
        (np.log(_as_number(row.errors[axis])), np.log(_as_number(cost(row))))
        for row in rows
        if _reaches(row, axis, np.inf) and cost(row) is not None
    ]
    if not points:
        return None
    aim = np.log(error)
    found = [points[0][1]] if points[0][0] <= aim else []
    for (e0, c0), (e1, c1) in itertools.pairwise(points):
        if e1 <= aim < e0:
            found.append(c0 + (c1 - c0) * (e0 - aim) / (e0 - e1))
    return float(np.exp(min(found))) if found else None


def _reaches(row: Row, axis: str, error: float) -> bool:
    reached = row.errors.get(axis)
    return row.outcome == OK and reached is not None and 0.0 < reached <= error


def _as_number(value: Any) -> float:
    return float(value)
