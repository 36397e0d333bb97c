"""Single support of the rigid walker: one foot rolls without slip, the other one swings."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxbiped._types import Scalar, Time, VectorField
from jaxbiped.compiler import kept_alone
from jaxbiped.dynamics._actuation import Carriers, with_driven_joints
from jaxbiped.dynamics._contacts import FootForce, legs_in
from jaxbiped.dynamics._holds import Holds, Row, holds_of
from jaxbiped.dynamics._implicit_field import fold, fold_matrix
from jaxbiped.dynamics._joint_loads import of_all_bodies
from jaxbiped.dynamics._stance import Stance, angles_and_rates, of_stance
from jaxbiped.dynamics._state import field_of
from jaxbiped.dynamics._tree import Loads, rehung
from jaxbiped.dynamics._tree_inertia import inertial_loads
from jaxbiped.linalg._sparse_lu import Entry, factorise
from jaxbiped.scene._ground import gravity_on
from jaxbiped.scene._rigid_feet import rigid_modes
from jaxbiped.scene._scene import RigidScene
from jaxbiped.scene._state_types import state_type_of
from jaxbiped.scene.actuation._abstract_actuator import HipMotion


def rolling_hip_motion(scene: RigidScene, state: Any) -> HipMotion:
    """What actuators at the hip know of the rigid walker: the leg that stands carries it."""
    return of_stance(scene, state, _hip_motion)


def _hip_motion(stance: Stance) -> HipMotion:
    motion = stance.pose.motion
    structure = stance.tree.structure
    first, second = structure.pairs[0]
    one = jnp.ones_like(motion.angles[second])
    carries = second in structure.bodies_of_leg(stance.leg)
    return HipMotion(
        (motion.angles[first], motion.angles[second]),
        (motion.rates[first], motion.rates[second]),
        (None, one) if carries else (one, None),
    )


def with_torques(loads: Loads, scene: RigidScene, stance: Stance) -> Loads:
    """With the torques of joint parts and actuators."""
    mechanism, motion = stance.mechanism, stance.pose.motion
    structure = mechanism.structure

    def carriers() -> Carriers:
        legs = legs_in(mechanism, (rehung(mechanism, stance.pose),) * len(structure.bodies))
        shares: list[Scalar | None] = [None] * len(legs)
        shares[stance.leg] = jnp.ones_like(motion.x)
        return legs, shares

    return with_driven_joints(loads, scene, motion, carriers, lambda: _hip_motion(stance))


class Turning(NamedTuple):
    """Accelerations of a stance, and what holds it.

    Attributes:
        free: of the free bodies' angles [rad/s²].
        unheld: the same where nothing is held, by rows of the tree.
        holds: what may be held; None where nothing may.
        reactions: of what is held [N·m].
    """

    free: list[Scalar]
    unheld: Row
    holds: Holds | None
    reactions: list[Scalar]


def turning_of(scene: RigidScene, stance: Stance) -> Turning:
    """How a stance moves under the loads on it."""
    tree, weights = stance.tree, stance.tree.weights
    # In the frame that falls freely the ground accelerates upwards.
    downhill, weight = gravity_on(scene.ground)
    still: list[Entry] = [-downhill, weight, *[None] * len(tree.bodies)]
    loads = inertial_loads(tree.structure, tree.known, stance.pose, still)
    loads = with_torques(loads, scene, stance)
    factors = factorise(fold_matrix(weights, stance.mass_matrix()))
    unheld: Any = factors.solve(fold(weights, loads.entries()))
    if not stance.may_hold:
        return Turning(tree.free_values(unheld), unheld, None, [])
    holds = holds_of(stance, rigid_modes(stance.mechanism), factors)
    reactions = holds.reactions(unheld, stance.held)
    return Turning(tree.free_values(holds.under(unheld, reactions)), unheld, holds, reactions)


def rolling_rates(scene: RigidScene, state: Any) -> tuple[Scalar, ...]:
    """Angular accelerations at a state [rad/s²], of the bodies that it has; shaped as its leaves.

    Lagrange's equations of the free angles, by elimination from the outermost bodies inwards: the
    mass of a leg that swings may be far below the hip's.
    """
    return tuple(of_stance(scene, state, lambda stance: turning_of(scene, stance).free))


@kept_alone
def rolling(scene: RigidScene, state: Any) -> Any:
    """Accelerations and the ground's reaction at a state; leaves shaped as the state's.

    The reaction follows from the weight and the accelerations of all masses.

    Args:
        scene: the rigid walker.
        state: of the scene's kind, leaves of any common shape, SI units.

    Returns:
        Accelerations `alpha_BODY` [rad/s²] of the bodies in the state, and `force` on the stance
        foot [N], a `FootForce`; a `RollingMotion` for `Walker`.
    """

    def motion(stance: Stance) -> Any:
        found = turning_of(scene, stance).free
        force = ground_force(scene, stance, found)
        return state_type_of((*stance.tree.structure.accelerations[2:], "force"))(*found, force)

    return of_stance(scene, state, motion)


def ground_force(scene: RigidScene, stance: Stance, accelerations: Sequence[Scalar]) -> FootForce:
    """The ground's reaction where the free angles have these accelerations [N]."""
    structure = stance.tree.structure
    turning = of_all_bodies(structure, accelerations, accelerations[0])
    downhill, weight = gravity_on(scene.ground)
    along = jnp.zeros_like(accelerations[0])
    if stance.tree.radius is not None:
        along = -(stance.tree.radius * turning[stance.tree.body])
    moved = [along - downhill, weight, *turning]
    loads: Any = inertial_loads(structure, stance.tree.known, stance.pose, moved)
    return FootForce(normal=-loads.z, tangential=-loads.x)


@kept_alone
def rolling_field(t: Time, state: Any, scene: RigidScene) -> Any:
    """Time derivative of the state, in the form that `diffrax.ODETerm` takes.

    Args:
        t: time [s]; the field does not depend on it.
        state: of the scene's kind, leaves of any common shape, SI units.
        scene: the rigid walker.

    Returns:
        The rates of change [SI units per second], leaves shaped as the state's.
    """
    _, rates = angles_and_rates(scene.mechanism.structure, state)
    modes = [jnp.zeros_like(state[0])] if rigid_modes(scene.mechanism).any else []

    def moves(stance: Stance) -> tuple[Scalar, list[Scalar]]:
        return stance.root.vx, turning_of(scene, stance).free

    vx, turning = of_stance(scene, state, moves)
    return type(state)(vx, *rates, *turning, *modes)


@field_of.register
def _(scene: RigidScene) -> VectorField:
    return rolling_field
