"""Integrator of a comparison: a solver's name with its tolerance or its step."""

from typing import NamedTuple

from jaxbiped._checks import ArgumentError
from jaxbiped.cli._choices import SOLVERS

_EXPLICIT = ("bosh3", "tsit5", "dopri5", "dopri8", "euler", "runge2")


class Integrator(NamedTuple):
    """How to integrate: a solver's name, and its tolerance or its step.

    Attributes:
        solver: one of `SOLVERS`.
        rtol: relative tolerance; None for steps of one size.
        dt: that size [s]; None under error control.
    """

    solver: str
    rtol: float | None = None
    dt: float | None = None

    @property
    def explicit(self) -> bool:
        """Whether its steps solve no equations: its programs are small, quickly compiled."""
        return self.solver in _EXPLICIT

    @staticmethod
    def read(text: str) -> "Integrator":
        """From `rodas4:1e-6` (a tolerance) or `euler:dt=1e-6` (a step [s]).

        Raises:
            ArgumentError: anything else.
        """
        name, _, number = text.partition(":")
        fixed = number.startswith("dt=")
        try:
            value = float(number.removeprefix("dt="))
        except ValueError:
            value = -1.0
        if name not in SOLVERS or not value > 0.0:
            raise ArgumentError(
                f"integrator = {text!r} is not allowed: write SOLVER:TOLERANCE or SOLVER:dt=STEP, "
                f"the solver one of {', '.join(SOLVERS)}."
            )
        return Integrator(name, dt=value) if fixed else Integrator(name, rtol=value)
