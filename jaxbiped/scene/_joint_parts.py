"""What acts at the joints of a mechanism: springs, stops, latches, couplings and motors."""

import dataclasses
import inspect
import math
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, TypeAlias

import equinox as eqx
import jax.tree_util as jtu

from jaxbiped._checks import ArgumentError, check_choice, check_type, holds_somewhere, is_number
from jaxbiped._parameter_declaration import AbstractPart, parameter
from jaxbiped._types import Parameter
from jaxbiped.scene._bodies import check_name
from jaxbiped.scene.laws._abstract_laws import AbstractNormalLaw

Weights: TypeAlias = tuple[tuple[str, float], ...]
"""Weights of bodies' absolute angles, in the order written."""
Angle: TypeAlias = Any
"""A body's name or `Weights`, which users write as a mapping."""

HOLDS = ("while pressed", "until heel strike", "through heel strike")
SIDES = ("role", "side")


def angle_of(angle: Any) -> Any:
    """A joint's angle as it is kept: a body's name, or weights of absolute angles as pairs."""
    if isinstance(angle, Mapping):
        return tuple((name, _weight(name, weight)) for name, weight in angle.items())
    return angle


def _weight(name: object, weight: object) -> float:
    try:
        if not is_number(weight) or isinstance(weight, list | tuple):
            raise TypeError
        found = float(weight)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        found = math.nan
    if not math.isfinite(found):
        raise ArgumentError(f"the weight of {name!r} in angle = {weight!r} is not a finite number.")
    return found


class AbstractJointPart(AbstractPart):
    """A force or a constraint on an angle of a mechanism.

    The angle φ is a body's name, for its angle from the body that it hangs on (from the slope's
    normal where it hangs on the root point), or weights of absolute angles by name, which may name
    "normal" (angle 0) and "vertical" (angle of the slope) too. A torque τ acts on each body with
    its weight, so the weights must sum to 0: what one side gains the other takes.

    Attributes:
        kind: what parameters of such a part are called after. A property of the class.
        angle: see above.
        name: takes the place of the kind in names of parameters; needed for two of a kind.
    """

    kind: ClassVar[str]
    angle: Angle = eqx.field(static=True, converter=angle_of)
    name: eqx.AbstractVar[str | None]

    def __check_init__(self) -> None:
        if self.name is not None:
            check_name("name", self.name)
        check_angle(self.angle)


def check_angle(angle: object) -> None:
    """Raises `ArgumentError` unless an angle is a name, or weights that sum to 0."""
    if isinstance(angle, str):
        return
    pairs = isinstance(angle, tuple) and all(isinstance(each, tuple) for each in angle)
    if not isinstance(angle, tuple) or not pairs or not angle:
        raise ArgumentError(
            f"angle = {angle!r} is not allowed: give a body's name, or weights of absolute angles "
            "by name."
        )
    for name, weight in angle:
        if weight == 0.0:
            raise ArgumentError(
                f"angle has the weight 0 for {name!r}, which is not allowed: leave the name out."
            )
    total = sum(weight for _, weight in angle)
    if abs(total) > 1e-12 * max(abs(weight) for _, weight in angle):
        raise ArgumentError(
            f"angle = {dict(angle)} is not allowed, because its weights sum to {total:g}: a torque "
            'from nowhere; name its other side, or "normal" or "vertical".'
        )


class Spring(AbstractJointPart):
    """A spring, a damper or both: τ = −k (φ − rest) − b φ̇.

    Attributes:
        angle: see `AbstractJointPart`.
        stiffness: k [N·m/rad]; None for a damper without a spring.
        damping: b [N·m·s/rad]; None for none.
        rest: angle at which the spring exerts no torque [rad]; None for 0.
        name: see `AbstractJointPart`.

    Raises:
        ArgumentError: neither stiffness nor damping is given, one of them is below 0, or a rest
            angle is given without stiffness.
    """

    kind: ClassVar[str] = "spring"
    _: dataclasses.KW_ONLY
    stiffness: Parameter | None = parameter(
        "joint stiffness", "$k$", "N m/rad", minimum=0.0, default=None
    )
    damping: Parameter | None = parameter(
        "joint damping", "$b$", "N m s/rad", minimum=0.0, default=None
    )
    rest: Parameter | None = parameter("rest angle", r"$\varphi_0$", "rad", default=None)
    name: str | None = eqx.field(static=True, default=None)

    def __check_init__(self) -> None:
        if self.stiffness is None and self.damping is None:
            raise ArgumentError(
                f"Spring({self.angle!r}) has neither stiffness nor damping: give one of them."
            )
        if self.rest is not None and self.stiffness is None:
            raise ArgumentError(
                f"rest is not allowed for Spring({self.angle!r}), which has no stiffness: it would "
                "have no effect."
            )


class Stop(AbstractJointPart):
    """Limits of an angle: compliant in scenes with laws of contact, plastic on rigid feet.

    Beyond a limit, a law of the normal force pushes back: τ = −law(φ − upper, φ̇) above and
    +law(lower − φ, −φ̇) below. The penetration is an angle [rad] and the force a torque [N·m], so a
    stiffness has the unit N·m/radⁿ.

    Attributes:
        angle: see `AbstractJointPart`.
        upper, lower: the limits [rad]; None for no limit on that side.
        law: law of the torque, for example one of `NORMAL_LAWS`; required in a scene with laws of
            contact.
        holds: how long the stop holds in a scene on rigid feet: "while pressed", until it would
            have to pull; "until heel strike" or "through heel strike", locked once it is hit.
        name: see `AbstractJointPart`.

    Raises:
        ArgumentError: no limit is given, the lower limit is not below the upper one, or the law or
            `holds` is of another kind.
    """

    kind: ClassVar[str] = "stop"
    _: dataclasses.KW_ONLY
    upper: Parameter | None = parameter("upper limit", r"$\varphi_+$", "rad", default=None)
    lower: Parameter | None = parameter("lower limit", r"$\varphi_-$", "rad", default=None)
    law: AbstractNormalLaw | None = None
    holds: str = eqx.field(static=True, default="while pressed")
    name: str | None = eqx.field(static=True, default=None)

    def __check_init__(self) -> None:
        if self.upper is None and self.lower is None:
            raise ArgumentError(f"Stop({self.angle!r}) has no limit: give upper, lower or both.")
        if (
            self.upper is not None
            and self.lower is not None
            and holds_somewhere(self.lower >= self.upper)
        ):
            raise ArgumentError(
                f"lower = {self.lower} is not allowed for Stop({self.angle!r}) with upper = "
                f"{self.upper}: it must be below."
            )
        if self.law is not None:
            check_type("law", self.law, AbstractNormalLaw)
        check_choice("holds", self.holds, HOLDS)


class Latch(AbstractJointPart):
    """A detent that holds an angle until a torque overcomes it, on compliant and on rigid feet.

    τ = −T u exp((1 − u²)/2) − b φ̇ exp(−u²/2) with u = (φ − at)/width. The torque is largest, T, at
    u = ±1. For a mechanical latch that holds a knee until heel strike, use `Stop(..., holds=...)`.

    Attributes:
        angle: see `AbstractJointPart`.
        at: the angle that it holds [rad]; None for 0.
        width: distance from that angle at which the torque is largest [rad].
        torque: T [N·m].
        damping: b, damping near the angle that it holds [N·m·s/rad]; None for none.
        name: see `AbstractJointPart`.

    Raises:
        ArgumentError: the width is not above 0, or a torque or damping is below 0.
    """

    kind: ClassVar[str] = "latch"
    _: dataclasses.KW_ONLY
    width: Parameter = parameter("width of the latch", "$w$", "rad", positive=True)
    torque: Parameter = parameter("torque of the latch", "$T$", "N m", minimum=0.0)
    at: Parameter | None = parameter("latched angle", r"$\varphi_0$", "rad", default=None)
    damping: Parameter | None = parameter(
        "damping of the latch", "$b$", "N m s/rad", minimum=0.0, default=None
    )
    name: str | None = eqx.field(static=True, default=None)


class Coupling(AbstractJointPart):
    """An exact constraint on angles: Σ w θ = rest.

    States do not contain the angle and the rate of the first body that it names, because they
    follow from the others. `Coupling("battery")` welds a body to its parent.

    Attributes:
        angle: see `AbstractJointPart`.
        rest: value of the sum [rad]; None for 0.
        name: see `AbstractJointPart`.
    """

    kind: ClassVar[str] = "coupling"
    _: dataclasses.KW_ONLY
    rest: Parameter | None = parameter("coupled angle", r"$\varphi_0$", "rad", default=None)
    name: str | None = eqx.field(static=True, default=None)


class FunctionLaw(eqx.Module):
    """A motor's law that is a plain function, without parameters.

    Attributes:
        function: of the motion [N·m].
    """

    function: Callable[[Any], Any] = eqx.field(static=True)

    def __call__(self, motion: Any) -> Any:
        """The function's torque [N·m]."""
        return self.function(motion)


def law_of(law: Any) -> Any:
    """A motor's law as it is kept: a pytree, whose leaves are parameters."""
    is_leaf = jtu.all_leaves([law])
    return FunctionLaw(law) if callable(law) and is_leaf else law


def takes_the_motion(law: Any) -> bool:
    """Whether it can be called with one argument, as far as Python can tell."""
    try:
        inspect.signature(law.function if isinstance(law, FunctionLaw) else law).bind(None)
    except TypeError:
        return False
    except ValueError:
        return True  # of some built-in functions there is no signature
    return True


class Motor(AbstractJointPart):
    """A motor, whose torque is a function of the motion alone.

    Attributes:
        angle: see `AbstractJointPart`; the torque turns it forward.
        law: a function of the motion, `law(motion)`, that returns the torque [N·m]: a law of
            `jaxbiped.actuation`, a module of your own whose leaves are parameters, or a plain
            function, which has no parameters.
        by: "role" if the law is written for the second leg of each pair standing; it is mirrored
            while the first one stands. "side" if the law acts on the side that is named.
        share: factor that multiplies the law's torque; None for 1.
        name: see `AbstractJointPart`.

    Raises:
        ArgumentError: the law cannot be called with the motion alone, the share is below 0, or `by`
            is another word.
    """

    kind: ClassVar[str] = "motor"
    law: Callable[[Any], Any] = eqx.field(converter=law_of)
    _: dataclasses.KW_ONLY
    by: str = eqx.field(static=True, default="role")
    share: Parameter | None = parameter("share of the motor's torque", minimum=0.0, default=None)
    name: str | None = eqx.field(static=True, default=None)

    def __check_init__(self) -> None:
        if not takes_the_motion(self.law):
            given = self.law.function if isinstance(self.law, FunctionLaw) else self.law
            raise ArgumentError(
                f"law = {given!r} is not allowed for Motor({self.angle!r}): give a function of "
                "the motion alone."
            )
        check_choice("by", self.by, SIDES)
