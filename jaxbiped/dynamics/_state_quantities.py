"""Quantities of the state's coordinates: what each is, with its symbol and unit, by its name.

A coordinate that is not here has no size, and is refused where errors are measured in sizes.
"""

from collections.abc import Iterable
from typing import Any

from jaxbiped._quantity import Quantity

_HIP = {
    "hip_x": Quantity("hip along the slope", r"$x_S$", "m"),
    "hip_z": Quantity("hip above the slope", r"$z_S$", "m"),
    "hip_vx": Quantity("hip velocity along the slope", r"$\dot x_S$", "m/s"),
    "hip_vz": Quantity("hip velocity off the slope", r"$\dot z_S$", "m/s"),
}
_EACH_LEG = {
    "theta": Quantity("angle of leg", r"\theta", "rad"),
    "omega": Quantity("rate of leg", r"\omega", "rad/s"),
    "bristle": Quantity("bristles of foot", "b"),
    "x": Quantity("mass centre along the slope of leg", "x", "m"),
    "z": Quantity("mass centre above the slope of leg", "z", "m"),
    "vx": Quantity("velocity along the slope of leg", r"\dot x", "m/s"),
    "vz": Quantity("velocity off the slope of leg", r"\dot z", "m/s"),
    "cos_half": Quantity("cosine of half the angle of leg", "c"),
    "sin_half": Quantity("sine of half the angle of leg", "s"),
    "cos_rate": Quantity("rate of that cosine of leg", r"\dot c", "1/s"),
    "sin_rate": Quantity("rate of that sine of leg", r"\dot s", "1/s"),
}
STATE_QUANTITIES = _HIP | {
    f"{name}_{leg}": Quantity(f"{each.words} {leg}", f"${each.symbol}_{leg}$", each.unit)
    for name, each in _EACH_LEG.items()
    for leg in (1, 2)
}
"""By the names that the fields of a state of any kind have."""

CYCLIC = ("hip_x",)
"""Coordinates that no rate depends on: they need not recur, only advance."""


def recurring_names(state: Any) -> tuple[str, ...]:
    """Names of the coordinates of a state, or of a kind of state, that recur in a cycle."""
    return tuple(name for name in state._fields if name not in CYCLIC)


def recurring_leaves(state: Any) -> list[Any]:
    """The coordinates of a state that recur in a cycle."""
    return [getattr(state, name) for name in recurring_names(state)]


def state_of_recurring(kind: Any, recurring: Iterable[Any], cyclic: Any = 0.0) -> Any:
    """The state of a kind with these recurring coordinates, and `cyclic` in place of the others."""
    named = dict(zip(recurring_names(kind), recurring, strict=True))
    return kind(**dict.fromkeys(CYCLIC, cyclic), **named)


def dimensions_of(kind: Any) -> dict[str, tuple[float, float]]:
    """Powers of length and time in the unit of each field of a kind of state.

    Args:
        kind: the type, a NamedTuple; one with fields of its own tells their units, by name, in
            `own_units`.

    Raises:
        TypeError: a field that is not known.
    """
    own = {name: Quantity(name, unit=unit) for name, unit in getattr(kind, "own_units", {}).items()}
    known = STATE_QUANTITIES | own
    for name in kind._fields:
        if name not in known:
            raise TypeError(f"{kind.__name__}.{name} is not known: it must tell its own_units.")
    return {name: known[name].length_and_time for name in kind._fields}
