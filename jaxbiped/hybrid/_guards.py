"""Guards: surfaces in state space at which something happens to a motion, as a state sees them.

No step may straddle a switch: derivatives taken through it would be wrong. A gap closes where two
parts begin to press on each other; no step may miss that it does.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxbiped._checks import ArgumentError, check_choice, check_function, check_positive
from jaxbiped._types import Scalar


class Switch(NamedTuple):
    """A surface in state space across which the vector field is not smooth.

    Attributes:
        value: a function of the state that is zero on the surface, positive on one side.
        live: whether the field jumps at the surface near this state (boolean): friction has no
            corner under a foot without load.
        force_jumps: whether the field itself jumps, and not only its Jacobian. Static.
        corner: whether a force acts on both sides and only its slope jumps, as at the peak of
            friction: touching the surface changes no derivative. Static.
        resets: whether the state itself jumps, and only when the value falls through zero. Static.
        first_only: whether only first derivatives of motions across the surface are computed,
            because the force jumps there or is infinitely steep; second derivatives are finite
            differences. Static, like all fields marked so: known before anything runs.
        rises: whether a motion may begin below a surface that resets it and first rise through it,
            as a runner lifts off lower than it touches down. Else what begins there rests on the
            surface, as a knee on its stop, and only rounding has it below. Static.
    """

    value: Scalar
    live: Scalar | bool
    force_jumps: bool = False
    corner: bool = False
    resets: bool = False
    first_only: bool = False
    rises: bool = False


class Gap(NamedTuple):
    """A gap between two parts that press on each other where it is closed.

    Attributes:
        penetration: positive where it is closed [m, at a stop rad].
        penetration_rate: its rate [m/s, rad/s].
        admitted: whether they may touch; None for "always", False for "never", as of a `Foot`.
        size: what a penetration is measured in: the walker's height [m], at a stop 1 rad.
    """

    penetration: Scalar
    penetration_rate: Scalar
    admitted: Scalar | bool | None
    size: Scalar | float


@dataclasses.dataclass(frozen=True)
class Guard:
    """A surface in state space at which something happens to a hybrid system.

    What happens where a motion crosses it: the state is `reset`, the motion `ends`, or nothing but
    that the vector field jumps there, or only its slope does (`corner`). No step straddles it. A
    reset must leave the state off the surface, moving away from it, or the guard not armed; where
    it does not, the motion ends as "chatters".

    Attributes:
        name: names it, as a section (`At`) and, if it ends the motion, as an outcome.
        surface: `surface(state)`, a scalar whose zero is the surface.
        direction: -1 if it counts where the value falls through zero, 1 where it rises, 0 both
            ways (for a guard without a reset that does not end the motion).
        armed: `armed(state)`, whether a crossing counts (boolean), asked at the start of the step
            that crosses, so that it should depend on modes; None: always.
        reset: `reset(state)`, the state just behind; None: as it is.
        ends: whether the motion ends there.
        corner: whether only the slope of the field jumps there, not the field.
        scale: size of the surface's values, SI units: rounding is told from it.

    Raises:
        ArgumentError: a name that is no words, another direction, effects that exclude each other.
    """

    name: str
    surface: Callable[[Any], Scalar]
    direction: int = -1
    armed: Callable[[Any], Scalar] | None = None
    reset: Callable[[Any], Any] | None = None
    ends: bool = False
    corner: bool = False
    scale: float = 1.0

    def __post_init__(self) -> None:
        words = isinstance(self.name, str) and self.name.replace("_", "").replace(" ", "").isalnum()
        if not words:
            raise ArgumentError(f"name = {self.name!r} is not allowed: give a word, or several.")
        for field in ("surface", "armed", "reset"):
            if field == "surface" or getattr(self, field) is not None:
                check_function(field, getattr(self, field))
        check_choice("direction", self.direction, (-1, 0, 1))
        check_positive("scale", self.scale)
        effects = {"reset": self.reset is not None, "ends": self.ends, "corner": self.corner}
        given = [effect for effect, is_given in effects.items() if is_given]
        if len(given) > 1:
            raise ArgumentError(f"guard {self.name!r} has {' and '.join(given)}: give one of them.")
        if self.direction == 0 and given and not self.corner:
            raise ArgumentError(
                f"direction = 0 is not allowed for guard {self.name!r} with {given[0]}: give -1 "
                "or 1."
            )

    def value(self, state: Any) -> Scalar:
        """The surface's value in its scale, which falls through zero at a crossing that counts."""
        return self.surface(state) * ((-1.0 if self.direction > 0 else 1.0) / self.scale)

    def is_armed(self, state: Any) -> Scalar | bool:
        """Whether a crossing near a state counts (boolean)."""
        return True if self.armed is None else jnp.asarray(self.armed(state), dtype=bool)

    def switch(self, state: Any) -> Switch:
        """The guard as a state sees it."""
        resets, jumps = self.reset is not None, not self.corner
        return Switch(
            self.value(state),
            self.is_armed(state),
            force_jumps=jumps,
            corner=self.corner,
            resets=resets,
            first_only=jumps,
            rises=resets,
        )
