"""Numbers in options by name, with or without their units: name=value, and ranges of names."""

import re
from collections.abc import Callable, Mapping

from jaxbiped._checks import ArgumentError, check_positive
from jaxbiped._quantity import Quantity, si_number


def named_text(option: str, text: str, example: str = "") -> tuple[str, str]:
    """Name and value of name=value; raises `ArgumentError`."""
    name, given, value = (part.strip() for part in text.partition("="))
    if not name or not given:
        raise ArgumentError(
            f"{option.replace('_', '-')} = {text!r} is not allowed: write name=value{example}."
        )
    return name, value


def numbers_in(
    option: str, name: str, text: str, unit: str | None, mark: str = ",", count: int = 1
) -> list[float]:
    """The numbers of name=text in SI units, `count` of them between marks, 0 for any number.

    A unit that is None is not known yet. Raises `ArgumentError`.
    """
    refused = f"{option} = '{name}={text}' is not allowed"
    try:
        numbers = [si_number(part, unit) for part in text.split(mark)]
    except ValueError as error:
        raise ArgumentError(f"{refused}: {name} must be a number, and {error}.") from None
    if count and len(numbers) != count:
        raise ArgumentError(f"{refused}: write {name}={'low:high' if count == 2 else 'value'}.")
    return numbers


LEG_SCALARS = ("theta_stance", "theta_swing", "omega_stance", "omega_swing")
"""Names of the legs' angles and rates by what the legs do where a cycle begins."""
_UNITS = {"theta_": "rad", "omega_": "rad/s", "_v": "m/s", "_x": "m", "_z": "m"}
"""Units of scalars of a state by a part of their names."""


def unit_of_scalar(name: str) -> str:
    """The unit of a scalar of a state, which its name tells."""
    return next((unit for part, unit in _UNITS.items() if part in name), "")


def units_of(quantities: Mapping[str, Quantity]) -> dict[str, str]:
    """The unit of each quantity, by its name."""
    return {name: quantity.unit for name, quantity in quantities.items()}


def parse_axis(
    text: str, unit: Callable[[str], str | None] = lambda _: None
) -> tuple[str, tuple[float, float, int]]:
    """Name, first, last and count of an axis, from name=first:last:count; `unit` is by name."""
    match = re.fullmatch(r"([\w.-]+)=([^:]+):([^:]+):([^:]+)", text.strip())
    try:
        if match is None:
            raise ValueError
        name = match[1].replace("-", "_")
        first, last = (si_number(match[k], unit(name)) for k in (2, 3))
        count = int(match[4])
    except ArgumentError:
        raise
    except ValueError:
        raise ArgumentError(
            f"axis {text!r} is not allowed: write name=first:last:count, such as "
            "theta_swing=-0.5:0.1:200 or theta_swing=-30deg:5deg:200."
        ) from None
    check_positive(f"count of axis {text!r}", count)
    if not first < last:
        raise ArgumentError(
            f"axis {text!r} is empty: its first value must be finite and less than its last."
        )
    return name, (first, last, count)
