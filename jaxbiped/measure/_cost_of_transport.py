"""Mechanical cost of transport: what energy a walker takes over its weight and its way."""

from typing import Any, NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError, check_increasing, check_type
from jaxbiped._types import Scalar
from jaxbiped.dynamics._energy import energies, is_driven, powers
from jaxbiped.dynamics._redundant_state import minimal_state
from jaxbiped.dynamics._state import state_type
from jaxbiped.measure._energy_ledger import rigid_ledger
from jaxbiped.measure._footsteps import heel_strikes
from jaxbiped.measure._samples import evaluate_at, kept_strikes, places_of_standing, sample
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.solve._scene_key import check_scene_of
from jaxbiped.solve._trajectory import Trajectory


class CostOfTransport(NamedTuple):
    """The mechanical cost of transport of n stretches of a walk; leaves of shape (n,).

    cost = (motor_work + gravity_work)/(weight · distance). Of a passive walker it is the slope's
    sine; on level ground gravity's part is that of steps that differ, none for a periodic gait.

    Attributes:
        cost: [–].
        motor_work: what each motor does where its power is positive, added up [J]: none gains
            energy by braking. Springs and dampers are no motors.
        gravity_work: work of gravity on the walker, negative uphill [J].
        distance: along the slope [m].
    """

    cost: np.ndarray
    motor_work: np.ndarray
    gravity_work: np.ndarray
    distance: np.ndarray


def cost_of_transport(
    scene: Scene | RigidScene,
    walk: Trajectory[Any],
    times: np.ndarray | None = None,
) -> CostOfTransport:
    """The mechanical cost of transport of a walk, footstep by footstep.

    Source: Collins, Ruina, Tedrake and Wisse 2005, Efficient bipedal robots based on
    passive-dynamic walkers: the mechanical cost of transport, which counts the positive work of the
    actuators alone; of their passive walkers, gravity's work.

    Args:
        scene: what walked, compliant or rigid.
        walk: of a compliant walker its trajectory, saved step by step; of a rigid one a walk that
            kept its heel strikes, by `max_arrivals`.
        times: between which to count, increasing [s], shape (n + 1,); the heel strikes unless
            given. A rigid walk is counted between its heel strikes.

    Returns:
        The cost of each stretch with what it is made of, leaves of shape (n,).

    Raises:
        ArgumentError: a walk of another kind than the scene, times that do not increase, or with a
            rigid walk, or a rigid walk that kept fewer than two heel strikes.
        ValueError: a trajectory without its continuous solution, or a batch of them.

    Examples:
        >>> import jaxbiped as jb
        >>> scene = jb.seed_scene(slope=0.02)
        >>> how = dict(footsteps=2, accuracy="draft", engine="lanes")
        >>> walk = jb.simulate(scene, jb.seed_state(), **how)
        >>> jb.measure.cost_of_transport(scene, walk).cost.round(3)
        array([0.02])
    """
    weight = float(scene.mechanism.total_mass) * float(scene.ground.g)
    if isinstance(scene, RigidScene):
        if times is not None:
            raise ArgumentError(
                "times is not allowed for a RigidScene: it is counted between heel strikes."
            )
        _, states = kept_strikes(scene, walk)
        distance = np.diff(places_of_standing(scene, states))
        books = rigid_ledger(scene, walk)
        gravity, motors = books.gravity_work, books.motor_work
    else:
        check_type("walk", walk, Trajectory)
        check_type("walk.state", walk.state, state_type(scene))
        check_scene_of(walk, scene, "walk")
        if times is not None:
            check_increasing("times", times, 2)
        ends = heel_strikes(scene, walk).time_s if times is None else np.asarray(times)
        distance, gravity, motors = _compliant(scene, walk, ends)
    return CostOfTransport((motors + gravity) / (weight * distance), motors, gravity, distance)


def _compliant(
    scene: Scene, walk: Trajectory, ends: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance [m], gravity's work and the motors' [J] between times."""
    count = max(len(ends) - 1, 0)
    if count == 0:
        nothing = np.zeros(0)
        return nothing, nothing, nothing
    place = evaluate_at(scene, walk, _root_place, ends)
    gravity = -np.diff(evaluate_at(scene, walk, energies, ends).gravitational)
    driven = np.zeros(count)
    if is_driven(scene):
        flows = sample(scene, walk, powers, ends)
        for power in flows.values.motors:
            driven += flows.totals(flows.positive_integral(power), ends)
    return np.diff(place), gravity, driven


def _root_place(scene: Scene, state: Any) -> Scalar:
    """Place of the root point along the slope [m]."""
    return getattr(minimal_state(scene, state), scene.mechanism.structure.coordinates[0])
