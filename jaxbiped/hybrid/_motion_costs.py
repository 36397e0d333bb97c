"""Costs along a cycle: integrals of a rate of the motion, and extremes of a function of it.

They are objectives and requirements like any other: a cost given to `optimise_gait` has its value,
its derivatives and their error bars from a solve of the cycle.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import equinox as eqx

from jaxbiped._checks import ArgumentError, check_finite, check_function, check_type
from jaxbiped._quantity import Quantity
from jaxbiped._types import Scalar
from jaxbiped.dynamics._walker_motion import WalkerMotion

MotionFunction: TypeAlias = Callable[[WalkerMotion], Scalar]
"""A number that a motion has."""


class Integral(eqx.Module):
    """The integral of a rate over a cycle, and terms that heel strikes add, as a measure of a gait.

    Attributes:
        rate: a function of the motion, `rate(motion)`, whose integral over time is taken; see
            `jaxbiped.dynamics.WalkerMotion`. Parameters of the scene count in the derivatives.
        quantity: words, symbol and unit of the integral. The words, with underscores, are its name.
        at_strike: a function of the motion just before a heel strike that is added there; for rigid
            feet alone, for compliant ones press into the ground for a while. None for no such term.
        corners: a function of the motion that returns numbers where the rate is not smooth at a
            change of their signs: steps end there. None where it is smooth.

    Raises:
        ArgumentError: an argument has the wrong type.

    Examples:
        >>> import jaxbiped as jb
        >>> quantity = jb.optimise.Quantity("turning", "$R$", "rad^2/s")
        >>> turned = jb.optimise.Integral(lambda motion: motion.rate("leg_1") ** 2, quantity)
        >>> turned.name
        'turning'
    """

    rate: MotionFunction = eqx.field(static=True)
    quantity: Quantity = eqx.field(static=True)
    at_strike: MotionFunction | None = eqx.field(static=True, default=None)
    corners: Callable[[WalkerMotion], Sequence[Scalar]] | None = eqx.field(
        static=True, default=None
    )

    def __check_init__(self) -> None:
        check_function("rate", self.rate)
        check_type("quantity", self.quantity, Quantity)
        for name in ("at_strike", "corners"):
            if getattr(self, name) is not None:
                check_function(name, getattr(self, name))

    @property
    def name(self) -> str:
        """What it is called where measures are told by name."""
        return name_of(self.quantity)


class Extreme(eqx.Module):
    """The largest or the smallest value of a function of the motion along a cycle, as a measure.

    It is looked for within the cycle and at its ends. Where two places have the same value the
    measure has a corner.

    Attributes:
        value: a function of the motion, `value(motion)`.
        quantity: words, symbol and unit of the extreme. The words, with underscores, are its name.
        smallest: whether it is the smallest value.

    Raises:
        ArgumentError: an argument has the wrong type.
    """

    value: MotionFunction = eqx.field(static=True)
    quantity: Quantity = eqx.field(static=True)
    smallest: bool = eqx.field(static=True, default=False)

    def __check_init__(self) -> None:
        check_function("value", self.value)
        check_type("quantity", self.quantity, Quantity)
        check_type("smallest", self.smallest, bool)

    @property
    def name(self) -> str:
        """What it is called where measures are told by name."""
        return name_of(self.quantity)

    @property
    def sign(self) -> float:
        """1 for the largest value, −1 for the smallest."""
        return -1.0 if self.smallest else 1.0


class Along(NamedTuple):
    """A constraint along the whole cycle: bounds on a function of the motion.

    Attributes:
        value: a function of the motion, `value(motion)`; see `jaxbiped.dynamics.WalkerMotion`.
        low, high: bounds, SI units; None for none.
        name: what it is called in `Optimum.measures`, as "NAME_highest" and "NAME_lowest".
        unit: SI unit of the value.
    """

    value: MotionFunction
    low: float | None = None
    high: float | None = None
    name: str = "path"
    unit: str = ""

    def requirements(self) -> list[tuple[Extreme, tuple[float | None, float | None]]]:
        """The extremes that are bounded, each with its bounds.

        Raises:
            ArgumentError: no bound is given, one is no number, or the low one is above the high.
        """
        check_function("Along.value", self.value)
        bounds = [each for each in (self.low, self.high) if each is not None]
        if not bounds:
            raise ArgumentError(f"Along {self.name!r} has no bound: give low, high or both.")
        for bound in bounds:
            check_finite(f"bound of Along {self.name!r}", bound)
        if bounds != sorted(bounds):
            raise ArgumentError(
                f"Along {self.name!r} asks for at least {self.low:g} and at most {self.high:g}: "
                "these contradict each other."
            )
        sides: list[tuple[Extreme, tuple[float | None, float | None]]] = []
        if self.high is not None:
            highest = Quantity(f"{self.name} highest", unit=self.unit)
            sides.append((Extreme(self.value, highest), (None, float(self.high))))
        if self.low is not None:
            lowest = Quantity(f"{self.name} lowest", unit=self.unit)
            sides.append((Extreme(self.value, lowest, smallest=True), (float(self.low), None)))
        return sides


def name_of(quantity: Quantity) -> str:
    """A quantity's words as a name."""
    return quantity.words.strip().replace(" ", "_").replace("-", "_")


Cost: TypeAlias = Integral | Extreme
"""What a solve of the cycle gives."""
