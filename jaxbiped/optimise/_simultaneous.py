"""Simultaneous search: a cycle's segments, its period and the design as unknowns of one problem.

That segments join, that the cycle returns and that it ends on the section are equations, so no
design needs a gait of its own on the way: folds and violent multipliers are no obstacles. Bock and
Plitt, A multiple shooting algorithm for direct solution of optimal control problems (IFAC 1984).
"""

import functools
from typing import Any, NamedTuple, cast

import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped.caching._cached_jit import note_code
from jaxbiped.dynamics._equivalent_states import exchange_legs
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._poincare_map import recurring_components
from jaxbiped.gait._return_map import return_map
from jaxbiped.gait._return_map_spec import return_map_spec
from jaxbiped.gait._search_starts import default_guess
from jaxbiped.hybrid._landing_system import AbstractLandingSystem
from jaxbiped.hybrid._motion_costs import Extreme, Integral
from jaxbiped.hybrid._scales import recurring_sizes
from jaxbiped.hybrid._sections import section_of
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.optimise._augmented_system import MotionSection, motion_of
from jaxbiped.optimise._cycle_costs import CostedCycle
from jaxbiped.optimise._cycle_functionals import (
    Functional,
    Functionals,
    cycle_spec,
    functional_precision,
)
from jaxbiped.optimise._design_functions import AnyRow, rows_of
from jaxbiped.optimise._design_problem import DesignProblem
from jaxbiped.optimise._objective_values import Evaluation, with_costs
from jaxbiped.optimise._objectives import costs_of, with_parts
from jaxbiped.optimise._sequential_programming import Conditions
from jaxbiped.optimise._shooting import (
    Linearised,
    Segments,
    SegmentWeights,
    linearise_segments,
    pull_back_segments,
)
from jaxbiped.scene._parameter_access import select_parameters
from jaxbiped.solve._accuracy import Precision

_LEAST_PERIOD, _PERIOD, _MOST_PERIOD = 0.3, 2.2, 20.0
"""Periods of a footstep in units of √(l/g): the least, the first that is tried, the largest."""
_LEAST_STEP = 0.02
"""Least step in units of the walker's height: to stand still is a cycle, too."""
_APART = 1e-4
"""Distance of points whose first derivatives tell second ones, in units of the unknowns."""
FROM_CYCLE = 1e-3
"""Largest relative distance of the gait that is found near a cycle that solves all equations."""
_GRAZING = 1e-4
"""Rate at which the section is met, in units of the scene, below which no foot comes down."""
_NO_GAIT = cast(Gait, None)
"""What a sum of parameters needs of a gait."""
OF_CYCLE = ("period", "step_length", "speed")
"""Measures that a cycle has beside its costs."""


class _Known(NamedTuple):
    """What is known at a point: its conditions, and how they depend on the numbers of measures.

    Attributes:
        conditions: of the problem.
        by_sums: derivatives with respect to these of the objective, (f,), of the requirements among
            the equations, and of what must be at least zero, (r, f).
    """

    conditions: Conditions
    by_sums: tuple[np.ndarray, np.ndarray, np.ndarray]


class Simultaneous:
    """A design problem in z: starts of n segments, the period, and u.

    Starts and period are in units of the scene. Measures are functions of f numbers: the period,
    the parameters, what cyclic coordinates gain, and functions at nodes.

    Attributes:
        problem: what is designed.
        count: n.
        integrals: those that play a part.
        rtol: relative tolerance of the motion.
        least, most: bounds on z.
        sizes: of the m components of a start, SI units, shape (m,).
    """

    def __init__(self, problem: DesignProblem, count: int) -> None:
        scene, settings = problem.scene.minimal, problem.settings
        self.problem, self.count = problem, count
        costs = costs_of(with_parts(problem.wanted), scene)
        self.integrals = tuple(cost for cost in costs if isinstance(cost, Integral))
        self._path = tuple(cost for cost in costs if isinstance(cost, Extreme))
        self._scene, self._walker = scene, cast(AbstractLandingSystem, system_of(scene))
        system = CostedCycle.of(self._walker, self.integrals)
        pose = default_guess(scene)
        self._like = system.begin(pose)
        engine = cycle_spec_of(scene, settings.engine).engine
        self._spec = cycle_spec(scene, system, MotionSection(section_of(scene, None)), 1, engine)
        self._precision = functional_precision(settings.accuracy, scene)
        self.rtol = float(self._precision.rtol)
        # Second derivatives are differences, to which finer solves add nothing.
        self._rough_precision = functional_precision("draft", scene)
        _, self._active = select_parameters(scene, problem.variables.names)
        self.sizes = recurring_sizes(scene, pose)
        self._time, self._height = map(
            float, (self._walker.time_scale(scene), scene.mechanism.height)
        )
        # Of the starts, then the period and u.
        open_ = np.full(count * len(self.sizes), np.inf)
        low, high = _LEAST_PERIOD, _MOST_PERIOD
        for _, least, most in (r for r in problem.requirements if r.name == "period"):
            low = low if least is None else min(least / self._time, high)
            high = high if most is None else max(most / self._time, low)
        k = len(problem.variables.names)
        self.least = np.concatenate([-open_, [low], np.zeros(k)])
        self.most = np.concatenate([open_, [high], np.ones(k)])
        self._rows: list[AnyRow] = []
        for row in rows_of(problem):
            along = any(isinstance(cost, Extreme) for _, cost in problem.wanted[row.name].costs)
            nodes = range(count + 1) if along else ()
            at_nodes = [row._replace(name=f"{row.name} at {i}") for i in nodes]
            self._rows += at_nodes or [row]
        self._last: tuple[bytes, _Known] | None = None

    def rough_cycle(self, u: np.ndarray, pose: Any) -> np.ndarray:
        """The point z of straight lines in the angles, from a pose to that with legs exchanged."""
        scene, walker, place = self._scene, self._walker, len(self.least) - len(u) - 1
        period = self._time * float(np.clip(_PERIOD, self.least[place], self.most[place]))
        before, _ = walker.coordinates(scene, pose)
        after, _ = walker.coordinates(scene, exchange_legs(scene, pose))
        rates = [(b - a) / period for a, b in zip(before, after, strict=True)]
        starts = []
        for time in period * np.arange(self.count) / self.count:
            angles = [a + time * rate for a, rate in zip(before, rates, strict=True)]
            state = walker.with_coordinates(scene, pose, (*angles, *rates))
            state = walker.later(scene, state, functools.partial(jnp.asarray, time))
            starts.append(np.asarray(recurring_components(self._walker, state)))
        return self._point(np.array(starts), period, u)

    def followed_cycle(self, u: np.ndarray, start: Any, period: float) -> np.ndarray:
        """The point z of a gait of the first design, from its state."""
        first = np.asarray(recurring_components(self._walker, start))
        starts = np.tile(first, (self.count, 1))
        for i in range(1, self.count):
            segments = self._segments(starts[None], np.array([period]), u[None])
            starts[i:] = segments.ends.values[0, i - 1]
        return self._point(starts, period, u)

    def _point(self, starts: np.ndarray, period: float, u: np.ndarray) -> np.ndarray:
        return np.concatenate([(starts / self.sizes).ravel(), [period / self._time], u])

    def parts(self, z: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
        """Starts of the segments, shape (n, m), the period [s], and u."""
        place = self.count * len(self.sizes)
        starts = z[:place].reshape(self.count, -1) * self.sizes
        return starts, float(z[place]) * self._time, z[place + 1 :]

    def at(self, z: np.ndarray) -> Conditions:
        return self._known(z).conditions

    def why_no_gait(self, z: np.ndarray) -> str:
        """Why a cycle that solves all equations is none that a walker walks, in words."""
        starts, period, u = self.parts(z)
        scene = self.problem.scene_at(u)
        speed = float(
            self._segments(starts[None], np.array([period]), u[None]).arrival.values[0, 1]
        )
        if speed * self._time <= _GRAZING:
            return "the foot does not come down at the end but grazes the ground"
        state = self.problem.settings.state_of(scene, starts[0])
        time = float(return_map(scene, state).time)
        if not time < (1.0 - FROM_CYCLE) * period:
            return "no gait was found near it"
        return f"a foot comes down before its end, after {time:.4g} s of {period:.4g} s"

    def _known(self, z: np.ndarray) -> _Known:
        if self._last is None or self._last[0] != z.tobytes():
            starts, period, u = self.parts(z)
            segments = self._segments(starts[None], np.array([period]), u[None])
            only = jtu.tree_map(lambda leaf: leaf[0], segments)
            self._last = z.tobytes(), self._formed(z, only)
        return self._last[1]

    def _segments(
        self,
        starts: np.ndarray,
        periods: np.ndarray,
        u: np.ndarray,
        precision: Precision | None = None,
    ) -> Segments:
        """Segments of b cycles and designs, with derivatives with respect to parts of z."""
        variables = self.problem.variables
        note_code(self._spec, self._scene)
        cycles: Any = starts, periods / self.count, variables.values(u)
        precision = self._precision if precision is None else precision
        segments = linearise_segments(
            self._spec, self._scene, self._like, cycles, self._active, self._path, precision
        )
        units = np.append(self.sizes, self._time / self.count)
        scales = np.concatenate([np.tile(units, (len(u), 1)), variables.rates(u)], axis=1)

        def scaled(part: Linearised) -> Linearised:
            slopes = np.asarray(part.slopes)
            steps = scales.reshape(len(u), *[1] * (slopes.ndim - 2), -1)
            return Linearised(np.asarray(part.values), slopes * steps)

        return Segments(*map(scaled, segments))

    def _formed(self, z: np.ndarray, segments: Segments) -> _Known:
        starts, period, u = self.parts(z)
        n, m, place = self.count, starts.shape[1], starts.size

        def by_unknowns(slopes: np.ndarray, i: int) -> np.ndarray:
            """Derivatives with respect to z of functions of segment i."""
            whole = np.zeros((len(slopes), len(z)))
            whole[:, i * m : (i + 1) * m], whole[:, place:] = slopes[:, :m], slopes[:, m:]
            return whole

        def every(part: Linearised) -> np.ndarray:
            return np.stack([by_unknowns(x, min(i, n - 1)) for i, x in enumerate(part.slopes)])

        gaps = (segments.ends.values - np.roll(starts, -1, axis=0)) / self.sizes
        joints = every(segments.ends) / self.sizes[:, None]
        for i in range(n):
            behind = (i + 1) % n * m
            joints[i][:, behind : behind + m] -= np.eye(m)
        by_period = np.zeros((1, len(z)))
        by_period[0, place] = self._time
        gains, path = every(segments.gains).sum(axis=0), every(segments.path)
        by_design = np.zeros((len(z) - place - 1, len(z)))
        by_design[:, place + 1 :] = np.diag(self.problem.variables.rates(u))
        chain = np.concatenate([by_period, by_design, gains, path.reshape(-1, len(z))])
        gained = segments.gains.values.sum(axis=0)
        values = self.problem.variables.values(u)
        sums = [[period], values, gained, segments.path.values.ravel()]
        known = self._measures(np.concatenate(sums), u)
        total, step = self.problem.objective(known), known.functional("step_length")
        rows = [(row.equality, row.value(known), row.slopes(known)) for row in self._rows]
        rows.append((False, step.value / self._height - _LEAST_STEP, step.slopes / self._height))
        (equal, by_equal), (spare, by_spare) = (
            (
                np.array([value for kind, value, _ in rows if kind is equality]),
                np.reshape([x for kind, _, x in rows if kind is equality], (-1, len(chain))),
            )
            for equality in (True, False)
        )
        by_arrival = by_unknowns(segments.arrival.slopes, n - 1)
        conditions = Conditions(
            total.value,
            total.slopes @ chain,
            np.concatenate([gaps.ravel(), segments.arrival.values[:1], equal]),
            np.vstack(
                [
                    joints.reshape(-1, len(z)),
                    by_arrival[:1],
                    by_equal @ chain,
                ]
            ),
            np.append(spare, self._time * segments.arrival.values[1]),
            np.vstack([by_spare @ chain, self._time * by_arrival[1:]]),
        )
        return _Known(conditions, (total.slopes, by_equal, by_spare))

    def _measures(self, sums: np.ndarray, u: np.ndarray) -> Evaluation:
        """All measures as functions of their numbers; of extremes those at each node, too."""
        none = np.zeros(len(sums))
        parts = [
            Functional(value, 0.0, row, none)
            for value, row in zip(sums, np.eye(len(sums)), strict=True)
        ]
        length = parts[1 + len(u)]
        value = length.value / parts[0].value
        by_both = (length.slopes - value * parts[0].slopes) / parts[0].value
        rows = {"period": parts[0], "step_length": length}
        rows["speed"] = Functional(value, 0.0, by_both, none)
        every = with_parts(self.problem.wanted)
        for name, objective in every.items():
            if objective.measured is not None:
                total, _, by_parameter, _ = objective.measured(self.problem.scene_at(u), _NO_GAIT)
                row = none.copy()
                row[1 : 1 + len(u)] = by_parameter[self.problem.variables.places]
                rows[name] = Functional(total, 0.0, row, none)
        begin, r = 2 + len(u), len(self._path)
        d = begin + len(self.integrals)
        costs: dict[Any, Functional] = dict(zip(self.integrals, parts[begin:d], strict=True))
        for k, extreme in enumerate(self._path):
            nodes = parts[d + k :: r]
            costs[extreme] = nodes[int(np.argmax([extreme.sign * node.value for node in nodes]))]
            wanted = self.problem.wanted.items()
            for name in (name for name, measure in wanted if measure.costs == ((1.0, extreme),)):
                rows |= {f"{name} at {i}": node for i, node in enumerate(nodes)}
        functionals = None
        if costs:
            chosen = (costs[cost] for cost in costs_of(every, self._scene))
            columns: list[Any] = [*map(np.array, zip(*chosen, strict=True)), np.zeros(())]
            functionals = Functionals(*columns)
        rows = with_costs(every, rows, functionals, self._scene)
        fields: Any = zip(*rows.values(), strict=True)
        named: list[Any] = [dict(zip(rows, part, strict=True)) for part in fields]
        return Evaluation(*[*named, none[:1], np.zeros((1, len(sums)))])

    def weights(self, z: np.ndarray, of_equal: np.ndarray, of_spare: np.ndarray) -> SegmentWeights:
        """What the objective less multipliers times conditions makes of the segments."""
        place, k = self.count * len(self.sizes), len(z) - self.count * len(self.sizes) - 1
        objective, by_equal, by_spare = self._known(z).by_sums
        joints, arrival, required = np.split(of_equal, [place, place + 1])
        of_sums = objective - required @ by_equal - of_spare[:-1] @ by_spare
        gains, path = np.split(of_sums[1 + k :], [1 + len(self.integrals)])
        ends = -joints.reshape(self.count, -1) / self.sizes
        of_arrival = -np.append(arrival, self._time * of_spare[-1])
        return SegmentWeights(ends, gains, of_arrival, path.reshape(self.count + 1, -1))

    def pulled_back(
        self, z: np.ndarray, of_equal: np.ndarray, of_spare: np.ndarray, steps: int
    ) -> tuple[Any, np.ndarray]:
        """What `pull_back_segments` makes of the Lagrangian, one row behind the other.

        The walker's states, leaves of shape (l,), and derivatives of the Hamiltonian with respect
        to the variables' parameters, shape (l, k).
        """
        starts, period, u = self.parts(z)
        note_code(self._spec, self._scene)
        scene, cycle = self.problem.scene_at(u).minimal, cast(Any, (starts, period / self.count))
        weights = self.weights(z, of_equal, of_spare)
        how = self._active, self._path, self._precision, steps
        states, slopes = pull_back_segments(self._spec, scene, self._like, cycle, weights, *how)
        rows = list(np.asarray(states).reshape(-1, np.shape(states)[-1]).T)
        own = motion_of(jtu.tree_unflatten(jtu.tree_structure(self._like), rows))
        return own, np.asarray(slopes).reshape(len(rows[0]), -1)

    def curvature(self, z: np.ndarray, of_equal: np.ndarray, of_spare: np.ndarray) -> np.ndarray:
        """Second derivatives of the objective less multipliers times conditions, shape (n, n).

        They are differences of first derivatives. Those of a segment depend on its start, the
        period and u alone, so that m + 1 + k points tell all. Quotients count as linear.
        """
        starts, period, u = self.parts(z)
        n, m, place = self.count, len(self.sizes), starts.size
        weights = self.weights(z, of_equal, of_spare)
        steps = _APART * np.vstack([np.zeros(m + 1 + len(u)), np.eye(m + 1 + len(u))])
        steps[:, m + 1 :] *= np.where(u > 0.5, -1.0, 1.0)
        segments = self._segments(
            starts + steps[:, None, :m] * self.sizes,
            period + steps[:, m] * self._time,
            u + steps[:, m + 1 :],
            self._rough_precision,
        )
        slopes = np.einsum("d,bndj->bnj", weights.gains, segments.gains.slopes)
        slopes += np.einsum("nm,bnmj->bnj", weights.ends, segments.ends.slopes)
        slopes[:, -1] += weights.arrival @ segments.arrival.slopes
        nodes = np.einsum("nr,bnrj->bnj", weights.path, segments.path.slopes)
        slopes += nodes[:, :-1]
        slopes[:, -1] += nodes[:, -1]
        blocks = (slopes[1:] - slopes[0]) / np.sum(steps[1:], axis=1)[:, None, None]
        whole = np.zeros((len(z), len(z)))
        for i in range(n):
            where = np.r_[i * m : (i + 1) * m, place : len(z)]
            whole[np.ix_(where, where)] += 0.5 * (blocks[:, i] + blocks[:, i].T)
        return whole


def cycle_spec_of(scene: Any, engine: str) -> Any:
    """The return map of a walker's scene, by an engine that can."""
    start = default_guess(scene)
    return return_map_spec(scene, start, solver=None, engine=engine, max_solver_steps=1)
