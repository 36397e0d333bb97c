"""Costs along a cycle: integrals of a rate of the motion, and extremes of a function of it.

They are objectives and requirements like any other: a cost given to `optimise_gait` has its value,
its derivatives and their error bars from a solve of the cycle.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import (
    ArgumentError,
    check_finite,
    check_function,
    check_type,
    is_number,
)
from jaxbiped._quantity import Quantity
from jaxbiped._types import Scalar
from jaxbiped.caching._known_by_shape import known_by_shape
from jaxbiped.dynamics._walker_motion import WalkerMotion
from jaxbiped.hybrid._guards import Switch
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene._scene import AbstractWalkerScene

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
        at_reset: a function of the motions before and behind a reset, `at_reset(before, after)`,
            that is added at heel strikes of rigid feet and wherever else the state jumps, as where
            a knee comes to its stop. None for no such term.

    Raises:
        ArgumentError: an argument has the wrong type.

    Examples:
        >>> import jaxbiped as jb
        >>> quantity = jb.laws.Quantity("turning", "$R$", "rad^2/s")
        >>> turned = jb.optimise.Integral(lambda motion: motion.rate("leg_1") ** 2, quantity)
        >>> turned.name
        'turning'
    """

    rate: MotionFunction = eqx.field(static=True)
    quantity: Quantity = eqx.field(static=True)
    at_strike: MotionFunction | None = eqx.field(static=True, default=None)
    corners: Callable[[WalkerMotion], Sequence[Scalar | Switch]] | None = eqx.field(
        static=True, default=None
    )
    at_reset: Callable[[WalkerMotion, WalkerMotion], Scalar] | None = eqx.field(
        static=True, default=None
    )

    def __check_init__(self) -> None:
        check_function("rate", self.rate)
        check_type("quantity", self.quantity, Quantity)
        for name in ("at_strike", "corners", "at_reset"):
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


def has_motion_costs(scene: Any) -> bool:
    """Whether costs are functions of a scene's motion, as of a walker's."""
    return isinstance(scene, AbstractWalkerScene)


def check_has_costs(name: str, scene: Any) -> None:
    """Raises `ArgumentError` for a cost of this name of a scene that has none."""
    if not has_motion_costs(scene):
        raise ArgumentError(
            f"{name} is not allowed for a {type(scene).__name__}: costs are functions of a "
            "walker's motion; add a coordinate of its own to the system instead."
        )


def check_cost(cost: Cost, scene: Any) -> None:
    """Raises `ArgumentError` for a cost that the scene cannot have, before anything is compiled."""
    check_has_costs(cost.name, scene)
    if isinstance(cost, Extreme):
        _check_number(f"value of {cost.name}", cost.value, scene, 1)
        return
    if cost.at_strike is not None and not system_of(scene).footsteps_end_on_section:
        raise ArgumentError(
            f"at_strike of {cost.name} is not allowed for compliant feet, which press into the "
            "ground for a while: give a rate."
        )
    _check_number(f"rate of {cost.name}", cost.rate, scene, 1)
    if cost.at_strike is not None:
        _check_number(f"at_strike of {cost.name}", cost.at_strike, scene, 1)
    if cost.at_reset is not None:
        _check_number(f"at_reset of {cost.name}", cost.at_reset, scene, 2)


def _check_number(words: str, function: Callable[..., Any], scene: Any, count: int) -> None:
    """Checks that a function of so many motions returns one number."""
    state = scene.state_type(*[np.zeros(())] * len(scene.state_names))
    leaf = jtu.tree_leaves(state)[0]
    try:
        told = _shape_of(function, scene, state, count)
    except (jax.errors.ConcretizationTypeError, jax.errors.TracerArrayConversionError) as error:
        raise ArgumentError(
            f"{words} takes the motion for plain numbers, which is not allowed: write it with "
            "jax.numpy, and a choice with jax.numpy.where."
        ) from error
    if told != (np.shape(leaf), "f"):
        raise ArgumentError(f"{words} returns {told[0]}, which is not allowed: return one number.")


@known_by_shape
def _shape_of(function: Callable[..., Any], scene: Any, state: Any, count: int) -> Any:
    value = function(*[WalkerMotion(scene, state)] * count)
    if not isinstance(value, jax.Array) and not is_number(value):
        return repr(value), ""
    value = jnp.asarray(value)
    return jnp.shape(value), "f" if jnp.issubdtype(value.dtype, jnp.floating) else "other"
