"""Resets at switches: the state behind one, and resets that follow each other ever faster."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Numbers, Scalar, any_of
from jaxbiped.solve._watch import Watch
from jaxbiped.solve.controllers._switch_locator import SwitchLocatorState

_NEAR, _MANY = 1e-6, 8
"""Time between resets that gather, in the system's unit, and how many of them are too many."""


class Gathering(NamedTuple):
    """Resets of a motion so far.

    Attributes:
        last: time of the last one [s].
        followed: how many have followed each other within a short time.
    """

    last: Scalar
    followed: Scalar

    @classmethod
    def none(cls, like: Numbers) -> "Gathering":
        """Before the first reset."""
        return cls(jnp.full_like(like, -jnp.inf), jnp.zeros((), dtype=jnp.int64))

    @property
    def chatters(self) -> Scalar:
        """Whether too many gather for the motion to go on (boolean)."""
        return self.followed >= _MANY

    def after(self, met: Scalar, t: Scalar, repeats: Scalar, unit: float) -> "Gathering":
        """The same behind an attempt.

        Args:
            met: whether it ended in a reset (boolean).
            t: its end [s].
            repeats: whether the reset left the state where it is reset (boolean).
            unit: the system's unit of time [s].
        """
        near = t - self.last < _NEAR * unit
        count = jnp.where(repeats, _MANY, jnp.where(near, self.followed + 1, 0))
        return Gathering(jnp.where(met, t, self.last), jnp.where(met, count, self.followed))


def reset_at_switch(
    watch: Watch,
    args: PyTree,
    landed: SwitchLocatorState,
    keep: Scalar,
    t: Scalar,
    state: PyTree,
    columns: Any,
    resets: Gathering | None,
    reset: Callable[[PyTree, Any, Scalar], tuple[PyTree, Any]] | None = None,
) -> tuple[Scalar, PyTree, Any, Gathering | None]:
    """Time, state, columns and resets at a step's end, behind the reset if a switch was passed.

    The state that is reset is that on the switch: the little time past it is taken back, along the
    rates. Behind a switch that resets nothing that would only lead to it once more. `reset` gives
    state and columns behind those on the switch of a number; None: the watch's own, which knows no
    columns.
    """
    which, past, repeats = landed.crossed_field, landed.past, watch.repeats
    met = keep & (which > 0)
    switches = eqx.filter_eval_shape(watch.switches, args, state)
    if not all(switch.resets or switch.corner for switch in switches):
        numbers = [number for number, switch in enumerate(switches, 1) if switch.resets]
        met = met & any_of([which == number for number in numbers])

    def behind() -> tuple[PyTree, Any, Scalar | None]:
        rates = watch.field(t, state, args)
        on = jtu.tree_map(lambda leaf, rate: leaf - past * rate, state, rates)
        if reset is None:
            assert watch.reset is not None
            after, moved = watch.reset(args, on, which), columns
        else:
            after, moved = reset(on, columns, which)
        return after, moved, None if repeats is None else repeats(args, after)

    def as_it_is() -> tuple[PyTree, Any, Scalar | None]:
        return state, columns, None if repeats is None else jnp.asarray(False)

    after, moved, again = jax.lax.cond(met, behind, as_it_is)
    time = jnp.where(met, t - past, t)
    if resets is not None and again is not None:
        resets = resets.after(met, time, again, watch.time_unit)
    return time, after, moved, resets
