"""Energy ledgers: where the work of gravity and actuators went, on compliant and on rigid feet."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import check_increasing, check_type
from jaxbiped._types import rows_of
from jaxbiped.dynamics._energy import energies, is_driven, powers
from jaxbiped.dynamics._impact import push_off_work
from jaxbiped.dynamics._stance_motion import rolling_field
from jaxbiped.measure._samples import (
    NODES,
    ModeChanges,
    Samples,
    evaluate_along,
    evaluate_at,
    kept_strikes,
    mode_changes,
    sample,
    states_after,
)
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.simulate._trajectory import Trajectory, check_scene_of

_PANELS, _PARTS, _SPLITS = 48, 4, 10
"""Parts of a footstep, each with its Gauss points; into how many one is split, and how often."""
_SETTLED = 1e-8
"""What a split may change, in units of the largest power times the footstep's period."""
_BEFORE = 1e-7
"""How long before its impact a footstep is looked at, in units of its period."""


class EnergyLedger(NamedTuple):
    """Gravity's work and where this energy goes, between consecutive times [J]; leaves (n,).

    gravity_work + actuation_work = damper_loss + friction_loss + stored_change + residual. The
    residual has no physical meaning; it measures the error of the solve.

    Attributes:
        gravity_work: work of gravity on the walker.
        damper_loss: energy lost in the normal direction of contact, including the elastic energy
            that a foot leaves in the ground at release, and in springs, stops and latches of
            joints.
        friction_loss: energy lost to friction.
        stored_change: change of kinetic and elastic energy.
        residual: imbalance of the other terms.
        actuation_work: work of motors and actuators on the walker, including the energy that a
            spring among the actuators stores and a damper loses. Zero for a passive walker.
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
    """The energy ledger of a trajectory: gravity's work, and where this energy goes.

    Energies are functions of the state. The work of contact forces is the integral of their power
    over the continuous solution.

    Args:
        scene: the scene that was simulated.
        trajectory: the motion, with every step saved.
        times: increasing times [s], shape (n + 1,), that bound the intervals. Default: the first
            and the last of the trajectory.

    Returns:
        The ledger of every interval [J], with leaves of shape (n,); n = 1 if `times` is omitted.

    Raises:
        ArgumentError: the times do not increase, or the scene is that of a rigid walker (see
            `jaxbiped.measure.rigid_ledger`).
        ValueError: the trajectory has no continuous solution, or is a batch.

    Examples:
        >>> import jaxbiped as jb
        >>> scene = jb.seed_scene()
        >>> how = dict(footsteps=2, accuracy="draft", engine="lanes")
        >>> walk = jb.simulate(scene, jb.seed_state(), **how)
        >>> books = jb.measure.energy_ledger(scene, walk)
        >>> books.gravity_work.round(3), books.damper_loss.round(3)
        (array([0.195]), array([0.071]))
    """
    check_type("scene", scene, Scene, RedundantScene)
    check_scene_of(trajectory, scene)
    trajectory.require_dense()
    if times is not None:
        check_increasing("times", times, 2)
    ends = np.asarray(trajectory.t)[[0, -1]] if times is None else np.asarray(times)
    return ledger_and_motors(scene, trajectory, ends)[0]


def ledger_and_motors(
    scene: Scene, trajectory: Trajectory, ends: np.ndarray
) -> tuple[EnergyLedger, np.ndarray]:
    """The ledger between n + 1 times [s], and the motors' positive work [J], shape (n,)."""
    held = evaluate_at(scene, trajectory, energies, ends)
    flows = sample(scene, trajectory, powers, ends)

    def between(power: np.ndarray) -> np.ndarray:
        return flows.totals(flows.integral(power), ends)

    gravity = -np.diff(held.gravitational)
    damper = between(flows.values.indentation) - np.diff(held.elastic)
    friction = between(flows.values.friction)
    stored = np.diff(held.kinetic) + np.diff(held.elastic)
    power, motors = flows.values.actuation, np.zeros(len(ends) - 1)
    driven = np.zeros(len(ends) - 1) if power is None else between(power)
    for motor in flows.values.motors or ():
        motors += flows.totals(flows.positive_integral(motor), ends)
    residual = gravity + driven - damper - friction - stored
    return EnergyLedger(gravity, damper, friction, stored, residual, driven), motors


class RigidLedger(NamedTuple):
    """Work and losses of footsteps, each from one heel strike to the next [J]; leaves (n,).

    gravity_work + actuation_work = impact_loss + stop_loss + joint_loss + stored_change + residual.
    The residual has no physical meaning; it measures the error of the solve.

    Attributes:
        gravity_work: work of gravity on the walker.
        actuation_work: work of motors and actuators, including push-off and the energy that a
            spring among the actuators stores and a damper loses. Zero for a passive walker.
        impact_loss: energy lost in the impact that ends the footstep.
        stored_change: change of kinetic and elastic energy, from just after one impact to just
            after the next.
        residual: imbalance of the other terms.
        motor_work: sum of the positive work of each motor and of the push-off.
        joint_loss: energy lost in dampers and latches of the walker's joints.
        stop_loss: energy lost when a stop is hit, or another foot of the standing leg lands.
    """

    gravity_work: np.ndarray
    actuation_work: np.ndarray
    impact_loss: np.ndarray
    stored_change: np.ndarray
    residual: np.ndarray
    motor_work: np.ndarray
    joint_loss: np.ndarray
    stop_loss: np.ndarray


def rigid_ledger(scene: RigidScene, walk: Trajectory[Any]) -> RigidLedger:
    """The energy ledger of the footsteps between the saved heel strikes of a rigid walk.

    Work is the integral of the power of all that drives over single support, simulated again
    tightly.

    Args:
        scene: the scene that was simulated.
        walk: a walk with its heel strikes saved (`max_arrivals`).

    Returns:
        The ledger of every footstep [J], with leaves of shape (n,).

    Raises:
        ArgumentError: an argument has the wrong type, or fewer than two heel strikes are saved.

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
    starts = rows_of(states, slice(-1))
    periods = np.diff(times)
    last, first = _before_impact(scene, starts, periods), rows_of(states, slice(1, None))
    held_first, held_last, after = (
        evaluate_along(scene, states, energies) for states in (starts, last, first)
    )
    push = np.asarray(push_off_work(scene, last))
    changes = mode_changes(scene, starts, (1.0 - _BEFORE) * periods)

    def energy(number: np.ndarray, since: np.ndarray) -> np.ndarray:
        there = states_after(scene, rows_of(starts, number), since)
        return np.sum(evaluate_along(scene, there, energies), axis=0)

    driving = motors = joints = np.zeros(len(periods))
    if is_driven(scene) or scene.mechanism.joints:
        sampled = functools.partial(_sampled_powers, scene, starts)
        driving, motors, joints = _works(sampled, periods, changes)
    gravity = held_first.gravitational - held_last.gravitational
    loss = held_last.kinetic + push - after.kinetic
    stored = after.kinetic - held_first.kinetic + held_last.elastic - held_first.elastic
    work = driving + push
    stops = _stop_losses(energy, periods, changes)
    residual = gravity + work - loss - stops - joints - stored
    motors = motors + np.maximum(push, 0.0)
    return RigidLedger(gravity, work, loss, stored, residual, motors, joints, stops)


_InFootsteps: TypeAlias = Callable[..., np.ndarray]
"""A function of numbers of footsteps and of times in them [s]."""


def _stop_losses(energy: _InFootsteps, periods: np.ndarray, changes: ModeChanges) -> np.ndarray:
    """What changes of mode take in each footstep [J], shape (n,): energy at once before and behind.

    NaN where there was no room for all of them.
    """
    number, lost = changes.number, np.zeros(len(periods))
    if len(number):
        rest = _BEFORE * periods[number]
        # Joints lose in between as well, so that energies are continued up to the change.
        before, behind = (
            2.0 * energy(number, changes.since + r) - energy(number, changes.since + 2.0 * r)
            for r in (-rest, rest)
        )
        np.add.at(lost, number, before - behind)
    return np.where(changes.known, lost, np.nan)


def _before_impact(scene: RigidScene, starts: Any, periods: np.ndarray) -> Any:
    """States just before the impacts that end footsteps."""
    rest = _BEFORE * periods
    near = states_after(scene, starts, periods - rest)
    rates = jtu.tree_map(np.asarray, rolling_field(0.0, near, scene))
    moved = jtu.tree_map(lambda leaf, rate: leaf + rest * rate, near, rates)
    angles = {
        angle: getattr(moved, angle) + 0.5 * rest * rest * getattr(rates, rate)
        for rate in near._fields
        if (angle := rate.replace("omega_", "theta_")) != rate
    }
    return moved._replace(**angles)


def _works(powers: _InFootsteps, periods: np.ndarray, changes: ModeChanges) -> np.ndarray:
    """Computes works in each footstep [J], shape (3, n), from powers as `_sampled_powers` has them.

    They are the work of all that drives, that of motors where they drive, and what joints lose.
    """
    count = len(periods)
    works, sizes = np.zeros((3, count)), np.zeros(count)
    # Powers jump where the mode changes, so that no panel straddles a change. Panels are split
    # where a motor's law jumps or bends, and where a damper settles.
    even = np.linspace(0.0, 1.0, _PANELS + 1)
    edges = [
        np.unique([*(period * even), *changes.since[changes.number == k]])
        for k, period in enumerate(periods)
    ]
    number = np.repeat(np.arange(count), [len(ends) - 1 for ends in edges])
    begins = np.concatenate([ends[:-1] for ends in edges])
    widths = np.concatenate([np.diff(ends) for ends in edges])
    for splits in range(_SPLITS + 1):
        sampled = powers(number, begins, widths)
        samples = Samples(np.append(0.0, np.cumsum(widths)), None)
        np.maximum.at(sizes, number, np.abs(sampled).max(axis=(0, 2)) * periods[number])
        rough = np.max([samples.roughness(power) for power in sampled], axis=0)
        ready = (rough <= _SETTLED * sizes[number]) | (splits == _SPLITS)
        total, lost, *motors = sampled
        driving = sum((samples.positive_integral(power) for power in motors), np.zeros(len(number)))
        parts = samples.integral(total), driving, samples.integral(lost)
        for row, part in zip(works, parts, strict=True):
            row += np.bincount(number[ready], part[ready], count)
        if ready.all():
            break
        begins, widths = begins[~ready], np.repeat(widths[~ready] / _PARTS, _PARTS)
        begins = np.repeat(begins, _PARTS) + widths * np.resize(np.arange(_PARTS), len(widths))
        number = np.repeat(number[~ready], _PARTS)
    return works


def _sampled_powers(
    scene: RigidScene, starts: Any, number: np.ndarray, begins: np.ndarray, widths: np.ndarray
) -> np.ndarray:
    """Computes powers at the Gauss points of n panels of footsteps [W], shape (k, n, 5).

    They are the power of all that drives, what joints lose, and the power of each motor.
    """
    times = begins[:, None] + widths[:, None] * 0.5 * (1.0 + NODES)
    many = rows_of(starts, np.repeat(number, len(NODES)))
    flows = evaluate_along(scene, states_after(scene, many, times.ravel()), powers)
    driven = np.zeros(times.size) if flows.actuation is None else flows.actuation
    return np.reshape([driven, flows.damper, *(flows.motors or ())], (-1, *times.shape))
