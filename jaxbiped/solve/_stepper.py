"""Steppers: what takes an attempted step of a solve by programs, whatever its method."""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import diffrax
from jaxtyping import PyTree

from jaxbiped._types import Numbers, RealScalarLike, Time
from jaxbiped.hybrid._scales import Units


class Tolerance(NamedTuple):
    """The error that a step may have.

    Attributes:
        rtol, atol: relative and absolute, the latter in `units`.
        units: of the state's leaves and of time.
    """

    rtol: Numbers
    atol: Numbers
    units: Units


class Stepped(NamedTuple):
    """An attempted step.

    Attributes:
        end: the state at its end.
        error: estimate of its error, shaped as a state; None from a method that has none.
        dense: coefficients of the states within it.
        probe: a state near its end, whose contacts cost less; None if there is no such state.
    """

    end: PyTree
    error: PyTree | None
    dense: tuple[PyTree, ...]
    probe: PyTree


class Stepper(Protocol):
    """A one-step method that carries nothing from step to step. Hashable."""

    @property
    def switch_weight(self) -> float:
        """Factor of the error estimate of a step that crosses a switch."""

    @property
    def dense_count(self) -> int:
        """Number of coefficients of the states within a step."""

    @property
    def interpolation_cls(self) -> Callable[..., diffrax.AbstractLocalInterpolation]:
        """What makes these states of the times, states and coefficients of a step."""

    def error_order(self, terms: Any) -> RealScalarLike | None:
        """Order of the error estimate."""

    def advance(
        self, terms: Any, t0: Time, t1: Time, y0: PyTree, args: PyTree, tolerance: Tolerance
    ) -> Stepped:
        """One step."""
