"""States of scenes: their types, their checks, the seed's start, and what each coordinate is.

A coordinate whose name is not known has no size, and is refused where errors are measured in sizes.
"""

import functools
from collections.abc import Iterable, Mapping
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_finite, check_type
from jaxbiped._quantity import Quantity
from jaxbiped._types import Scalar, as_float, by_numpy
from jaxbiped.scene._placement import placement
from jaxbiped.scene._scene import AbstractScene, AbstractWalkerScene
from jaxbiped.scene._state_types import CLOCK, STRIKE_LEG, SomeState, State, is_redundant

_OF_CLOCK = (CLOCK, STRIKE_LEG)
Periods: TypeAlias = tuple[float | None, ...]
"""Period of each of some coordinates, None for one that has none; () if none of them has one."""


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


def zero_state(scene: AbstractScene) -> Any:
    """A state of a scene's kind, of zeros."""
    return scene.state_type(*(as_float(0.0) for _ in scene.state_type._fields))


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


@functools.singledispatch
def without_whole_turns(scene: Any, state: PyTree) -> PyTree:
    """The same start with angles between −π and π, or what has a period within it.

    A body that has turned once winds up what acts at joints: where anything does, angles stay.
    """
    structure = scene.mechanism.structure
    if structure.joints:
        return state
    angles = [name for name in state._fields if name in structure.coordinates[2:]]
    return state._replace(**{name: _within_a_turn(getattr(state, name)) for name in angles})


def _within_a_turn(angle: Scalar) -> Scalar:
    known = not isinstance(angle, jax.core.Tracer)
    if known and not np.any(np.abs(np.asarray(angle)) > np.pi):
        return angle
    turn = 2.0 * np.pi
    return by_numpy(lambda numpy, x: x - turn * numpy.round(x / turn), angle)


def check_state(state: PyTree, kind: type = State, name: str = "state") -> PyTree:
    """`state` with every leaf a floating-point array of one shape. Default of the clock: 0.

    Raises:
        ArgumentError: this is not a `kind`, an entry is not finite, or leaves have different
            shapes.
    """
    fields, given = getattr(kind, "_fields", ()), getattr(state, "_fields", ())
    if CLOCK in fields and given == tuple(each for each in fields if each not in _OF_CLOCK):
        zeros = dict.fromkeys(set(fields) & set(_OF_CLOCK), jnp.zeros_like(as_float(state[0])))
        return check_leaves(kind(**state._asdict(), **zeros), name)
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


@functools.singledispatch
def state_for(scene: Any, state: PyTree, name: str = "state") -> PyTree:
    """A checked start of the type that a scene needs. Default of bristles: straight.

    Raises:
        ArgumentError: this is not a state, it has bristles but the scene has none, an entry is not
            finite, or leaves have different shapes.
    """
    kind: Any = scene.state_type
    given = getattr(state, "_fields", ())
    structure = scene.mechanism.structure
    if given and (*given, *structure.bristles, *scene.clock) == kind._fields:
        state = without_whole_turns(scene, check_state(state, type(state), name))
        straight = jnp.zeros_like(state[0])
        return kind(*state, **dict.fromkeys((*structure.bristles, *scene.clock), straight))
    if given == (*kind._fields, *structure.bristles):
        law = type(scene.minimal.friction).__name__
        raise ArgumentError(
            f"{name} has bristles, but friction = {law} has none: give a {kind.__name__}."
        )
    return without_whole_turns(scene, check_state(state, kind, name))


_OF_ROOT = {
    "x": Quantity("along the slope", r"$x_S$", "m"),
    "z": Quantity("above the slope", r"$z_S$", "m"),
    "vx": Quantity("velocity along the slope", r"$\dot x_S$", "m/s"),
    "vz": Quantity("velocity off the slope", r"$\dot z_S$", "m/s"),
}
_HIP = {
    f"hip_{name}": Quantity(f"hip {each.words}", each.symbol, each.unit)
    for name, each in _OF_ROOT.items()
}
_EACH_BODY = {
    "theta": Quantity("angle of", r"\theta", "rad"),
    "omega": Quantity("rate of", r"\omega", "rad/s"),
    "bristle": Quantity("bristles of", "b"),
    "x": Quantity("mass centre along the slope of", "x", "m"),
    "z": Quantity("mass centre above the slope of", "z", "m"),
    "vx": Quantity("velocity along the slope of", r"\dot x", "m/s"),
    "vz": Quantity("velocity off the slope of", r"\dot z", "m/s"),
    "cos_half": Quantity("cosine of half the angle of", "c"),
    "sin_half": Quantity("sine of half the angle of", "s"),
    "cos_rate": Quantity("rate of that cosine of", r"\dot c", "1/s"),
    "sin_rate": Quantity("rate of that sine of", r"\dot s", "1/s"),
}
OF_BODIES = tuple(_EACH_BODY)
"""What names of coordinates of a body begin with."""
STATE_QUANTITIES = (
    _HIP
    | {
        f"{name}_{leg}": Quantity(
            f"{each.words} {'foot' if name == 'bristle' else 'leg'} {leg}",
            f"${each.symbol}_{leg}$",
            each.unit,
        )
        for name, each in _EACH_BODY.items()
        for leg in (1, 2)
    }
    | {CLOCK: Quantity("time since the last strike", r"$t_\mathrm{s}$", "s")}
    | {STRIKE_LEG: Quantity("leg that struck last")}
    | {"mode": Quantity("mode of feet and stops")}
)
"""By the names that the fields of a state of any kind have."""


def state_quantity(name: str) -> Quantity | None:
    """What a coordinate of a mechanism is, by its name; None for one that is not known."""
    if name in STATE_QUANTITIES:
        return STATE_QUANTITIES[name]
    for kind, own in _EACH_BODY.items():
        if name.startswith(f"{kind}_"):
            body = name.removeprefix(f"{kind}_")
            spaced = body.replace("_", r"\ ")
            symbol = rf"${own.symbol}_\mathrm{{{spaced}}}$"
            return Quantity(f"{own.words} {body}", symbol, own.unit)
    root, _, kind = name.rpartition("_")
    known = _OF_ROOT.get(kind)
    return Quantity(f"{root} {known.words}", known.symbol, known.unit) if root and known else None


def coordinate_quantity(kind: Any, name: str) -> Quantity:
    """What a coordinate of a kind of state is: of a unit that the class tells, or by its name."""
    if name in (units := getattr(kind, "own_units", {})):
        return Quantity(name, unit=units[name])
    return state_quantity(name) or Quantity(name)


def unit_of(name: str) -> str:
    """The SI unit of a coordinate of a scene's states."""
    known = state_quantity(name)
    assert known is not None  # a scene makes no other
    return known.unit


def cyclic_names(state: Any) -> tuple[str, ...]:
    """Names of the coordinates of a state, or of a kind of state, that no rate depends on.

    They need not recur in a cycle, only advance: the root point's place along the slope. A
    system's state tells them in `cyclic`.
    """
    kind = state if isinstance(state, type) else type(state)
    if (cyclic := getattr(kind, "cyclic", None)) is not None:
        return tuple(cyclic)
    first, *rest = state._fields
    turns = any(name.startswith("omega_") for name in rest)
    return (first,) if turns and first.endswith("_x") and not is_redundant(state) else ()


def recurring_names(state: Any) -> tuple[str, ...]:
    """Names of the coordinates of a state, or of a kind of state, that recur in a cycle."""
    cyclic = cyclic_names(state)
    return tuple(name for name in state._fields if name not in cyclic)


def recurring_leaves(state: Any) -> list[Any]:
    """The coordinates of a state that recur in a cycle."""
    return [getattr(state, name) for name in recurring_names(state)]


def periods_of(state: Any) -> Mapping[str, float]:
    """Period of each coordinate of a state, or of a kind of state, that turns, by name."""
    kind = state if isinstance(state, type) else type(state)
    return getattr(kind, "periodic", {})


def recurring_periods(state: Any) -> Periods:
    """Periods of the recurring coordinates of a state or of a kind of state; () if none has one."""
    periods = periods_of(state)
    return tuple(periods.get(name) for name in recurring_names(state)) if periods else ()


def turned_difference(difference: Any, period: float | None) -> Any:
    """A difference of a coordinate, modulo its period if it has one: at most half of it."""
    if period is None:
        return difference
    return by_numpy(lambda numpy, x: x - period * numpy.round(x / period), difference)


def state_of_recurring(kind: Any, recurring: Iterable[Any], cyclic: Any = 0.0) -> Any:
    """The state of a kind with these recurring coordinates, and `cyclic` in place of the others."""
    named = dict(zip(recurring_names(kind), recurring, strict=True))
    return kind(**dict.fromkeys(cyclic_names(kind), cyclic), **named)


def dimensions_of(kind: Any) -> dict[str, tuple[float, float]]:
    """Powers of length and time in the unit of each field of a kind of state.

    Args:
        kind: the type, a NamedTuple; one with fields of its own tells their units, by name, in
            `own_units`.

    Raises:
        TypeError: a field that is not known.
    """
    own = {name: Quantity(name, unit=unit) for name, unit in getattr(kind, "own_units", {}).items()}
    found = {}
    for name in kind._fields:
        known = own.get(name) or state_quantity(name)
        if known is None:
            raise TypeError(f"{kind.__name__}.{name} is not known: it must define own_units.")
        found[name] = known.length_and_time
    return found
