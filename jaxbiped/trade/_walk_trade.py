"""Trade of a walk: state at its end, times of its heel strikes and energy ledger, against cost."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._ending import Ending
from jaxbiped.dynamics._state import MinimalState, State
from jaxbiped.measure._energy_ledger import energy_ledger
from jaxbiped.measure._footsteps import heel_strikes
from jaxbiped.scene._scene import Scene
from jaxbiped.simulate._simulation import CompiledSimulation, Simulation
from jaxbiped.solve._trajectory import Trajectory
from jaxbiped.solve._units import sizes_of
from jaxbiped.trade._reference_solution import Truth, Values, truth_of
from jaxbiped.trade._study_row import OK, Row, Way, failed_row, row_of, work_of

_FINEST = 1e-12
_REFERENCES = ("rodas5p", "rodas4p")
_MOST_STEPS = 1 << 20


class WalkTrade(NamedTuple):
    """A walk to be solved in many ways.

    Attributes:
        scene: a compliant walker in minimal coordinates.
        start: its state, where friction has bristles with or without these.
        duration: simulated time [s].
        repeats: warm runs of which the median counts.
    """

    scene: Scene
    start: State
    duration: float
    repeats: int = 3

    def truth(self) -> Truth:
        """By Rodas5P at a tolerance of 1e-12; its floor by Rodas4P at the same."""
        first, second = (
            self.values(Way(solver, "auto", "", _FINEST), books=True) for solver in _REFERENCES
        )
        return truth_of(first, second)

    def row(self, way: Way, truth: Truth) -> Row:
        """The row of one way: by lanes with its heel strikes and its energy ledger.

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
        """Units of a state's components, of the start's unless given: see `sizes_of`."""
        _, sizes = sizes_of(self.scene, self.start if state is None else state)
        return np.array(sizes)

    def _books(self, walk: Trajectory) -> dict[str, np.ndarray]:
        ledger = energy_ledger(self.scene, walk)
        time_unit, _ = sizes_of(self.scene, walk.final)
        shares = (
            ledger.gravity_work,
            ledger.damper_loss,
            ledger.friction_loss,
            ledger.stored_change,
        )
        return {
            "step_time": heel_strikes(self.scene, walk).time_s / time_unit,
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
