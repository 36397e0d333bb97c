"""Costs: of transport, in energy over weight and way; of a scene's vector field, in operations."""

from typing import Any, NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError, check_increasing, check_type
from jaxbiped.compiler import count_operations
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.measure._energy_ledger import ledger_and_motors, rigid_ledger
from jaxbiped.measure._footsteps import heel_strikes, root_place
from jaxbiped.measure._samples import evaluate_at, kept_strikes, places_of_standing
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.simulate._trajectory import Trajectory, check_scene_of


class CostOfTransport(NamedTuple):
    """The mechanical cost of transport of n stretches of a walk; leaves of shape (n,).

    cost = (motor_work + gravity_work)/(weight · distance). For a passive walker it is the sine of
    the slope. On level ground, gravity contributes only if successive steps differ, so its
    contribution vanishes for a periodic gait.

    Attributes:
        cost: [–].
        motor_work: sum of the positive work of each motor [J]; no motor gains energy by braking.
            Springs and dampers do not count as motors.
        gravity_work: work of gravity on the walker, negative uphill [J].
        distance: distance along the slope [m].
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
    passive-dynamic walkers. Their mechanical cost of transport counts only the positive work of the
    actuators, and for passive walkers gravity's work.

    Args:
        scene: the scene that was simulated, compliant or rigid.
        walk: for a compliant walker, a trajectory with every step saved; for a rigid one, a walk
            that saved its heel strikes (`max_arrivals`).
        times: increasing times [s], shape (n + 1,), that bound the stretches. Default: the heel
            strikes, which are always used for a rigid walk.

    Returns:
        The cost of each stretch and its components, with leaves of shape (n,).

    Raises:
        ArgumentError: the walk does not match the scene, the times do not increase or are given for
            a rigid walk, or a rigid walk saved fewer than two heel strikes.
        ValueError: the trajectory has no continuous solution, or is a batch.

    Examples:
        >>> import jaxbiped as jb
        >>> scene = jb.seed_scene(slope=0.02)
        >>> how = dict(footsteps=2, accuracy="draft", engine="lanes")
        >>> walk = jb.simulate(scene, jb.seed_state(), **how)
        >>> jb.measure.cost_of_transport(scene, walk).cost.round(3)
        array([0.02])
    """
    check_type("scene", scene, Scene, RigidScene, RedundantScene)
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
        check_type("walk.state", walk.state, scene.state_type)
        check_scene_of(walk, scene, "walk")
        if times is not None:
            check_increasing("times", times, 2)
        ends = heel_strikes(scene, walk).time_s if times is None else np.asarray(times)
        if len(ends) < 2:
            return CostOfTransport(*[np.zeros(0)] * len(CostOfTransport._fields))
        distance = np.diff(evaluate_at(scene, walk, root_place, ends))
        ledger, motors = ledger_and_motors(scene, walk, ends)
        gravity = ledger.gravity_work
    return CostOfTransport((motors + gravity) / (weight * distance), motors, gravity, distance)


def operation_counts(scene: Scene | RigidScene) -> dict[str, int]:
    """Operations of one evaluation of the scene's vector field, by name, most frequent first.

    These are the operations that the lanes engine computes for each stage of a step: equal
    operations are shared, constants are folded, and operations that depend on the scene alone are
    left out. An elementary function counts as the arithmetic of which it consists.

    Args:
        scene: the walker, compliant or rigid.

    Returns:
        The number of times that each operation occurs, by name.
    """
    field, kind = system_of(scene).vector_field, scene.state_type
    state = kind(*[0.0] * len(kind._fields))
    return count_operations(lambda y, args: field(0.0, y, args), state, scene)
