"""What a solve gives: the last state and time, how it ended, and its steps."""

from typing import Any, NamedTuple

from jaxtyping import PyTree

from jaxbiped._types import Scalar


class Solved(NamedTuple):
    """One simulation's outputs; None for what the solve does not tell.

    Attributes:
        t, state: the last time [s], and the state then.
        ending: code of the `Ending`.
        footsteps: how many there were; see `LandingProgress`, as of `grazes` and `pulls`.
        accepted, rejected: attempted steps, by what became of them.
        begin: the first mode.
        lowest, highest: extremes of what was asked for.
        missed_contacts: number of contacts between steps of one size.
        integrals: of what was asked for, along the solve.
    """

    t: Scalar
    state: PyTree
    ending: Scalar
    footsteps: PyTree
    accepted: Scalar
    rejected: Scalar
    grazes: Scalar | None = None
    pulls: Scalar | None = None
    begin: Scalar | None = None
    lowest: PyTree = None
    highest: PyTree = None
    missed_contacts: Scalar | None = None
    integrals: PyTree = None

    @property
    def outcome(self) -> dict[str, Any]:
        """What a trajectory tells of it, whatever it saves."""
        told = ("ending", "accepted", "rejected", "grazes", "pulls", "lowest", "highest")
        return {name: getattr(self, name) for name in (*told, "missed_contacts", "integrals")}
