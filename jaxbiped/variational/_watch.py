"""What a solve with derivatives watches: switches, a section, failures, a quantity's maxima."""

import functools
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar, VectorField
from jaxbiped.dynamics._switches import Switch

_ROUNDING = 1e-12


class Watch(eqx.Module):
    """What a solve ends steps on, and what ends it. All functions take (args, state).

    Attributes:
        field: vector field (t, state, args).
        switches: the surfaces that no step may straddle.
        section: value and whether a crossing counts; the solve ends where the value rises through
            zero and it does. None: nothing to arrive at.
        ending: code of the failure that ends the solve, 0 for none.
        peak: a quantity whose largest value is to be known.
    """

    field: VectorField = eqx.field(static=True)
    switches: Callable[[PyTree, PyTree], tuple[Switch, ...]] = eqx.field(static=True)
    section: Callable[[PyTree, PyTree], tuple[Scalar, Scalar]] | None = eqx.field(
        static=True, default=None
    )
    ending: Callable[[PyTree, PyTree], Scalar] | None = eqx.field(static=True, default=None)
    peak: Callable[[PyTree, PyTree], PyTree] | None = eqx.field(static=True, default=None)


def surfaces_of(watch: Watch, peak: PyTree, scene: PyTree, state: PyTree) -> list[Switch]:
    """Every surface to end steps on: switches, the peak quantity's maxima, and last the section."""
    found = list(watch.switches(scene, state))
    if watch.peak is not None:
        rate = watch.field(jnp.zeros_like(peak), state, scene)
        quantity = functools.partial(watch.peak, scene)
        value, slope = jax.jvp(quantity, (state,), (rate,))
        # The same value computed twice may differ by its rounding.
        found.append(Switch(slope, value >= peak - _ROUNDING * jnp.abs(peak)))
    if watch.section is not None:
        found.append(Switch(*watch.section(scene, state)))
    return found
