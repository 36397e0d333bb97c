"""The energy ledger of the rigid walker: where the work of gravity and actuators went."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._types import Scalar
from jaxbiped.dynamics._actuation import ActuatorPowers, actuator_powers
from jaxbiped.dynamics._energy import kinetic_and_moment
from jaxbiped.dynamics._impact import push_off_work
from jaxbiped.dynamics._rolling import rolling_hip_motion, rolling_rates
from jaxbiped.dynamics._state import RigidState, whole_state
from jaxbiped.measure._rigid_samples import states_after
from jaxbiped.measure._samples import NODES, Samples
from jaxbiped.scene._scene import RigidScene
from jaxbiped.solve._scene_key import check_scene_of
from jaxbiped.solve._trajectory import Trajectory

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
    powers = _powers(scene, states)

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


def _powers(scene: RigidScene, states: RigidState) -> ActuatorPowers:
    return actuator_powers(scene, rolling_hip_motion(states), (None, None))
