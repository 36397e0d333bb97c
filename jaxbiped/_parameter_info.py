"""What is known of a parameter: words, symbol, unit, and the range in which it is allowed."""

from typing import NamedTuple

from jaxbiped._checks import (
    check_at_least,
    check_below,
    check_finite,
    check_not_negative,
    check_positive,
)
from jaxbiped._quantity import Quantity


class ParameterInfo(NamedTuple):
    """What the field of a parameter carries.

    Attributes:
        quantity: words, symbol and unit.
        positive: whether it must be above 0.
        minimum: the smallest value allowed, None for none.
        size_below: what its absolute value must be below, None for any.
    """

    quantity: Quantity
    positive: bool
    minimum: float | None
    size_below: float | None

    def check(self, name: str, value: object) -> None:
        """Raises `ArgumentError` unless every entry is a finite number that is allowed."""
        unit = self.quantity.unit
        if self.size_below is not None:
            check_below(name, value, self.size_below, "radians" if unit == "rad" else unit)
        elif self.positive:
            check_positive(name, value, unit)
        elif self.minimum is None:
            check_finite(name, value)
        elif self.minimum == 0.0:
            check_not_negative(name, value, unit)
        else:
            check_at_least(name, value, f"{self.minimum:g}", self.minimum)
