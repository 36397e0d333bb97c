"""Row of a trade study: one way at one setting, its errors and its work."""

import math
from typing import NamedTuple

from jaxbiped._types import JsonObject
from jaxbiped.trade._truth import Truth, Values
from jaxbiped.trade._work import Work

OK = "ok"
ASTRAY = 0.05
"""Error, in the units of its axis, from which a solve that came to its end has still failed."""


class Row(NamedTuple):
    """One way of solving at one setting. A way that failed has a row all the same.

    Attributes:
        way: method and engine.
        setting: its tolerance or its step, as a user would write it.
        outcome: "ok", or in words what happened instead.
        errors: by the name of the error axis, in that axis's units; None where it is not finite.
        seconds, cpu_s, compile_s: as in `Work`; None where nothing ran.
        attempted, rejected: steps of the solver, None where they are not known.
    """

    way: str
    setting: str
    outcome: str
    errors: dict[str, float | None]
    seconds: float | None = None
    cpu_s: float | None = None
    compile_s: float | None = None
    attempted: int | None = None
    rejected: int | None = None

    def numbers(self) -> JsonObject:
        """The row ready for JSON."""
        return dict(self._asdict())


def row_of(
    way: str,
    setting: str,
    outcome: str,
    truth: Truth,
    values: Values,
    work: Work,
    *,
    attempted: int | None = None,
    rejected: int | None = None,
) -> Row:
    """The row of a solve, told against the truth.

    Args:
        way: method and engine.
        setting: its tolerance or its step.
        outcome: "ok" where it came to its end, else what happened.
        truth: what its values are compared with.
        values: what it gave, by the name of the error axis.
        work: what it took.
        attempted: steps; rejected: those of them that were.

    Returns:
        A row whose outcome is "wrong" where an error is 0.05 or more although it came to its end.
    """
    errors = truth.errors(values)
    if outcome == OK and any(not error < ASTRAY for error in errors.values()):
        outcome = "wrong"
    told = {name: error if math.isfinite(error) else None for name, error in errors.items()}
    return Row(way, setting, outcome, told, *work, attempted, rejected)


def failed_row(way: str, setting: str, outcome: str) -> Row:
    """The row of a way that was refused or is not installed."""
    return Row(way, setting, outcome, {})
