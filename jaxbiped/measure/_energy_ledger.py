"""Energy ledgers: where the work of gravity and actuators went, on compliant and on rigid feet."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxbiped._checks import ArgumentError, check_increasing, check_type
from jaxbiped._types import Scalar
from jaxbiped.dynamics._actuation import actuator_powers
from jaxbiped.dynamics._energy import energies, kinetic_and_moment, powers
from jaxbiped.dynamics._impact import push_off_work
from jaxbiped.dynamics._rolling import rolling_hip_motion, rolling_rates
from jaxbiped.dynamics._state import RigidState, whole_state
from jaxbiped.measure._samples import NODES, Samples, evaluate_at, sample, states_after
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.solve._scene_key import check_scene_of
from jaxbiped.solve._trajectory import Trajectory


class EnergyLedger(NamedTuple):
    """Gravity's work and where it went, between consecutive times [J]; leaves of shape (n,).

    gravity_work + actuation_work = damper_loss + friction_loss + stored_change + residual. The
    residual is no physics: it measures the error of the solve.

    Attributes:
        gravity_work: work of gravity on the walker.
        damper_loss: lost in the contact's normal direction, including the elastic energy that a
            foot leaves in the ground when it lets go.
        friction_loss: lost to friction.
        stored_change: change of kinetic and elastic energy.
        residual: what the others leave open.
        actuation_work: work of the actuators on the walker; what a spring between the legs stores
            and a damper there loses is in it. Zero for a passive walker.
    """

    gravity_work: np.ndarray
    damper_loss: np.ndarray
    friction_loss: np.ndarray
    stored_change: np.ndarray
    residual: np.ndarray
    actuation_work: np.ndarray


def energy_ledger(
    scene: Scene, trajectory: Trajectory, times: np.ndarray | None = None
) -> EnergyLedger:
    """The energy ledger of a trajectory: gravity's work and where it went, between times.

    Energies are functions of the state; the works of the contact are integrals of its powers
    over the continuous solution.

    Args:
        scene: what was simulated.
        trajectory: the motion, saved step by step.
        times: between which the books are closed, increasing [s], shape (n + 1,); the trajectory's
            first and last unless given.

    Returns:
        The ledger of every interval [J], leaves of shape (n,); n = 1 unless `times` are given.

    Raises:
        ArgumentError: times that do not increase.
        ValueError: a trajectory without its continuous solution, or a batch of them.

    Examples:
        >>> import jaxbiped as jb
        >>> scene = jb.seed_scene()
        >>> how = dict(footsteps=2, accuracy="draft", engine="lanes")
        >>> walk = jb.simulate(scene, jb.seed_state(), **how)
        >>> books = jb.energy_ledger(scene, walk)
        >>> books.gravity_work.round(3), books.damper_loss.round(3)
        (array([0.195]), array([0.071]))
    """
    check_scene_of(trajectory, scene)
    trajectory.require_dense()
    if times is not None:
        check_increasing("times", times, 2)
    ends = np.asarray(trajectory.t)[[0, -1]] if times is None else np.asarray(times)
    held = evaluate_at(scene, trajectory, energies, ends)
    flows = sample(scene, trajectory, powers, ends)

    def between(power: np.ndarray) -> np.ndarray:
        return flows.totals(flows.integral(power), ends)

    gravity = -np.diff(held.gravitational)
    damper = between(flows.values.indentation) - np.diff(held.elastic)
    friction = between(flows.values.friction)
    stored = np.diff(held.kinetic) + np.diff(held.elastic)
    power = flows.values.actuation
    driven = np.zeros(len(ends) - 1) if power is None else between(power)
    residual = gravity + driven - damper - friction - stored
    return EnergyLedger(gravity, damper, friction, stored, residual, driven)


_PANELS = 24
"""Parts of a footstep, each with its Gauss points."""
_BEFORE = 1e-7
"""How long before its impact a footstep is looked at, in units of its period."""


class RigidLedger(NamedTuple):
    """Works and losses of footsteps, each from one heel strike to the next [J]; leaves (n,).

    gravity_work + actuation_work = impact_loss + stored_change + residual. The residual is no
    physics: it measures the error of the solve.

    Attributes:
        gravity_work: work of gravity on the walker.
        actuation_work: of the actuators, push-off included; what a spring between the legs stores
            and a damper there loses is in it. Zero for a passive walker.
        impact_loss: lost in the impact that ends the footstep.
        stored_change: change of kinetic energy, from just after one impact to just after the next.
        residual: what the others leave open.
        motor_work: what each motor does where its power is positive, added up, and the push-off.
    """

    gravity_work: np.ndarray
    actuation_work: np.ndarray
    impact_loss: np.ndarray
    stored_change: np.ndarray
    residual: np.ndarray
    motor_work: np.ndarray


def rigid_ledger(scene: RigidScene, walk: Trajectory[RigidState]) -> RigidLedger:
    """The energy ledger of the footsteps between the heel strikes that a rigid walk kept.

    Works are integrals of the actuators' powers over single support, walked again tightly.

    Args:
        scene: what walked.
        walk: with its heel strikes, by `max_arrivals`; one more than footsteps wanted.

    Returns:
        The ledger of every footstep [J], leaves of shape (n,).

    Raises:
        ArgumentError: arguments of the wrong type, or a walk that kept fewer than two heel strikes.

    Examples:
        >>> import jaxbiped as jb
        >>> scene = jb.ladder()["rigid"]
        >>> start = jb.dynamics.rigid_state(jb.seed_state())
        >>> walk = jb.rigid_walk(scene, start, footsteps=2, max_arrivals=2, engine="lanes")
        >>> books = jb.measure.rigid_ledger(scene, walk)
        >>> books.gravity_work.round(3), books.impact_loss.round(3)
        (array([0.076]), array([0.066]))
    """
    times, states = kept_strikes(scene, walk)
    starts = _rows(states, slice(-1))
    periods = np.diff(times)
    last, first = _before_impact(scene, starts, periods), _rows(states, slice(1, None))
    held_first, held_last = _energies(scene, starts), _energies(scene, last)
    after = _energies(scene, first)
    push = np.asarray(push_off_work(scene, last))
    hip, motors = _hip_works(scene, starts, periods)
    gravity = held_first[1] - held_last[1]
    work = hip + push
    loss = held_last[0] + push - after[0]
    stored = after[0] - held_first[0]
    residual = gravity + work - loss - stored
    return RigidLedger(gravity, work, loss, stored, residual, motors + np.maximum(push, 0.0))


def kept_strikes(scene: RigidScene, walk: Trajectory[RigidState]) -> tuple[np.ndarray, RigidState]:
    """Times [s] and states of the heel strikes that a walk kept, leaves of shape (n + 1,)."""
    check_type("scene", scene, RigidScene)
    check_type("walk", walk, Trajectory)
    check_type("walk.state", walk.state, RigidState)
    check_scene_of(walk, scene, "walk")
    assert walk.arrivals is not None
    times = np.asarray(walk.arrivals.t)
    known = np.isfinite(times)
    if times.ndim != 1 or known.sum() < 2:
        raise ArgumentError(
            "walk.arrivals has fewer than two heel strikes, which is not allowed: walk two "
            "footsteps or more with max_arrivals of as many."
        )
    return times[known], _rows(walk.arrivals.state, known)


def _rows(states: RigidState, rows: slice | np.ndarray) -> RigidState:
    return RigidState(*[jnp.asarray(leaf)[rows] for leaf in states])


def _energies(scene: RigidScene, states: RigidState) -> tuple[np.ndarray, np.ndarray]:
    kinetic, moment = kinetic_and_moment(scene, whole_state(scene, states))
    return np.asarray(kinetic), np.asarray(scene.ground.g * moment)


def _before_impact(scene: RigidScene, starts: RigidState, periods: np.ndarray) -> RigidState:
    """States just before the impacts that end footsteps."""
    rest = _BEFORE * periods
    near = states_after(scene, starts, periods - rest)
    rates = rolling_rates(scene, near)
    angles = [
        angle + rest * (rate + 0.5 * rest * alpha)
        for angle, rate, alpha in zip(near[1:3], near[3:], rates, strict=True)
    ]
    place = near.hip_x + rest * whole_state(scene, near).hip_vx
    return RigidState(place, *angles, *[w + rest * a for w, a in zip(near[3:], rates, strict=True)])


def _hip_works(
    scene: RigidScene, starts: RigidState, periods: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Work of all actuators at the hip in each footstep, and of motors where they drive [J]."""
    edges = np.linspace(0.0, 1.0, _PANELS + 1)
    if scene.actuation is None:
        return np.zeros(len(periods)), np.zeros(len(periods))
    shares = (edges[:-1, None] + np.diff(edges)[:, None] * 0.5 * (1.0 + NODES)).ravel()
    many = RigidState(*[jnp.repeat(leaf, len(shares)) for leaf in starts])
    states = states_after(scene, many, np.outer(periods, shares).ravel())
    powers = actuator_powers(scene, rolling_hip_motion(states), (None, None))

    def split(power: Scalar) -> np.ndarray:
        rows = np.broadcast_to(np.asarray(power), (many.theta_2.size,))
        return rows.reshape(len(periods), _PANELS, len(NODES))

    works, driven = np.zeros(len(periods)), np.zeros(len(periods))
    total, motors = split(powers.total), [split(power) for power in powers.motors]
    for k, period in enumerate(periods):
        samples = Samples(period * edges, None)
        works[k] = samples.integral(total[k]).sum()
        driven[k] = sum(samples.positive_integral(power[k]).sum() for power in motors)
    return works, driven
