"""Push-off of the rigid walker: an impulse along the standing leg just before the impact."""

from typing import Any

import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.compiler import kept_alone
from jaxbiped.dynamics._actuation import actuators_of
from jaxbiped.dynamics._joint_loads import with_constraint_torques
from jaxbiped.dynamics._plastic_impact import Impulse
from jaxbiped.dynamics._stance import Stance, of_stance
from jaxbiped.dynamics._tree import Loads, rehung
from jaxbiped.dynamics._tree_inertia import composites, eliminate
from jaxbiped.scene._scene import RigidScene
from jaxbiped.scene.actuation._actuators import PushOff


def push_off_impulse(scene: RigidScene, stance: Stance) -> Impulse | None:
    """The impulse just before the impact; None where the scene has no push-off.

    From the standing foot to the root point: along a leg of one body, which it does not turn.
    """
    parts = actuators_of(scene, PushOff)
    if not parts:
        return None
    size = parts[0].impulse
    for part in parts[1:]:
        size = size + part.impulse
    root, foot = stance.root, stance.pose.motion
    x, z = root.x - foot.x, root.z - foot.z
    size = size / jnp.sqrt(x * x + z * z)
    return Impulse(size * x, size * z)


@kept_alone
def push_off_work(scene: RigidScene, state: Any) -> Scalar:
    """Work of the push-off at a state just before the impact [J]; zero without one.

    It is the impulse times the mean of the root point's velocities along it before and after. In
    between, neither foot is held and the walker is free.

    Args:
        scene: the rigid walker.
        state: of the scene's kind, leaves of any common shape, SI units.

    Returns:
        The work [J], shaped as the state's leaves.
    """
    return of_stance(scene, state, lambda stance: _push_off_work(scene, stance))


def _push_off_work(scene: RigidScene, stance: Stance) -> Scalar:
    impulse = push_off_impulse(scene, stance)
    if impulse is None:
        return jnp.zeros_like(stance.pose.motion.x)
    mechanism, before = stance.mechanism, stance.root
    structure, known = mechanism.structure, composites(mechanism)
    factors = eliminate(structure, known, rehung(mechanism, stance.pose))
    loads = Loads.none(structure)._replace(x=impulse.x, z=impulse.z)
    gain_x, gain_z, *_ = with_constraint_torques(structure, mechanism.joints, factors, loads)
    work: Scalar = impulse.x * (before.vx + 0.5 * gain_x)
    return work + impulse.z * (before.vz + 0.5 * gain_z)
