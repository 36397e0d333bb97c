"""What a driven walk or gait costs, for the commands that print it."""

from typing import TYPE_CHECKING, Any

from jaxbiped._types import JsonObject
from jaxbiped.measure._cost_of_transport import cost_of_transport
from jaxbiped.scene._scene import RigidScene
from jaxbiped.simulate._rigid_walk import rigid_walk
from jaxbiped.simulate._simulate import simulate
from jaxbiped.solve._trajectory import Trajectory

if TYPE_CHECKING:
    from jaxbiped.gait._gait import Gait


def gait_cost(scene: Any, gait: "Gait", footsteps: int) -> JsonObject:
    """Cost of transport over a cycle of a driven gait, ready for JSON; {} for a passive one.

    A cycle that begins between heel strikes is counted from the first of them.
    """
    if scene.actuation is None:
        return {}
    modelled, state = scene.minimal, gait.measures.state
    walk: Trajectory[Any]
    if isinstance(modelled, RigidScene):
        most = footsteps + 1
        walk = rigid_walk(modelled, state, footsteps=most, max_arrivals=most, accuracy="tight")
    else:
        walk = simulate(modelled, state, footsteps=footsteps + 1)
    return walk_cost(modelled, walk)


def walk_cost(scene: Any, walk: Trajectory[Any]) -> JsonObject:
    """Cost of transport over the whole footsteps of a walk, ready for JSON; {} without any."""
    found = cost_of_transport(scene, walk)
    if not len(found.cost):
        return {}
    weight = float(scene.walker.total_mass * scene.ground.g)
    motors, gravity = float(found.motor_work.sum()), float(found.gravity_work.sum())
    return {
        "cost_of_transport": (motors + gravity) / (weight * float(found.distance.sum())),
        "motor_work_J": motors,
    }


def cost_sentence(cost: JsonObject) -> str:
    """The same in words."""
    return (
        f"cost of transport {cost['cost_of_transport']:.5f} over whole footsteps, with "
        f"{cost['motor_work_J']:.4g} J of the motors' positive work"
    )
