"""Equivalent states: one motion in the coordinates of other scenes, and in a mirror's names.

In redundant coordinates each body has its own.
"""

import math
from typing import Any, NamedTuple, TypeAlias

import jax.numpy as jnp

from jaxbiped._checks import check_type
from jaxbiped._trigonometry import angle_of_vector, sine_cosine
from jaxbiped._types import Scalar
from jaxbiped.compiler import kept_alone
from jaxbiped.dynamics._footfalls import mean
from jaxbiped.dynamics._joint_loads import motion_of
from jaxbiped.dynamics._stance import angles_and_rates, of_stance, stance_on
from jaxbiped.dynamics._state import OF_BODIES
from jaxbiped.dynamics._tree import Motion, Pose, point_motion, pose_of
from jaxbiped.scene._linkages import loaded_bodies
from jaxbiped.scene._scene import AbstractWalkerScene, RedundantScene, is_rigid
from jaxbiped.scene._state_types import (
    CLOCK,
    STRIKE_LEG,
    MinimalState,
    SomeState,
    is_redundant,
    scalars_named,
    state_type_of,
)
from jaxbiped.scene._structure import Structure

BodiesState: TypeAlias = Any
"""A state with coordinates of each body, as a `RedundantState` or an `EulerState` has them."""
CompliantState: TypeAlias = MinimalState | Any
"""A state of a walker with laws of contact."""


class BodyMotion(NamedTuple):
    """A body as its own coordinates have it.

    Attributes:
        x, z: its mass centre [m]. vx, vz: velocity of that [m/s].
        angle: [rad]. rate: [rad/s].
    """

    x: Scalar
    z: Scalar
    vx: Scalar
    vz: Scalar
    angle: Scalar
    rate: Scalar


def _body_motion(state: BodiesState, body: str) -> BodyMotion:
    """A body, by its name, in a redundant state."""

    def own(name: str) -> Scalar:
        return getattr(state, f"{name}_{body}")

    place = own("x"), own("z"), own("vx"), own("vz")
    if f"theta_{body}" in state._fields:
        return BodyMotion(*place, own("theta"), own("omega"))
    c, s, c_rate, s_rate = (own(name) for name in ("cos_half", "sin_half", "cos_rate", "sin_rate"))
    rate = 2.0 * (c * s_rate - s * c_rate) / (c * c + s * s)
    return BodyMotion(*place, 2.0 * angle_of_vector(s, c), rate)


def motion_in(scene: AbstractWalkerScene, state: CompliantState) -> Motion:
    """Root point, angles and rates of all bodies in a state of either formulation.

    In redundant coordinates the root point is half way between where the bodies on it have it.
    """
    structure = scene.mechanism.structure
    if is_redundant(state):
        poses = poses_of(scene, state)
        told = [poses[j].motion for j in structure.children[-1]]
        each = zip(*((own.x, own.z, own.vx, own.vz) for own in told), strict=True)
        x, z, vx, vz = (mean(values) for values in each)
        return told[0]._replace(x=x, z=z, vx=vx, vz=vz)
    places, rates = (scalars_named(state, n) for n in (structure.coordinates, structure.rates))
    motion = motion_of(scene.mechanism, scene.ground, list(places), list(rates))
    return motion._replace(clock=getattr(state, CLOCK, None))


def poses_of(scene: AbstractWalkerScene, state: CompliantState) -> tuple[Pose, ...]:
    """The pose of the mechanism as each of its bodies has it: in minimal coordinates the same one.

    In redundant coordinates the root point is where each body says it is.
    """
    mechanism = scene.mechanism
    structure = mechanism.structure
    if not is_redundant(state):
        return (pose_of(mechanism, motion_in(scene, state)),) * len(structure.bodies)
    bodies = [_body_motion(state, name) for name in structure.bodies]
    origin = jnp.zeros_like(state[0])
    turned = tuple(each.angle for each in bodies), tuple(each.rate for each in bodies)
    pose = pose_of(mechanism, Motion(origin, origin, origin, origin, *turned))
    found = []
    for j, (own, body) in enumerate(zip(bodies, loaded_bodies(mechanism), strict=True)):
        at = point_motion(structure, pose, j, body.centre)
        root = own.x - at.x, own.z - at.z, own.vx - at.vx, own.vz - at.vz
        found.append(pose._replace(motion=Motion(*root, *turned)))
    return tuple(found)


@kept_alone
def redundant_state(scene: RedundantScene, state: MinimalState) -> BodiesState:
    """The consistent state of a redundant scene that is equivalent to a minimal state.

    Args:
        scene: the redundant scene, which determines how orientations are written.
        state: state of the minimal scene, leaves of any batch shape.

    Returns:
        A state of the scene's kind: for `Walker` a `RedundantState`, or an `EulerState` if the
        scene has Euler parameters.

    Raises:
        ArgumentError: the scene is not redundant, or the state is another walker's.
    """
    check_type("scene", scene, RedundantScene)
    mechanism = scene.mechanism
    structure, motion = mechanism.structure, motion_in(scene, state)
    pose = pose_of(mechanism, motion)
    fields: dict[str, Scalar] = {}
    for j, body in enumerate(loaded_bodies(mechanism)):
        angle, rate = motion.angles[j], motion.rates[j]
        at, (s, c) = point_motion(structure, pose, j, body.centre), sine_cosine(0.5 * angle)
        own = {"x": at.x, "z": at.z, "vx": at.vx, "vz": at.vz, "theta": angle, "omega": rate}
        own |= {"cos_half": c, "sin_half": s}
        own |= {"cos_rate": -0.5 * rate * s, "sin_rate": 0.5 * rate * c}
        fields |= {f"{name}_{body.name}": value for name, value in own.items()}
    fields |= {name: getattr(state, name) for name in structure.bristles if name in state._fields}
    kind = scene.state_type
    return kind(**{name: fields[name] for name in kind._fields})


def minimal_state(scene: AbstractWalkerScene, state: CompliantState) -> MinimalState:
    """The minimal state that is equivalent to a redundant state.

    The root point is midway between its positions on the bodies that hang on it. A minimal state is
    returned as it is.

    Args:
        scene: the redundant scene, which determines how orientations are written.
        state: redundant or minimal, leaves of any common shape, SI units.

    Returns:
        A state of the minimal scene's kind: for `Walker` a `State`, or a `BristleState` if there
        are bristles.
    """
    return _minimal_state(scene, state) if is_redundant(state) else state


@kept_alone
def _minimal_state(scene: AbstractWalkerScene, state: BodiesState) -> MinimalState:
    structure, motion = scene.mechanism.structure, motion_in(scene, state)
    places = motion.x, motion.z, *(motion.angles[j] for j in structure.free)
    rates = motion.vx, motion.vz, *(motion.rates[j] for j in structure.free)
    values = dict(zip((*structure.coordinates, *structure.rates), (*places, *rates), strict=True))
    values |= {name: getattr(state, name) for name in structure.bristles if name in state._fields}
    return state_type_of(tuple(values))(**values)


def exchange_legs(scene: AbstractWalkerScene, state: SomeState, times: int = 1) -> SomeState:
    """The same motion with the names of mirror images exchanged, for a state of any kind.

    For a mechanism with a turn, the next foot takes the name of the one before.

    Args:
        scene: a scene whose mechanism has a mirror or a turn; otherwise nothing is exchanged.
        state: leaves of any common shape, SI units.
        times: number of exchanges; −1 undoes an exchange.

    Returns:
        A state of the same kind.
    """
    structure = scene.mechanism.structure
    if times == 0 or len(structure.namings) == 1:
        return state
    names: dict[str, str] = {}
    for name, k in zip(structure.bristles, structure.feet_renamed(times), strict=True):
        names[structure.bristles[k]] = name
    if structure.turn is not None:
        values = _turned(structure, state, times)
    else:
        values, bodies = state._asdict(), structure.bodies
        for name, twin in zip(bodies, structure.body_twins or (), strict=True):
            names |= {f"{kind}_{name}": f"{kind}_{bodies[twin]}" for kind in OF_BODIES}
        if structure.fixed and structure.coordinates[0] in values:
            # The image of a free body's angle may be one that a coupling fixes.
            rigid = is_rigid(scene)
            stands = structure.stance_leg
            rolls = stance_on(scene, state, stands).pose.motion if rigid else None
            motion = motion_in(scene, state) if rolls is None else rolls
            for name, angle, rate in zip(bodies, motion.angles, motion.rates, strict=True):
                values |= {f"theta_{name}": angle, f"omega_{name}": rate}
    if STRIKE_LEG in values:
        values = values | {STRIKE_LEG: _strike_leg_renamed(structure, values[STRIKE_LEG], times)}
    return state._replace(**{name: values[names.get(name, name)] for name in state._fields})


def strike_leg_of(structure: Structure, leg: int) -> float:
    """The scalar of states that tells that a leg struck last."""
    return float((leg - structure.stance_leg) % len(structure.legs))


def _strike_leg_renamed(structure: Structure, value: Scalar, times: int) -> Scalar:
    renamed, image = structure.feet_renamed(times), value
    for leg, feet in enumerate(structure.feet_of_leg):
        now = strike_leg_of(structure, structure.leg_of_foot[renamed[feet[0]]])
        struck = jnp.abs(value - strike_leg_of(structure, leg)) < 0.5
        image = jnp.where(struck, now, image)
    return image


def _turned(structure: Structure, state: SomeState, times: int) -> dict[str, Any]:
    """The leaves of a state, a body turned so many times."""
    assert structure.turn is not None
    values, turn = state._asdict(), structure.turn
    name, angle = structure.bodies[turn.body], times * 2.0 * math.pi / turn.order
    if f"theta_{name}" in values:
        values[f"theta_{name}"] = values[f"theta_{name}"] + angle
        return values
    c, s = math.cos(0.5 * angle), math.sin(0.5 * angle)
    for kind in ("half", "rate"):  # Euler parameters
        first, second = f"cos_{kind}_{name}", f"sin_{kind}_{name}"
        own = values[first], values[second]
        values |= {first: c * own[0] - s * own[1], second: s * own[0] + c * own[1]}
    return values


@kept_alone
def whole_state(scene: AbstractWalkerScene, state: Any) -> Any:
    """The same motion in the compliant walker's coordinates, with the stance foot just touching.

    Args:
        scene: the walker, of any kind.
        state: state of a rigid walker, leaves of any common shape, SI units.

    Returns:
        A state of the compliant walker (a `State` for `Walker`), leaves shaped as the state's.
    """
    z, vx, vz = of_stance(scene, state, lambda stance: stance.root[1:4])
    structure = scene.mechanism.structure
    angles, rates = angles_and_rates(structure, state)
    kind = state_type_of((*structure.coordinates, *structure.rates))
    return kind(state[0], z, *angles, vx, vz, *rates)


def rigid_state(state: Any) -> Any:
    """The part of a compliant walker's state that a rigid walker's state has.

    Args:
        state: state in which the second of each mirrored pair stands, leaves of any common shape,
            SI units.

    Returns:
        Place of the root point, angles and rates, leaves shaped as the state's.
    """
    place, *names = state._fields
    kept = [place, *(name for name in names if name.startswith(("theta_", "omega_")))]
    return state_type_of(kept)(*(getattr(state, name) for name in kept))
