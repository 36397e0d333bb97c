"""Motion of a stance: single support, in which one foot rolls without slip, and plastic impacts.

Impacts are of soles that come down and of stops that are hit.
"""

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxbiped._types import Scalar, Time, select
from jaxbiped.compiler import kept_alone
from jaxbiped.dynamics._actuation import Carriers, with_driven_joints
from jaxbiped.dynamics._contacts import FootForce, legs_in
from jaxbiped.dynamics._force_balance import fold, fold_matrix
from jaxbiped.dynamics._holds import Holds, Row, holds_of
from jaxbiped.dynamics._joint_loads import of_all_bodies
from jaxbiped.dynamics._stance import Sole, Stance, angles_and_rates, either, of_stance, sole_of
from jaxbiped.dynamics._tree import Loads, rehung
from jaxbiped.dynamics._tree_inertia import inertial_loads
from jaxbiped.linalg._sparse_lu import Entry, factorise, plus, product
from jaxbiped.scene._ground import gravity_on
from jaxbiped.scene._modes import Modes, rigid_modes
from jaxbiped.scene._scene import RigidScene
from jaxbiped.scene._state_types import CLOCK, check_scalars, state_type_of
from jaxbiped.scene._structure import Indices
from jaxbiped.scene.actuation._actuators import HipMotion


def hip_motion_of(stance: Stance) -> HipMotion:
    """Gives what actuators at the hip know on rigid feet, where the leg that stands carries all."""
    motion = stance.pose.motion
    structure = stance.mechanism.structure
    first, second = structure.pairs[0]
    one = jnp.ones_like(motion.angles[second])
    carries = second in structure.bodies_of_leg(stance.leg)
    hip = HipMotion(
        (motion.angles[first], motion.angles[second]),
        (motion.rates[first], motion.rates[second]),
        (None, one) if carries else (one, None),
    )
    return hip.timed(motion.clock)


def carriers_of(stance: Stance) -> Carriers:
    """Gives the lines of all legs on rigid feet; the leg that stands carries everything."""
    mechanism = stance.mechanism
    bodies = len(mechanism.structure.bodies)
    legs = legs_in(mechanism, (rehung(mechanism, stance.pose),) * bodies)
    shares: list[Scalar | None] = [None] * len(legs)
    shares[stance.leg] = jnp.ones_like(stance.pose.motion.x)
    return legs, shares


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
    carriers, hip = partial(carriers_of, stance), partial(hip_motion_of, stance)
    loads = with_driven_joints(loads, scene, stance.pose.motion, carriers, hip)
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

    Raises:
        ArgumentError: the state is another scene's.
    """
    check_scalars(state, scene.state_names)
    _, rates = angles_and_rates(scene.mechanism.structure, state)
    clock = [jnp.ones_like(state[0])] if CLOCK in state._fields else []
    modes = [jnp.zeros_like(state[0])] if rigid_modes(scene.mechanism).any else []

    def moves(stance: Stance) -> tuple[Scalar, list[Scalar]]:
        return stance.root.vx, turning_of(scene, stance).free

    vx, turning = of_stance(scene, state, moves)
    return type(state)(vx, *rates, *turning, *clock, *modes)


class Impulse(NamedTuple):
    """An impulse on the root point in the slope's frame [N·s], leaves shaped as the state's."""

    x: Scalar
    z: Scalar


class Grip(NamedTuple):
    """Which limits of stops take part in an impact, and which only while they are pressed on."""

    held: Sequence[Scalar]
    loose: Sequence[Scalar | bool]


class Struck(NamedTuple):
    """After a plastic impact.

    Attributes:
        stance: on what stands then.
        impulse: of the ground on it [N·s].
        stands: which of two feet stand; none of a leg that has one.
        held: which limits are held.
    """

    stance: Stance
    impulse: Impulse
    stands: tuple[Scalar, ...]
    held: Sequence[Scalar]


class _Outcome(NamedTuple):
    rates: tuple[Scalar, ...]
    impulse: Impulse
    turning: Scalar
    held: list[Scalar]


def plastic_impact(
    old: Stance,
    feet: Indices,
    stands: tuple[Scalar, ...],
    push_off: Impulse | None,
    modes: Modes,
    grip: Grip,
) -> Struck:
    """Brings the soles of a leg to rest on the ground at once, and what is held to rest.

    Of two feet and of loose limits those stay that are pressed on, while the others leave; of two
    feet at least one.

    Args:
        old: the motion before.
        feet: of the leg that stands afterwards.
        stands: which of two feet come down or stand; none for one foot.
        push_off: an impulse on the root point at once before.
        modes: of the mechanism.
        grip: what is held beside the feet.
    """
    first = sole_of(old.mechanism, feet[0])
    if not stands:
        found = _on(old, first, None, push_off, modes, grip)
        return Struck(old.on(first, found.rates), found.impulse, (), found.held)
    second = sole_of(old.mechanism, feet[1])
    flat = stands[0] & stands[1]
    found = _on(old, either(stands[0], first, second), flat, push_off, modes, grip)
    front = found.turning / (old.point(second).x - old.point(first).x)
    tips = flat & (jnp.minimum(front, found.impulse.z - front) < 0.0)
    no = jnp.zeros_like(flat)
    one, other = (_on(old, sole, no, push_off, modes, grip) for sole in (first, second))
    rises = old.on(first, one.rates).point(second).vz >= 0.0
    # Where neither presses alone the walker would have to fly: what pulls less stays.
    stays = rises & ((one.impulse.z >= 0.0) | (one.impulse.z >= other.impulse.z))
    found = select(tips, select(stays, one, other), found)
    stands = stands[0] & ~(tips & ~stays), stands[1] & ~(tips & stays)
    sole = either(stands[0], first, second)
    return Struck(old.on(sole, found.rates), found.impulse, stands, found.held)


def _on(
    old: Stance,
    sole: Sole,
    flat: Scalar | None,
    push_off: Impulse | None,
    modes: Modes,
    grip: Grip,
) -> _Outcome:
    """Rates of all bodies after it, on a sole of a body that is `flat`, where it has two feet."""
    new, lands, rates = old.on(sole), old.point(sole), old.pose.motion.rates
    tree, rolled = new.tree, new.pose.motion
    structure = tree.structure
    lost_x, lost_z = lands.vx - rolled.vx, lands.vz - rolled.vz
    entries = new.mass_matrix()
    found = product(entries, {0: lost_x, 1: lost_z})
    momenta = [found.get(i) for i in range(2 + len(rates))]
    if push_off is not None:
        kick = Loads.none(structure).with_force(new.root, push_off.x, push_off.z)
        momenta = [plus(*each) for each in zip(momenta, kick.entries(), strict=True)]
    factors = factorise(fold_matrix(tree.weights, entries))
    gained: Any = factors.solve(fold(tree.weights, momenta))
    turning, held = jnp.zeros_like(rates[0]), list(grip.held)
    if new.may_hold:
        holds = holds_of(new, modes, factors)
        start = {row: rates[j] for row, j in zip(tree.rows, structure.free, strict=True)}
        free = {row: rate + gained[row] for row, rate in start.items()}
        always = [] if flat is None else [flat]
        held = holds.pressed(free, [*always, *held], [*([False] * len(always)), *grip.loose])
        reactions = holds.reactions(free, held)
        after = holds.under(free, reactions)
        gained = {row: after[row] - rate for row, rate in start.items()}
        if flat is not None:
            turning = reactions[0]
        held = held[len(always) :]
    moves = tree.free_values(gained)
    gains = of_all_bodies(structure, moves, moves[0])
    after_rates = tuple(rate + gain for rate, gain in zip(rates, gains, strict=True))
    then = old.on(sole, after_rates).pose.motion
    moved = {0: then.vx - lands.vx, 1: -lands.vz}
    given: Any = product(entries, moved | {2 + j: gain for j, gain in enumerate(gains)})
    x, z = given[0], given[1]
    if push_off is not None:
        x, z = x - push_off.x, z - push_off.z
    return _Outcome(after_rates, Impulse(x, z), turning, held)
