"""The energy ledger: where gravity's work went."""

from typing import NamedTuple

import numpy as np

from jaxbiped._checks import check_increasing
from jaxbiped.dynamics._energy import energies, powers
from jaxbiped.measure._samples import evaluate_at, sample
from jaxbiped.scene._scene import Scene
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
    interval = np.searchsorted(ends, 0.5 * (flows.edges[1:] + flows.edges[:-1])) - 1
    inside = (interval >= 0) & (interval < len(ends) - 1)

    def between(power: np.ndarray) -> np.ndarray:
        work = flows.integral(power)
        return np.bincount(interval[inside], work[inside], minlength=len(ends) - 1)

    gravity = -np.diff(held.gravitational)
    damper = between(flows.values.indentation) - np.diff(held.elastic)
    friction = between(flows.values.friction)
    stored = np.diff(held.kinetic) + np.diff(held.elastic)
    power = flows.values.actuation
    driven = np.zeros(len(ends) - 1) if power is None else between(power)
    residual = gravity + driven - damper - friction - stored
    return EnergyLedger(gravity, damper, friction, stored, residual, driven)
