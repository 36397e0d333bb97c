"""Quantities of the state's coordinates: what each is, with its symbol and unit, by its name.

A coordinate that is not here has no size, and is refused where errors are measured in sizes.
"""

from collections.abc import Iterable
from typing import Any

from jaxbiped._quantity import Quantity
from jaxbiped.scene._state_types import is_redundant

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


def unit_of(name: str) -> str:
    """The SI unit of a coordinate of a scene's states."""
    known = state_quantity(name)
    assert known is not None  # a scene makes no other
    return known.unit


def cyclic_names(state: Any) -> tuple[str, ...]:
    """Names of the coordinates of a state, or of a kind of state, that no rate depends on.

    They need not recur in a cycle, only advance: the root point's place along the slope.
    """
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
