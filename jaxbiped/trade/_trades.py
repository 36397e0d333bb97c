"""Trades: what accuracy costs ways of solving, for a walk and for a gait."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._ending import Ending
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.measure._energy_ledger import energy_ledger
from jaxbiped.measure._footsteps import heel_strikes
from jaxbiped.scene._parameter_access import parameter_names
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.scene._state_types import MinimalState, WalkerState
from jaxbiped.simulate._simulation import CompiledSimulation, Simulation
from jaxbiped.solve._accuracy import Precision, sizes_of
from jaxbiped.solve._trajectory import Trajectory
from jaxbiped.trade._study_row import (
    OK,
    Row,
    Truth,
    Values,
    Way,
    failed_row,
    row_of,
    truth_of,
    work_of,
)

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
