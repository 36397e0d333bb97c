"""Torque gap: what an optimum's motors could still save with torques that are free in time.

To the law of each motor an open-loop torque v(t) is added. With the multipliers of what holds the
optimum, the Lagrangian changes by ∫ s·v dt and a second variation, where s = ∂H/∂u, the derivative
of the Hamiltonian (rate of the cost plus costate times rates) with respect to the torques. Splines
v of a fine space are optimised. What v besides these would save is at most ∫ s·H_uu⁻¹ s dt/(2 α) at
their optimum, where the second variation is at least α ∫ v·H_uu v dt: high frequencies cost what
the integrand says, so that α is decided by smooth v, for which the reduced Hessian is known.
Bryson and Ho, Applied Optimal Control (1975), chapter 6.
"""

import functools
import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
import scipy  # its submodules are imported where they are first used

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._types import Scalar
from jaxbiped.dynamics._walker_motion import WalkerMotion
from jaxbiped.hybrid._motion_costs import Integral
from jaxbiped.optimise._design_problem import variables_of
from jaxbiped.optimise._objectives import costs_of, is_sum_of_parameters, with_parts
from jaxbiped.optimise._optimum import Optimum
from jaxbiped.optimise._sequential_programming import best_step, run_newton
from jaxbiped.optimise._simultaneous import Simultaneous
from jaxbiped.optimise._simultaneous_search import reason_against
from jaxbiped.scene._joint_parts import Motor
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._parameter_access import parameter_names, select_parameters
from jaxbiped.scene._state_types import CLOCK
from jaxbiped.scene.actuation._actuators import AbstractStanceTorque, spline_between
from jaxbiped.scene.actuation._time_laws import TimeSpline

_INTERVALS = 8, 64
"""Intervals of the added splines, at first at least and in the end at most."""
_LEFT = 0.1
"""Share of the bound that splines may leave before there are twice as many intervals."""
_SEGMENTS, _PLACES = 8, 16
"""Segments of the cycle, and places in an interval at which ∂H/∂u is known."""
_ITERATIONS = 30
"""Steps of the search for the best splines."""
_CONVEX = 1e-9
"""Least second derivative by the torques, as a share of the largest, that counts as above zero."""
_HELD = 1e-9
"""Slack up to which a condition holds the optimum."""


class TorqueGap(NamedTuple):
    """What torques that are free in time, added to the laws of an optimum, could still save.

    Everything else stays: parameters of the optimum are fixed, and what is required of its gait
    holds. Gaits far from this one may be better than the bound says.

    Attributes:
        bound: upper bound on what could be saved, its error included, in the objective's unit;
            infinite where none is known, as at a saddle with respect to such torques.
        error: the part of the bound that covers errors of the estimate and of the objective.
        times: times since the strike [s], shape (n,).
        switching: ∂H/∂u, the derivative of the Hamiltonian with respect to the torque of each
            motor's law, by the motor's name, at these times, shape (n,).
        intervals: number of intervals of the splines in time that were added to each law.
    """

    bound: float
    error: float
    times: np.ndarray
    switching: dict[str, np.ndarray]
    intervals: int


def torque_gap(best: Optimum) -> TorqueGap:
    """Bounds how much torques that are free in time could still save at an optimum.

    The objective must contain an integral that is strictly convex in the torque of every motor,
    such as "torque_squared" or "torque_squared_per_length". The laws may be any, and so may the
    formulation that found the optimum.

    Args:
        best: the optimum, of a walker on rigid feet whose mode does not change within a footstep.

    Returns:
        The bound with its error, and ∂H/∂u over the cycle.

    Raises:
        ArgumentError: the scene has no motor, the objective is not strictly convex in every torque,
            or the problem has no simultaneous formulation.
    """
    check_type("best", best, Optimum)
    least, most = _INTERVALS
    splines = time_splines(best.scene)
    intervals = max([least, *(2 * (len(spline.torque) - 3) for spline in splines)])
    while True:
        gap, left = _FreeTorques(best, intervals).gap()
        if left <= _LEFT * gap.bound or 2 * intervals > most or not np.isfinite(left):
            return gap
        intervals *= 2


def time_splines(scene: Any) -> list[TimeSpline]:
    """The splines in time among a scene's laws, in the order of its leaves."""
    leaves = jtu.tree_leaves(scene, is_leaf=lambda part: isinstance(part, TimeSpline))
    return [part for part in leaves if isinstance(part, TimeSpline)]


def coefficient_names(scene: Any, splines: Callable[[Any], list[TimeSpline]]) -> list[list[str]]:
    """Names of the coefficients of each of the `splines` of a scene."""
    names = parameter_names(scene)
    by_place = dict(zip(select_parameters(scene, names)[1], names, strict=True))
    leaves, structure = jtu.tree_flatten(scene.minimal)
    numbered = splines(jtu.tree_unflatten(structure, range(len(leaves))))
    return [[by_place[place] for place in spline.torque] for spline in numbered]


class _AddedTorque(AbstractStanceTorque):
    """A law plus a torque that is a function of time.

    Attributes:
        law: the law.
        added: the torque.
    """

    law: Any
    added: TimeSpline

    @property  # type: ignore[misc]
    def reaction(self) -> str:  # type: ignore[override]
        """The law's own, or "swing"."""
        return getattr(self.law, "reaction", "swing")

    def __call__(self, motion: Any) -> Scalar:
        return self.law(motion) + self.added(motion)

    def idle(self) -> "_AddedTorque":
        return eqx.tree_at(lambda law: law.added, self, self.added.idle())


class _FreeTorques:
    """The problem whose unknowns are the cycle and torques that are added to each motor's law.

    Attributes:
        motors: their names, j in all.
        count: coefficients of each torque, k.
        times: times since the strike at which ∂H/∂u is known [s].
    """

    def __init__(self, best: Optimum, intervals: int) -> None:
        problem, self.intervals, self.count = best.problem, intervals, intervals + 3
        self.period = float(best.gait.measures.period)
        self.motors = [name for name, _ in _laws(best.scene)]
        if not self.motors:
            raise ArgumentError("torque_gap is not allowed for a scene without a motor's law.")
        self.added = functools.partial(_with_added, best.scene, self.period)
        scene = self.added(np.zeros((len(self.motors), self.count)))
        state = best.gait.measures.state._asdict()
        self.start = scene.state_type(**({CLOCK: 0.0} | state))
        wanted = {name: problem.wanted[name] for name in problem.weights}
        costs = costs_of(with_parts(wanted), best.scene)
        integrals = {cost: 1.0 for cost in costs if isinstance(cost, Integral)}
        bends = np.linalg.eigvalsh(self.convexity(integrals, self.start))
        if not bends[0] > _CONVEX * bends[-1]:
            raise ArgumentError(
                f"torque_gap is not allowed for the objective {' + '.join(problem.weights)}: it "
                'must be strictly convex in the torque of every motor, as "torque_squared" is.'
            )
        size = float(scene.mechanism.total_mass * scene.ground.g * scene.mechanism.height)
        added = coefficient_names(scene, lambda scene: [law.added for _, law in _laws(scene)])
        # Sums of parameters stay as they are, and have other names here.
        sums = [name for name, each in problem.wanted.items() if is_sum_of_parameters(each)]
        names = itertools.chain(*added)
        variables = variables_of(scene, dict.fromkeys(names, (-size, size)))
        free = problem.variant(scene, variables=variables, without=sums)
        if reason := reason_against(free):
            raise ArgumentError(f"torque_gap is not allowed {reason}.")
        self.whole = Simultaneous(free, _SEGMENTS)
        self.steps = -(-_PLACES * intervals // _SEGMENTS)
        self.times = self.period * np.arange(self.steps * _SEGMENTS) / self.steps / _SEGMENTS

    def gap(self) -> tuple[TorqueGap, float]:
        """The gap, and the part of its bound that lies beyond the added splines."""
        none = np.full(len(self.motors) * self.count, 0.5)
        first = self.whole.followed_cycle(none, self.start, self.period)
        last, ended = run_newton(self.whole, first, _ITERATIONS, lambda z: None)
        held = self._multipliers(last)
        here, there = self.whole.at(first), self.whole.at(last)
        missed = held[0] @ (here.equal - there.equal)
        saved = float(here.objective - there.objective - missed)
        # Both objectives are known to the tolerance of the motion.
        error = 2.0 * self.whole.rtol * abs(here.objective)
        left = self._left(last, *held) if ended.converged else np.inf
        _, slopes = self._slopes(first, *self._multipliers(first))
        switching = dict(zip(self.motors, slopes.T, strict=True))
        bound = saved + error + left
        return TorqueGap(bound, error, self.times, switching, self.intervals), left

    def convexity(self, weights: dict[Integral, float], states: Any) -> np.ndarray:
        """Second derivatives of a sum of integrals' rates by the torques, shape (…, j, j)."""

        def rate(torques: Scalar, state: Any) -> Scalar:
            motion = WalkerMotion(self.added([[torque] * 4 for torque in torques]), state)
            rates = (weight * jnp.asarray(cost.rate(motion)) for cost, weight in weights.items())
            return sum(rates, jnp.zeros(()))

        hessian, none = jax.hessian(rate), jnp.zeros(len(self.motors))
        many = np.ndim(states[0]) > 0
        return np.asarray((jax.vmap(hessian, (None, 0)) if many else hessian)(none, states))

    def _multipliers(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Those with which ∂H/∂u is least and the Lagrangian is stationary in all else."""
        here = self.whole.at(z)
        others, q = len(z) - len(self.motors) * self.count, len(here.equal)
        held = np.flatnonzero(here.spare <= _HELD)
        slopes = np.vstack([here.equal_slopes, here.spare_slopes[held]])
        by_others, by_torques = slopes[:, :others].T, slopes[:, others:].T
        one = np.linalg.lstsq(by_others, here.gradient[:others])[0]
        free = scipy.linalg.null_space(by_others)
        left = here.gradient[others:] - by_torques @ one
        multipliers = one + free @ np.linalg.lstsq(by_torques @ free, left)[0]
        of_spare = np.zeros(len(here.spare))
        of_spare[held] = np.maximum(multipliers[q:], 0.0)
        return multipliers[:q], of_spare

    def _slopes(
        self, z: np.ndarray, of_equal: np.ndarray, of_spare: np.ndarray
    ) -> tuple[Any, np.ndarray]:
        """States along the cycle, and ∂H/∂u there, shape (n, j)."""
        states, slopes = self.whole.pulled_back(z, of_equal, of_spare, self.steps)
        return states, slopes.reshape(-1, len(self.motors), self.count).sum(axis=-1)

    def _left(self, z: np.ndarray, of_equal: np.ndarray, of_spare: np.ndarray) -> float:
        """The most that the best step, and torques besides the added splines, would save."""
        j, (states, first) = len(self.motors), self._slopes(z, of_equal, of_spare)
        here, curvature = self.whole.at(z), self.whole.curvature(z, of_equal, of_spare)
        gains = self.whole.weights(z, of_equal, of_spare).gains[1:]
        second = self.convexity(dict(zip(self.whole.integrals, gains, strict=True)), states)
        if np.min(np.linalg.eigvalsh(second)) <= 0.0:
            return np.inf
        step, units = self.times[1], tuple(jnp.eye(self.count)[:, :, None])
        middles, end = jnp.asarray(self.times + 0.5 * step), jnp.asarray(self.period)
        basis = np.asarray(spline_between(units, jnp.zeros(()), end, middles))
        gram = step * np.einsum("tab,it,kt->aibk", second, basis, basis)
        rates = self.whole.problem.variables.rates(np.full(j * self.count, 0.5))
        gram = gram.reshape(len(rates), -1) * np.outer(rates, rates)
        held = np.vstack([here.equal_slopes, here.spare_slopes[of_spare > 0.0]])
        free = scipy.linalg.null_space(held)
        torques = free[-len(rates) :]
        bends, size = free.T @ curvature @ free, torques.T @ gram @ torques
        least = float(scipy.linalg.eigh(bends, size, eigvals_only=True)[0])
        if not least > 0.0:
            return np.inf
        solved = np.linalg.solve(second, first[..., None])[..., 0]
        beyond = 0.5 * step * float(np.sum(first * solved)) / least
        return beyond + best_step(self.whole, z, here, curvature).gain


def _laws(scene: Any) -> list[tuple[str, Any]]:
    """Laws of motors at the joints and torques at the hip, with the motors' names."""
    joints = scene.walker.joints if isinstance(scene.walker, Mechanism) else ()
    motors = [part for part in joints if isinstance(part, Motor)]
    hip = [part for part in scene.actuation or () if isinstance(part, AbstractStanceTorque)]
    at_joints = [(motor.name or motor.kind, motor.law) for motor in motors]
    return at_joints + [(part.name or type(part).__name__, part) for part in hip]


def _with_added(scene: Any, span: float, coefficients: Any) -> Any:
    """The scene with a spline in time added to the law of each motor."""
    laws = [
        _AddedTorque(law=law, added=TimeSpline(torque=tuple(row), span=span))  # type: ignore[call-arg]
        for (_, law), row in zip(_laws(scene), coefficients, strict=True)
    ]
    return eqx.tree_at(lambda scene: [law for _, law in _laws(scene)], scene, laws)
