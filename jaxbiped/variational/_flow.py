"""Flow of a system in components and parameters, and what its switches, section and reset do to it.

The second variation differentiates with respect to both, which here are one vector.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree, PyTreeDef

from jaxbiped._types import Scalar, VectorField
from jaxbiped.hybrid._guards import Switch
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.solve.controllers._switch_locator import MARGIN, NEAR
from jaxbiped.variational._tangents import Seeded, with_active

Arrival = Callable[[PyTree, PyTree], tuple[Scalar, Scalar]]
"""Of (args, state): a section's value, and whether a crossing counts."""
_STEEPER, _LARGE = 1.2, 1e-4
"""From which ratio of its changes near a switch and farther off an entry of a Jacobian is without
bound, and from which size, in units of the largest entry, such a change is no rounding."""
SIDES = tuple(1e-11 * side for side in (1.0, 4.0, 16.0, -1.0, -4.0, -16.0))
"""When the two sides of a switch are looked at [s]: first the new one. Nearer, penetrations are all
rounding."""
_SOON = 4.0
"""Time to a switch that resets the state, in units of the longest step that crosses one, within
which a motion is about to."""
_NEARER = 0.1
"""Part of that at a corner of friction. There the slope goes as the square of time over the time in
which slip changes by v0, and only the speed must tell the sides apart."""


class Flow(eqx.Module):
    """What moves c components under p active parameters.

    Components and parameters come one by one to the rates, because pulling back through arrays of
    them makes programs that compile for seconds; to the rest as one vector z, shape (c + p,).

    Attributes:
        system: what moves.
        arrival: the section.
        field: the system's vector field (t, state, args).
        args: its parameters, of which the active ones are replaced.
        structure: of the state.
    """

    system: AbstractSystem = eqx.field(static=True)
    arrival: Arrival = eqx.field(static=True)
    field: VectorField = eqx.field(static=True)
    args: Seeded
    structure: PyTreeDef = eqx.field(static=True)

    def rates(self, y: Sequence[Scalar], parameters: Sequence[Scalar]) -> list[Scalar]:
        """The rates of the components."""
        state, scene = self._parts([*y, *parameters])
        return jtu.tree_leaves(self.field(jnp.zeros(()), state, scene))

    def velocity(self, z: Scalar) -> Scalar:
        """The same, shape (c,)."""
        c = self.structure.num_leaves
        return jnp.stack(self.rates(list(z[:c]), list(z[c:])))

    def surfaces(self, z: Scalar) -> tuple[Switch, ...]:
        """The switches."""
        state, scene = self._parts(z)
        return self.system.switches(scene, state)

    def reset(self, z: Scalar) -> Scalar:
        """The components after an arrival's reset, shape (c,)."""
        state, scene = self._parts(z)
        return jnp.stack(jtu.tree_leaves(self.system.reset_map(scene, state)))

    def switched(self, z: Scalar, which: Scalar) -> Scalar:
        """The components after the switch of a number, from 1 on, which may reset them, (c,)."""
        state, scene = self._parts(z)
        after = self.system.reset_at_switch(scene, state, which)
        return jnp.stack(jtu.tree_leaves(after))

    def section(self, z: Scalar) -> Scalar:
        """The section's value."""
        state, scene = self._parts(z)
        return self.arrival(scene, state)[0]

    @property
    def margin(self) -> float:
        """Time by which a step that ends on a switch belongs to the side before it."""
        return MARGIN * self.system.time_unit

    def earlier(self, row: Scalar, parameters: Scalar) -> Scalar:
        """Time and components, (1 + c,), as little earlier as tells a switch's sides apart."""
        rates = self.velocity(jnp.concatenate([row[1:], parameters]))
        return row - self.margin * jnp.concatenate([jnp.ones(1), rates])

    def _parts(self, z: Sequence[Scalar] | Scalar) -> tuple[PyTree, PyTree]:
        c = self.structure.num_leaves
        state = jtu.tree_unflatten(self.structure, list(z[:c]))
        return state, with_active(self.args, list(z[c:]))


class Crossing(NamedTuple):
    """The switch that a step ends just past, if any. No step is taken to cross two at once.

    Attributes:
        which: its number, counted from one; 0 where there is none.
        past: time from the switch to the step's end [s]; 0 where there is none.
        landed: the state on the switch, or the step's end where there is none, shape (c,).
        begun: the state behind the switch, shape (c,): another one where the switch resets it.
    """

    which: Scalar
    past: Scalar
    landed: Scalar
    begun: Scalar

    @property
    def crossed(self) -> Scalar:
        """Whether there is one."""
        return self.which > 0


def crossing_of(flow: Flow, before: Scalar, after: Scalar, parameters: Scalar) -> Crossing:
    """The crossing of one step: the first in the switches' order, where there are several."""
    old, new = (jnp.concatenate([y, parameters]) for y in (before, after))
    rate = _rate(flow, parameters)

    def values(z: Scalar) -> list[Scalar]:
        return [surface.value for surface in flow.surfaces(z)]

    def live(z: Scalar) -> list[Scalar | bool]:
        return [surface.live for surface in flow.surfaces(z)]

    velocity = rate(new)
    beyond, slopes = jax.jvp(values, (new,), (velocity,))
    resets = [surface.resets for surface in flow.surfaces(new)]
    towards = rate(old) if any(resets) else velocity
    near, falls = jax.jvp(values, (old,), (towards,)) if any(resets) else (values(old), beyond)
    soon = _SOON * NEAR * flow.system.time_unit
    changed = [
        # A step to a reset starts next to the switch and ends behind the reset.
        (a > 0.0) & (a + soon * fall <= 0.0) if is_reset else (a > 0.0) != (b > 0.0)
        for a, b, fall, is_reset in zip(near, beyond, falls, resets, strict=True)
    ]
    which = jnp.asarray(0)
    for number, (change, was, is_) in enumerate(zip(changed, live(old), live(new), strict=True)):
        which = jnp.where(change & (was | is_) & (which == 0), 1 + number, which)

    def back(past: Scalar) -> Scalar:
        return new - past * rate(new - 0.5 * past * velocity)

    def crossed() -> tuple[Scalar, Scalar]:
        slope = _pick(which, slopes, 1.0)
        first = _pick(which, beyond, 0.0) / slope
        # The switch's rate changes fast: once more from there.
        past = first + _pick(which, values(back(first)), 0.0) / slope
        return past, back(past)

    past, z = jax.lax.cond(which > 0, crossed, lambda: (jnp.zeros(()), new))
    landed = begun = z[: after.shape[0]]
    if any(resets):
        is_reset = _pick(which, list(map(jnp.asarray, resets)), jnp.asarray(False))
        ahead = -_pick(which, near, 0.0) / _pick(which, falls, 1.0)
        on = (old + ahead * towards)[: after.shape[0]]
        past = jnp.where(is_reset, 0.0, past)
        landed, begun = jnp.where(is_reset, on, landed), jnp.where(is_reset, after, begun)
    return Crossing(which, past, landed, begun)


def earlier_at(flow: Flow, landed: Scalar, which: Scalar, parameters: Scalar) -> Scalar:
    """How much earlier a change of components and parameters makes a crossing, shape (c + p,).

    Of the switch of number `which` at `landed`; zeros where there is none.
    """
    z = jnp.concatenate([landed, parameters])

    def value(z: Scalar) -> Scalar:
        return _pick(which, [surface.value for surface in flow.surfaces(z)], jnp.zeros(()))

    gradient = jax.grad(value)(z)
    return gradient / jnp.where(which > 0, gradient @ _rate(flow, parameters)(z), 1.0)


def sides_of(flow: Flow, landed: Scalar, which: Scalar, parameters: Scalar) -> Scalar:
    """Gives times at which to look at both sides of a switch by its number, see `SIDES`, (6,)."""
    surfaces = flow.surfaces(jnp.concatenate([landed, parameters]))
    parts = [jnp.asarray(_NEARER if surface.corner else 1.0) for surface in surfaces]
    return jnp.asarray(SIDES) * _pick(which, parts, 1.0)


def _rate(flow: Flow, parameters: Scalar) -> Callable[[Scalar], Scalar]:
    """The rate of components and parameters, which do not change."""
    return lambda z: jnp.concatenate([flow.velocity(z), jnp.zeros_like(parameters)])


def _pick(which: Scalar, each: Sequence[Scalar], value: Scalar | float) -> Scalar:
    """That of the switch of this number, or `value` where there is none."""
    for number, candidate in enumerate(each):
        value = jnp.where(which == 1 + number, candidate, value)
    return cast(Scalar, value)


def jump_of(at_sides: Scalar) -> Scalar:
    """J₊ − J₋ from its values on the `SIDES` of a switch, shape (c, n).

    Extrapolated to the switch itself, in the root of time: that is how Hertz's law leaves it. NaN
    where an entry grows without bound towards it, as behind Tsuji's touchdown.
    """

    def row(sides: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        new, old = (8.0 * sides[k] - 6.0 * sides[k + 1] + sides[k + 2] for k in (0, 3))
        # Times are 1 to 4 to 16: what goes as t^q there has a ratio of 4^-q, above 1 if q < 0.
        changes = jnp.abs(sides[:-1] - sides[1:])
        near, far = changes[0::3], changes[1::3]
        steep = jnp.where(near > _STEEPER * far, near, 0.0)
        return (new - old) / 3.0, jnp.max(steep), jnp.max(jnp.abs(sides))

    jump, steep, largest = jax.lax.map(row, jnp.moveaxis(at_sides, 1, 0))
    return jnp.where(jnp.max(steep) > _LARGE * jnp.max(largest), jnp.nan, jump)


def on_section(
    flow: Flow, jacobian: Scalar, z: Scalar, v: Scalar, q: Scalar, second: Scalar
) -> tuple[Scalar, Scalar, Scalar]:
    """Tangents at a fixed time made tangents on the section g = 0 that `z` lies on.

    A tangent V moves the arrival by τ_V = −dg·V/ġ and becomes V + f τ_V. Differentiated once more,
    the mixed tangent C becomes C + (J V) τ_Q + (J Q) τ_V + (J f) τ_V τ_Q + f τ_VQ, where τ_VQ keeps
    it on the section.

    Args:
        flow: what moves.
        jacobian: J of its rates, shape (c, c + p).
        z: components and parameters, shape (c + p,), as `v` and `q`.
        v, q: the tangents.
        second: C, shape (c,).
    """
    c = len(second)
    rate = flow.velocity(z)
    velocity = jnp.concatenate([rate, jnp.zeros(len(z) - c)])
    gradient, curve = jax.jvp(jax.grad(flow.section), (z,), (v,))
    slope = gradient @ velocity
    by_v, by_q = -(gradient @ v) / slope, -(gradient @ q) / slope
    curve = curve + by_v * jax.jvp(jax.grad(flow.section), (z,), (velocity,))[1]
    second = second + (jacobian @ v) * by_q + (jacobian @ (q + velocity * by_q)) * by_v
    both = -(curve @ (q + velocity * by_q) + gradient[:c] @ second) / slope
    return v + velocity * by_v, q + velocity * by_q, second + rate * both


def tangent_on_section(flow: Flow, z: Scalar, v: Scalar) -> Scalar:
    """A first tangent at a fixed time made one on the section, as `on_section` does; (c + p,)."""
    rate = flow.velocity(z)
    velocity = jnp.concatenate([rate, jnp.zeros(len(z) - len(rate))])
    gradient = jax.grad(flow.section)(z)
    return v - velocity * (gradient @ v) / (gradient @ velocity)


def after_reset(
    flow: Flow, z: Scalar, v: Scalar, q: Scalar, second: Scalar
) -> tuple[Scalar, Scalar]:
    """Of `q` and the mixed tangent what the reset map makes of them, shape (c,) each."""

    def pushed(z: Scalar, along: Scalar) -> Scalar:
        return jax.jvp(flow.reset, (z,), (along,))[1]

    change = jnp.concatenate([second, jnp.zeros(len(z) - len(second))])
    return jax.jvp(pushed, (z, q), (v, change))
