"""Steps of a solve, as it tells them to what saves, sums or judges the motion."""

from collections.abc import Callable
from typing import NamedTuple

from jaxtyping import PyTree

from jaxbiped._types import Scalar


class Rise(NamedTuple):
    """Where a section's value rises through zero within a step.

    Attributes:
        happens: whether it does, and it is an arrival.
        since, until: times before and after [s].
    """

    happens: Scalar
    since: Scalar
    until: Scalar


class Step(NamedTuple):
    """An attempted step, as a recorder sees it.

    Attributes:
        t0, y0: time [s] and state where it began.
        t1, y1: where the next one begins: its end where it was accepted.
        keep: whether it was accepted, and its end is known.
        coefficients: gives those of its continuous solution (True), or only those from which a
            state within it is made (False).
        end: gives the state at its end before a reset; None where there are no resets.
        strikes: whether a footstep ends it; None where footsteps are not counted.
        changes: whether a change of mode ends it; None where there is only one.
        continues: whether it only tells the end of the step before; None: it never does.
        grazes: number of steps so far in which a switch was grazed; None where no step ends on one.
    """

    t0: Scalar
    y0: PyTree
    t1: Scalar
    y1: PyTree
    keep: Scalar
    coefficients: Callable[[bool], tuple[PyTree, ...]]
    end: Callable[[], PyTree] | None = None
    strikes: Scalar | None = None
    changes: Scalar | None = None
    continues: Scalar | None = None
    grazes: Scalar | None = None


class Moment(NamedTuple):
    """Where a solve is behind an attempt.

    Attributes:
        t, state: time [s] and state, as they are told.
        strikes: whether a footstep has just come; None where this is not asked.
        changes: whether the mode has just changed; None where there is only one.
    """

    t: Scalar
    state: PyTree
    strikes: Scalar | None = None
    changes: Scalar | None = None


class LastStep(NamedTuple):
    """The last attempt: when it began, its coefficients, and whether it is of note.

    It is where it was accepted, or where there is a section, where there is an arrival within it.

    Attributes:
        leg: number of the last arrival's, from 1 on; at the start that which stands alone, 0 for
            none. None without a section, as is `rise`.
        rise: where the arrival lies.
        end: the state at its end before a reset; None where this is not asked.
    """

    noted: Scalar
    t: Scalar
    state: PyTree
    coefficients: tuple[PyTree, ...]
    leg: Scalar | None = None
    rise: Rise | None = None
    end: PyTree = None
