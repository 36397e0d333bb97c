"""Watch: what the steps of a solve end on, and what ends the solve."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
from jaxtyping import PyTree

from jaxbiped._types import Scalar, VectorField
from jaxbiped.hybrid._guards import Switch
from jaxbiped.hybrid._system import AbstractSystem


class Watch(eqx.Module):
    """What a solve ends steps on, and what ends it. All functions take (args, state).

    Attributes:
        field: vector field (t, state, args).
        switches: the surfaces that no step may straddle.
        section: value and whether a crossing counts; the solve ends where the value rises through
            zero and it does. None: nothing to arrive at.
        asked_before: whether a crossing of the section counts is asked before it, and not behind.
        ending: code of the failure that ends the solve, 0 for none.
        peak: a quantity whose largest value is to be known.
        reset: what becomes of the state at a switch that `resets`, of (args, state, number of the
            switch, from 1 on).
        repeats: whether a state just behind a reset is still where it is reset; None: it never is.
        arrival: what becomes of it on the section, for a program to carry its columns through.
        project: the state at a step's end on the constraints, if there are any that it leaves.
        told: the state as nodes have it, if that is another one.
        time_unit: what distances of steps from switches are measured in [s].
    """

    field: VectorField = eqx.field(static=True)
    switches: Callable[[PyTree, PyTree], tuple[Switch, ...]] = eqx.field(static=True)
    section: Callable[[PyTree, PyTree], tuple[Scalar, Scalar]] | None = eqx.field(
        static=True, default=None
    )
    asked_before: bool = eqx.field(static=True, default=False)
    ending: Callable[[PyTree, PyTree], Scalar] | None = eqx.field(static=True, default=None)
    peak: Callable[[PyTree, PyTree], PyTree] | None = eqx.field(static=True, default=None)
    reset: Callable[[PyTree, PyTree, Scalar], PyTree] | None = eqx.field(static=True, default=None)
    arrival: Callable[[PyTree, PyTree], PyTree] | None = eqx.field(static=True, default=None)
    project: Callable[[PyTree, PyTree], PyTree] | None = eqx.field(static=True, default=None)
    told: Callable[[PyTree, PyTree], PyTree] | None = eqx.field(static=True, default=None)
    repeats: Callable[[PyTree, PyTree], Scalar] | None = eqx.field(static=True, default=None)
    time_unit: float = eqx.field(static=True, default=1.0)

    @classmethod
    def of(cls, system: AbstractSystem, *, resets: bool, **ends: Any) -> "Watch":
        """The switches of a system, and whatever else `ends` steps or the solve, by attribute.

        `resets`: whether a switch of these solves may reset the state.
        """
        return cls(
            field=system.vector_field,
            switches=system.switches,
            reset=system.reset_at_switch if resets else None,
            repeats=system.repeats if system.resets else None,
            time_unit=system.time_unit,
            **ends,
        )

    def node(self, args: PyTree, y: PyTree) -> PyTree:
        """A state as nodes have it."""
        return y if self.told is None else self.told(args, y)
