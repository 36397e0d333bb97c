"""Force of the root point's hinge on the first body, in either formulation."""

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped.compiler import kept_alone
from jaxbiped.dynamics._contacts import feet, foot_force
from jaxbiped.dynamics._equivalent_states import poses_of
from jaxbiped.dynamics._joint_loads import of_all_bodies
from jaxbiped.dynamics._minimal_motion import accelerations
from jaxbiped.dynamics._redundant_motion import HipForce, redundant_motion
from jaxbiped.dynamics._tree import point_acceleration, point_motion
from jaxbiped.scene._ground import gravity_on
from jaxbiped.scene._scene import CompliantScene, RedundantScene


@kept_alone
def hip_force(scene: CompliantScene, state: PyTree) -> HipForce:
    """The reaction of the root point's hinge on the first body, in either formulation.

    In minimal coordinates, it does no work and does not occur in the equations. It is the remainder
    of Newton's law for the first body with everything that hangs on it: m (a − g) minus the
    ground's force.

    Args:
        scene: the walker, in minimal or redundant coordinates.
        state: of the scene's kind, leaves of any common shape, SI units.

    Returns:
        The force [N], leaves shaped as the state's.
    """
    if isinstance(scene, RedundantScene):
        return redundant_motion(scene, state).hip_force
    mechanism, pose = scene.mechanism, poses_of(scene, state)[0]
    structure, second = mechanism.structure, accelerations(scene, state)
    turning = of_all_bodies(structure, second[2:], second[0])
    downhill, weight = gravity_on(scene.ground)
    force_x = force_z = jnp.zeros_like(state[0])
    for j, body in enumerate(mechanism.bodies):
        if structure.chains[j][0] == 0:
            centre = point_motion(structure, pose, j, body.centre)
            ax, az = point_acceleration(centre, pose.motion.rates, turning)
            force_x = force_x + body.mass * (ax + second[0] - downhill)
            force_z = force_z + body.mass * (az + second[1] + weight)
    for j, foot in zip(structure.feet, feet(scene, state), strict=True):
        if structure.chains[j][0] == 0:
            reaction = foot_force(scene, foot)
            force_z = force_z - reaction.normal
            if reaction.tangential is not None:
                force_x = force_x - reaction.tangential
    return HipForce(force_x, force_z)
