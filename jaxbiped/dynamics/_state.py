"""States of the walker in minimal coordinates: compliant, with bristles, rigid; the seed's start.

A formulation registers its kind of scene here, by `state_type` and `field_of`.
"""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_finite, check_type
from jaxbiped._types import Scalar, VectorField, as_float, by_numpy
from jaxbiped.compiler import kept_alone
from jaxbiped.dynamics._stance import angles_and_rates, of_stance
from jaxbiped.scene._abstract_scene import AbstractWalkerScene
from jaxbiped.scene._placement import placement
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene._state_types import SomeState, State, state_type_of


@functools.singledispatch
def state_type(scene: object) -> type[PyTree]:
    """The type of a scene's states, a NamedTuple of scalar leaves."""
    raise TypeError(f"{type(scene).__name__} has no formulation.")


@functools.singledispatch
def field_of(scene: object) -> VectorField:
    """A scene's vector field f(t, state, scene), in the form that `diffrax.ODETerm` takes."""
    raise TypeError(f"{type(scene).__name__} has no formulation.")


def seed_state() -> State:
    """The seed paper's start (section 2.3) on a slope of 0.02 rad, with its misprints corrected.

    Leg 2 stands; leg 1 swings and is momentarily almost at rest. The paper prints the legs'
    velocities with the labels swapped and one sign flipped. With this corrected, both legs give the
    same hip velocity to 1e-5 m/s.

    Returns:
        The state, with scalar leaves of 64 bits.
    """
    return State(
        hip_x=as_float(0.0),
        hip_z=as_float(0.395),
        theta_1=as_float(-0.2479),
        theta_2=as_float(0.1655),
        hip_vx=as_float(0.49797),
        hip_vz=as_float(0.05853),
        omega_1=as_float(-0.0052),
        omega_2=as_float(-1.2565),
    )


def standing_height(
    scene: AbstractWalkerScene, stance_angle: Scalar, penetration: Scalar | float = 0.0
) -> Scalar:
    """Height of the root point over a leg that stands on its lowest foot.

    Args:
        scene: the walker on its ground.
        stance_angle: angle of all bodies of that leg from the slope's normal [rad].
        penetration: depth of the foot in the ground [m].

    Returns:
        The root point's height above the slope [m], of the broadcast shape.
    """
    structure = scene.mechanism.structure
    leg = structure.stance_leg
    turned = {
        f"theta_{structure.bodies[j]}": stance_angle
        for j in structure.free
        if j in structure.bodies_of_leg(leg)
    }
    placed = placement(scene.mechanism, scene.ground.slope, turned, structure.legs[leg])
    return placed[f"{structure.root}_z"] - penetration


def without_whole_turns(scene: AbstractWalkerScene, state: SomeState) -> SomeState:
    """The same start with angles between −π and π.

    A body that has turned once winds up what acts at joints: where anything does, angles stay.
    """
    structure = scene.mechanism.structure
    if structure.joints:
        return state
    angles = [name for name in state._fields if name in structure.coordinates[2:]]
    turned: SomeState = state._replace(
        **{name: _within_a_turn(getattr(state, name)) for name in angles}
    )
    return turned


def _within_a_turn(angle: Scalar) -> Scalar:
    known = not isinstance(angle, jax.core.Tracer)
    if known and not np.any(np.abs(np.asarray(angle)) > np.pi):
        return angle
    turn = 2.0 * np.pi
    wrapped: Scalar = by_numpy(lambda numpy, x: x - turn * numpy.round(x / turn), angle)
    return wrapped


def check_state(state: PyTree, kind: type = State, name: str = "state") -> PyTree:
    """`state` with every leaf a floating-point array of one shape.

    Raises:
        ArgumentError: this is not a `kind`, an entry is not finite, or leaves have different
            shapes.
    """
    fields, given = getattr(kind, "_fields", ()), getattr(state, "_fields", ())
    if given and not isinstance(state, kind) and kind.__qualname__ != kind.__name__:
        raise ArgumentError(
            f"{name} has the scalars {', '.join(given)}, which is not allowed: those of this scene "
            f"are {', '.join(fields)}."
        )
    check_type(name, state, kind)
    return check_leaves(state, name)


def check_leaves(state: SomeState, name: str) -> SomeState:
    """`state` with every leaf a floating-point array of one shape.

    Leaves that are None in a kind of state stay None.

    Raises:
        ArgumentError: an entry is not finite, or leaves have different shapes.
    """
    left_out = [name for name, default in state._field_defaults.items() if default is None]
    given = {
        field: value
        for field, value in state._asdict().items()
        if value is not None or field not in left_out
    }
    traced = [field for field, value in given.items() if isinstance(value, jax.core.Tracer)]
    for field, value in given.items():
        if field not in traced:
            check_finite(f"{name}.{field}", value)
    leaves = {field: as_float(value) for field, value in given.items()}
    shapes = {leaf.shape for leaf in leaves.values()}
    if len(shapes) > 1:
        raise ArgumentError(
            f"{name} has leaves of shapes {sorted(shapes)}: all of them must have the same shape."
        )
    if traced:  # together, for each operation on what is traced takes long
        check_finite(name, sum(leaves[field] for field in traced))
    return state._replace(**leaves)


@state_type.register
def _(scene: Scene) -> type[Any]:
    return state_type_of(scene.state_names)


def state_for(scene: AbstractWalkerScene, state: PyTree, name: str = "state") -> PyTree:
    """A checked start of the type that a scene needs. Default of bristles: straight.

    Raises:
        ArgumentError: this is not a state, it has bristles but the scene has none, an entry is not
            finite, or leaves have different shapes.
    """
    kind: Any = state_type(scene)
    given = getattr(state, "_fields", ())
    structure = scene.mechanism.structure
    if given and (*given, *structure.bristles) == kind._fields:
        state = without_whole_turns(scene, check_state(state, type(state), name))
        straight = jnp.zeros_like(state[0])
        return kind(*state, **dict.fromkeys(structure.bristles, straight))
    if given == (*kind._fields, *structure.bristles):
        law = type(scene.minimal.friction).__name__
        raise ArgumentError(
            f"{name} has bristles, but friction = {law} has none: give a {kind.__name__}."
        )
    return without_whole_turns(scene, check_state(state, kind, name))


@state_type.register
def _(scene: RigidScene) -> type[Any]:
    return state_type_of(scene.state_names)


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
