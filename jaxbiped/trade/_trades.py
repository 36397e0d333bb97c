"""Trades: what accuracy costs ways of solving, for a walk and for a gait; rows of their results."""

import itertools
import math
import statistics
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._ending import Ending
from jaxbiped._types import JsonObject
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.hybrid._scales import sizes_of
from jaxbiped.measure._energy_ledger import energy_ledger
from jaxbiped.measure._footsteps import heel_strikes
from jaxbiped.scene._parameter_access import parameter_names
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.scene._state_types import MinimalState, WalkerState
from jaxbiped.simulate._simulation import CompiledSimulation, Simulation
from jaxbiped.simulate._trajectory import Trajectory
from jaxbiped.solve._accuracy import Precision

Values = Mapping[str, np.ndarray]
"""What a solve gave, by the name of the error axis."""
_FINEST = 1e-12
_REFERENCES = ("rodas5p", "rodas4p")
_MOST_STEPS = 1 << 20
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
    good = [(spent, row) for off, spent, row in _priced(rows, axis, cost) if off <= error]
    return min(good, key=lambda pair: pair[0], default=(None, None))[1]


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
    points = [(np.log(off), np.log(spent)) for off, spent, _ in _priced(rows, axis, cost)]
    if not points:
        return None
    aim = np.log(error)
    found = [points[0][1]] if points[0][0] <= aim else []
    for (e0, c0), (e1, c1) in itertools.pairwise(points):
        if e1 <= aim < e0:
            found.append(c0 + (c1 - c0) * (e0 - aim) / (e0 - e1))
    return float(np.exp(min(found))) if found else None


def _priced(rows: Iterable[Row], axis: str, cost: Cost) -> list[tuple[float, float, Row]]:
    """Error, cost and row of each solve that came to its end, with an error above 0 and a cost."""
    pairs = [(row.errors.get(axis), cost(row), row) for row in rows if row.outcome == OK]
    return [(off, spent, row) for off, spent, row in pairs if off and spent is not None]


class WalkTrade(NamedTuple):
    """A walk to be solved in many ways.

    Attributes:
        scene: a compliant walker in minimal coordinates.
        start: its state, where friction has bristles with or without these.
        duration: simulated time [s].
        repeats: warm runs of which the median counts.
    """

    scene: Scene
    start: MinimalState
    duration: float
    repeats: int = 3

    def truth(self) -> Truth:
        """By Rodas5P at a tolerance of 1e-12; its floor by Rodas4P at the same."""
        first, second = (
            self.values(Way(solver, "auto", "", _FINEST), books=True) for solver in _REFERENCES
        )
        return truth_of(first, second)

    def row(self, way: Way, truth: Truth) -> Row:
        """The row of one method; with the lanes engine, its heel strikes and energy ledger too.

        Through XLA, where a walk saved step by step compiles as long again, the state alone.
        """
        try:
            request = self._request(way, "end")
        except ArgumentError as error:
            return failed_row(way.name, way.setting, f"refused: {error}")
        walk, work = work_of(_compiled_once(request), self.repeats)
        ending = walk.outcome
        values = {"state": self.in_units(walk)}
        if ending is Ending.WALKING and way.engine == "lanes":
            values |= self.values(way, books=True)
        return row_of(
            way.name,
            way.setting,
            OK if ending is Ending.WALKING else str(ending),
            truth,
            values,
            work,
            attempted=int(walk.attempted),
            rejected=int(walk.rejected),
        )

    def values(self, way: Way, *, books: bool) -> Values:
        """What a way gives: the state and, with the books, times of heel strikes and energies."""
        walk = self._request(way, "steps" if books else "end")()
        state = {"state": self.in_units(walk)}
        return state | self._books(walk) if books else state

    def in_units(self, walk: Trajectory) -> np.ndarray:
        """The state at the end in l, √(l/g) and their quotients, shape (8,) or longer."""
        return np.array([float(x) for x in walk.final]) / self.units(walk.final)

    def units(self, state: MinimalState | None = None) -> np.ndarray:
        """Units of a state's components, see `sizes_of`. Default: those of the start."""
        _, sizes = sizes_of(self.scene, self.start if state is None else state)
        return np.array(sizes)

    def time_unit(self) -> float:
        """√(l/g) [s]."""
        return sizes_of(self.scene, self.start)[0]

    def _books(self, walk: Trajectory) -> dict[str, np.ndarray]:
        ledger = energy_ledger(self.scene, walk)
        shares = (
            ledger.gravity_work + ledger.actuation_work,
            ledger.damper_loss,
            ledger.friction_loss,
            ledger.stored_change,
        )
        return {
            "step_time": heel_strikes(self.scene, walk).time_s / self.time_unit(),
            "energy": np.array([float(each[0]) for each in shares]),
        }

    def _request(self, way: Way, save: str) -> Simulation:
        how: dict[str, Any] = dict(solver=way.solver, rtol=way.rtol, engine=way.engine)
        if way.engine != "xla":  # which makes room beforehand for every step that is saved
            how["max_solver_steps"] = _MOST_STEPS
        return Simulation.prepare(self.scene, self.start, duration=self.duration, save=save, **how)


def _compiled_once(request: Simulation) -> Callable[[], Trajectory]:
    """A request whose first call compiles it; through XLA its program serves every tolerance."""
    if request.engine == "xla":
        return request
    programs: list[CompiledSimulation] = []

    def run() -> Trajectory:
        if not programs:
            programs.append(request.compile())
        return programs[0]()

    return run


TANGENT_SHARE = 10.0
"""Tolerance of the columns, in units of the state's, as in the named accuracies."""
_FINEST_GAITS = {True: 1e-11, False: 1e-13}
"""Of the references, of compliant walkers and of rigid ones."""
_OF_CONTACT = ("K", "c", "xi")
_MOST_EVALUATIONS = 40


class GaitTrade(NamedTuple):
    """A gait to be found in many ways, from one start.

    Attributes:
        scene: the walker.
        repeats: warm runs of which the median counts.
        guess: that start. Default: the seed's start, fitted to the scene.
    """

    scene: Scene | RigidScene | RedundantScene
    repeats: int = 3
    guess: WalkerState | None = None

    @property
    def parameters(self) -> tuple[str, ...]:
        """What the period is differentiated by: K, c and ξ where there are such, else the slope."""
        known = parameter_names(self.scene)
        return tuple(name for name in _OF_CONTACT if name in known) or ("slope",)

    def truth(self) -> Truth | None:
        """By Rodas5P at the finest tolerance, its floor by Rodas4P's; None without a gait."""
        finest = _FINEST_GAITS[self.scene.compliant]
        first, second = (self.values(Way(s, "auto", "", finest)) for s in _REFERENCES)
        return None if first is None or second is None else truth_of(first, second)

    def values(self, way: Way) -> Values | None:
        """What a way gives; None where it finds no gait."""
        gait = self.find(way)
        return gait_values(gait) if gait.outcome is Search.FOUND else None

    def row(self, way: Way, truth: Truth) -> Row:
        """The row of one way; steps are those of the gait's last cycle."""
        try:
            gait, work = work_of(lambda: self.find(way), self.repeats)
        except ArgumentError as error:
            return failed_row(way.name, way.setting, f"refused: {error}")
        found = gait.outcome is Search.FOUND
        return row_of(
            way.name,
            way.setting,
            OK if found else str(gait.outcome),
            truth,
            gait_values(gait),
            work,
            attempted=int(gait.solver_steps),
        )

    def find(self, way: Way) -> Gait:
        """The gait by one way: with its derivatives, but without the spectral radius's."""
        # Arrays, for one compiled program to serve every tolerance.
        rtol, tangent_rtol = np.asarray(way.rtol), np.asarray(TANGENT_SHARE * way.rtol)
        return find_gait(
            self.scene,
            self.guess,
            parameters=self.parameters,
            accuracy=Precision(rtol, tangent_rtol),
            max_evaluations=_MOST_EVALUATIONS,  # and no stages beyond the first
            radius_sensitivities=False,
            solver=way.solver,
            engine=way.engine,
        )


def gait_values(gait: Gait) -> Values:
    """Period [s], absolute value of the largest multiplier, and the period's elasticities."""
    measures, slopes = jax.device_get((gait.measures, gait.elasticities.period))
    return {
        "period": np.atleast_1d(measures.period),
        "multiplier": np.atleast_1d(measures.spectral_radius),
        "gradient": np.atleast_1d(slopes),
    }
