"""Footsteps: what a walk is counted and measured in."""

from typing import NamedTuple

import jax
import numpy as np

from jaxbiped.dynamics._contacts import Contacts, Feet, contacts, landings, touches
from jaxbiped.measure._energy_ledger import energy_ledger
from jaxbiped.measure._samples import Samples, at_steps, evaluate_at, moments_of_change, sample
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._scene_key import check_scene_of
from jaxbiped.solve._trajectory import Trajectory


class HeelStrikes(NamedTuple):
    """Heel strikes of a walk; leaves of shape (n,).

    Attributes:
        time_s: when the foot comes to touch [s].
        foot: which one does, 1 or 2.
    """

    time_s: np.ndarray
    foot: np.ndarray


class Footsteps(NamedTuple):
    """Footsteps of a walk, each from one heel strike to the next; leaves of shape (n,).

    Attributes:
        time_s: time of the heel strike that completes the step [s].
        period_s: time since the heel strike before [s].
        length_m: distance between the places where the two feet struck, along the slope [m].
        speed_m_s: length over period [m/s].
        peak_normal_N: largest normal force on a foot [N].
        max_penetration_m: largest penetration of a foot that touches [m].
        double_support_s: time from the first strike until a foot carries nothing again [s].
        cost_of_transport: energy lost over weight times length [–].
        energy_residual_J: what the step's energy ledger leaves open [J].
    """

    time_s: np.ndarray
    period_s: np.ndarray
    length_m: np.ndarray
    speed_m_s: np.ndarray
    peak_normal_N: np.ndarray  # noqa: N815 (newton)
    max_penetration_m: np.ndarray
    double_support_s: np.ndarray
    cost_of_transport: np.ndarray
    energy_residual_J: np.ndarray  # noqa: N815 (joule)


def heel_strikes(scene: Scene, trajectory: Trajectory) -> HeelStrikes:
    """Heel strikes: the foot ahead comes to touch, the other one having struck before.

    Args:
        scene: what was simulated.
        trajectory: the motion, saved step by step.

    Returns:
        Time [s] and foot of all n heel strikes, leaves of shape (n,).

    Raises:
        ValueError: a trajectory without its continuous solution, or a batch of them.
    """
    check_scene_of(trajectory, scene)
    trajectory.require_dense()
    both = at_steps(scene, trajectory, contacts).feet
    before, after = (_part(both, part) for part in (slice(-1), slice(1, None)))
    lands = np.stack(landings(before, after))
    # By NumPy: JAX would compile a program for this one number.
    touch_1, touch_2 = (bool(touches(foot)) for foot in _part(both, 0))
    last = int(touch_1 and not touch_2) + 2 * int(touch_2 and not touch_1)
    found: list[tuple[int, int]] = []
    for k in np.flatnonzero(lands.any(axis=0)):
        for leg in (1, 2):
            if lands[leg - 1, k] and leg != last:
                found.append((int(k), leg))
                last = leg
    steps = np.array([k for k, _ in found], dtype=int)
    foot = np.array([leg for _, leg in found], dtype=int)

    def strikes(now: Contacts) -> np.ndarray:
        first, second = now.touching
        return np.where(foot[:, None] == 1, first, second)

    t = np.asarray(trajectory.t)
    time = moments_of_change(scene, trajectory, contacts, strikes, t[steps], t[steps + 1])
    return HeelStrikes(time, foot)


def footsteps(scene: Scene, trajectory: Trajectory) -> Footsteps:
    """Every footstep that a trajectory completes; none gives leaves of shape (0,).

    Args:
        scene: what was simulated.
        trajectory: the motion, saved step by step.

    Returns:
        The measures of all n footsteps (SI units, named in the fields), leaves of shape (n,).

    Raises:
        ValueError: a trajectory without its continuous solution, or a batch of them.

    Examples:
        >>> import jaxbiped as jb
        >>> scene = jb.seed_scene()
        >>> how = dict(footsteps=2, accuracy="draft", engine="lanes")
        >>> walk = jb.simulate(scene, jb.seed_state(), **how)
        >>> jb.footsteps(scene, walk).length_m.round(3)
        array([0.18])
    """
    strikes = heel_strikes(scene, trajectory)
    count = max(len(strikes.time_s) - 1, 0)
    if count == 0:
        return Footsteps(*[np.zeros(0)] * len(Footsteps._fields))
    time, foot = strikes
    both = evaluate_at(scene, trajectory, contacts, time).feet
    place = np.where(foot == 1, both.foot_1.x, both.foot_2.x)
    period, length = np.diff(time), np.diff(place)
    loads = sample(scene, trajectory, contacts, time)
    ledger = energy_ledger(scene, trajectory, time)
    own = jax.tree_util.tree_map(np.asarray, (scene.walker, scene.ground))
    weight = float(own[0].total_mass * own[1].g)
    return Footsteps(
        time_s=time[1:],
        period_s=period,
        length_m=length,
        speed_m_s=length / period,
        peak_normal_N=_largest(_normal(loads.values), loads, time),
        max_penetration_m=_largest(_depth(loads.values), loads, time),
        double_support_s=_double_support(scene, trajectory, time, loads),
        cost_of_transport=(ledger.damper_loss + ledger.friction_loss) / (weight * length),
        energy_residual_J=ledger.residual,
    )


def _part(both: Feet, part: slice | int) -> Feet:
    return jax.tree_util.tree_map(lambda leaf: leaf[part], both)


def _normal(now: Contacts) -> np.ndarray:
    """The larger normal force [N]."""
    return np.maximum(now.forces.foot_1.normal, now.forces.foot_2.normal)


def _depth(now: Contacts) -> np.ndarray:
    """The larger penetration of a foot that touches [m]."""
    depths = (
        np.where(touching, foot.penetration, 0.0)
        for touching, foot in zip(now.touching, now.feet, strict=True)
    )
    return np.maximum(*depths)


def _largest(values: np.ndarray, loads: Samples, time: np.ndarray) -> np.ndarray:
    """The largest value in each footstep."""
    largest = np.zeros(len(time) - 1)
    step, inside = loads.stretches(time)
    np.maximum.at(largest, step[inside], values[inside].max(axis=1))
    return largest


def _double_support(
    scene: Scene, trajectory: Trajectory, time: np.ndarray, loads: Samples
) -> np.ndarray:
    """Time from each heel strike but the last until a foot carries nothing again [s]."""
    durations, edges = np.zeros(len(time) - 1), loads.edges
    carried = loads.values.both_carry.all(axis=1)
    spans = []
    for k, start in enumerate(time[:-1]):
        first = int(np.searchsorted(edges, start))
        ends = np.flatnonzero(~carried[first:])
        if ends.size and ends[0] > 0:
            spans.append((k, edges[first + ends[0] - 1], edges[first + ends[0] + 1]))
    if spans:
        which, left, right = (np.array(column) for column in zip(*spans, strict=True))
        released = moments_of_change(
            scene, trajectory, contacts, lambda now: now.both_carry, left, right
        )
        durations[which] = released - time[which]
    return durations
