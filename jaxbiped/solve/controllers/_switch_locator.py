"""Switch locator: a step-size controller whose steps end just past every switch.

A step across a switch would ruin derivatives long before the state shows it.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time, select
from jaxbiped.compiler import fusion_barrier
from jaxbiped.hybrid._guards import Switch
from jaxbiped.solve._step_polynomials import StepCubic
from jaxbiped.solve._watch import Watch
from jaxbiped.solve.controllers._grazing import ROUNDING, turns_of
from jaxbiped.solve.controllers._wrapped_control import (
    AbstractWrappedControl,
    Adapted,
    Attempt,
    try_again,
)

_OVERSHOOT = 1e-4
"""Largest part of a step that may lie past a switch."""
MARGIN = 1e-12
"""Time past a switch, in the watch's unit, that a step may always end, and aims at: the side must
be beyond doubt."""
NEAR = 1e-11
"""Longest step, in that unit, that crosses a switch where the field itself is not smooth: longer
ones end before it, for a step's last stage lies on the other side, where the Jacobian may be any
size."""
_MARGIN_TICKS, _NEAR_TICKS = 2e-15, 1e-12
"""Both at least, as shares of the time that has passed, whose rounding they must exceed; `_BEFORE`
of the latter is some roundings, too."""
_BEFORE = 1e-3
"""How far before, as a share of the way to it."""
_PEAK_ROUNDING = 1e-12
_LAST, _LEFT = 1e-8, 0.1
"""Longest last step to the section or a largest load where there are switches, in that unit, and
the share of the way that each step before leaves. A step's error in a stiff component of the state
turns the rates by that error times the component's own rate, and so moves the time of a load."""


def at_least(length: float, ticks: float, t: Time) -> Scalar:
    """A length of time, no less than a share of the time that has passed."""
    return jnp.maximum(length, ticks * jnp.abs(t))


def nearest(watch: Watch, t: Time) -> Scalar:
    """Longest step to a time that crosses a switch where the field is not smooth."""
    return at_least(NEAR * watch.time_unit, _NEAR_TICKS, t)


class SwitchLocatorState(NamedTuple):
    """What a solve with `SwitchLocator` knows at its end, besides the state.

    Attributes:
        inner: state of the wrapped controller.
        accepted: number of steps accepted.
        landings: number of them that ended just past a switch.
        jumps: number of them that ended past a switch where the vector field itself jumps.
        sizes: the largest absolute values of the state's leaves so far: what its error is
            relative to. None where there are no switches.
        grazes: number of steps in which a switch was grazed: no derivatives are determined then.
        saltation_pending: whether the last accepted step passed a switch where the field is not
            smooth: columns of `TangentSolver` have yet to jump there.
        jumps_at_peak: whether the field jumped in the step with the largest value.
        crossed_field: number of the first switch that the last step passed, counted from one,
            negative if only the slope of a force jumps there; 0 if it passed none. A switch where
            the field jumps precedes all others.
        past: time from that switch to the step's end [s].
        arrived: whether the section was reached.
        code: that of the failure that ended the solve, 0 for none.
        peak: largest value of the watched quantity at the ends of steps; None where none is.
        at_peak: the solve's whole state there.
    """

    inner: PyTree
    sizes: PyTree
    accepted: Scalar
    landings: Scalar
    jumps: Scalar
    grazes: Scalar
    saltation_pending: Scalar
    jumps_at_peak: Scalar
    crossed_field: Scalar
    past: Scalar
    arrived: Scalar
    code: Scalar
    peak: PyTree
    at_peak: PyTree


def _as_it_is(tree: PyTree) -> PyTree:
    return tree


class SwitchLocator(AbstractWrappedControl):
    """Wraps a controller; a step that crosses a switch is tried again, to end just past it.

    So no step straddles a jump of the Jacobian, which would ruin derivatives taken through the
    solver long before the state shows it. Where to end comes from the switch functions and their
    rates at both ends of the step, by a cubic; a few attempts do. Where a switch comes near zero
    within a step, that ends there, lest it be crossed twice. The first step of a solve never
    counts as an arrival, so a solve may start on its section.

    Attributes:
        watch: what is looked for.
        corners: whether steps also stop short of switches where only the slope of a force jumps,
            for columns that cross with the Jacobian of each side.
        state_of, args_of: what the watch looks at, of the solve's state and of its arguments, which
            may have derivatives beside them.
    """

    watch: Watch
    corners: bool = eqx.field(static=True, default=False)
    state_of: Callable[[PyTree], PyTree] = eqx.field(static=True, default=_as_it_is)
    args_of: Callable[[PyTree], PyTree] = eqx.field(static=True, default=_as_it_is)

    def init(self, *request: Any) -> tuple[Scalar, SwitchLocatorState]:
        first, inner = self.controller.init(*request)
        _, _, _, y0, _, args, *_ = request
        zero, no = jnp.asarray(0), jnp.asarray(False)
        peak = None
        if self.watch.peak is not None:
            peak = jax.lax.stop_gradient(self.watch.peak(self.args_of(args), self.state_of(y0)))
        at_peak = None if peak is None else y0
        state, sizes = self.state_of(y0), None
        if self.watch.switches(self.args_of(args), state):
            sizes = jax.lax.stop_gradient(jtu.tree_map(jnp.abs, state))
        counts = zero, zero, zero, zero
        return first, SwitchLocatorState(
            inner, sizes, *counts, no, no, zero, jnp.zeros_like(first), no, zero, peak, at_peak
        )

    def adapt(self, attempt: Attempt) -> Adapted:
        """Accepts or rejects a step as the wrapped controller does, but at switches."""
        known: SwitchLocatorState = attempt.memory
        attempt = attempt._replace(memory=known.inner)
        t0, t1 = attempt.t0, attempt.t1
        margin = at_least(MARGIN * self.watch.time_unit, _MARGIN_TICKS, t1)
        near, last = nearest(self.watch, t1), _LAST * self.watch.time_unit
        adapted = attempt.by(self.controller)
        states = (self.state_of(y) for y in (attempt.y0, attempt.y1))
        parts = (self.args_of(attempt.args), *states)
        scene, before, after = jax.lax.stop_gradient(parts)
        span = cast(Scalar, t1 - t0)
        crossed, first, place = self._crossings(span, scene, before, after, known)
        before_first, before_switch = span * first, span * place
        far = span - before_first > jnp.maximum(_OVERSHOOT * before_first, 4.0 * margin)
        is_far = crossed.read & (before_first > last)
        again = crossed.any & (far | is_far | ((crossed.which != 0) & (span > 2.0 * near)))
        past_first = before_first * (1.0 + 0.5 * _OVERSHOOT) + margin
        # Whatever else comes first, the step ends on this side of the switch.
        short_of_switch = jnp.minimum(past_first, before_switch * (1.0 - _BEFORE))
        approaches = (crossed.which != 0) & (before_switch > near)
        past_first = jnp.where(is_far, before_first * (1.0 - _LEFT), past_first)
        target = t0 + jnp.where(approaches, short_of_switch, past_first)
        target = cast(Scalar, jax.lax.stop_gradient(target))
        adapted = try_again(attempt, adapted, again, target)
        inner, keep = adapted.memory, adapted.keep
        landed = self._landed(inner, keep, crossed, scene, after, attempt.y1, known)
        landed = landed._replace(past=jnp.asarray(span - before_switch))
        ends = landed.arrived | (landed.code != 0)
        ended = diffrax.RESULTS.where(
            ends, diffrax.RESULTS.event_occurred, diffrax.RESULTS.successful
        )
        succeeds = adapted.result == diffrax.RESULTS.successful
        result = diffrax.RESULTS.where(succeeds, ended, adapted.result)
        # A state that is no longer a number leaves no step size to go on with.
        lost = ~jnp.isfinite(adapted.t1)
        result = diffrax.RESULTS.where(lost, diffrax.RESULTS.dt_min_reached, result)
        jump = adapted.jump | landed.saltation_pending
        return adapted._replace(jump=jump, memory=landed, result=result)

    def _crossings(
        self, span: Scalar, scene: PyTree, before: PyTree, after: PyTree, landed: SwitchLocatorState
    ) -> tuple["_Crossed", Scalar, Scalar]:
        """Which surfaces a step crosses, and the parts of it that lie before the first of them, and
        before the switch that is told.

        Or before a switch comes so near zero that it may be crossed twice in this step.
        """
        watch = self.watch
        surfaces = functools.partial(surfaces_of, watch, landed.peak, scene)
        at_start, at_end = surfaces(before), surfaces(after)
        crossed = [_crosses(a, b) for a, b in zip(at_start, at_end, strict=True)]
        # A foot that is put on the ground starts on its switch: rounding alone tells the side.
        begins = [(landed.accepted == 0) & (jnp.abs(each.value) <= ROUNDING) for each in at_start]
        crossed = [c & ~on for c, on in zip(crossed, begins, strict=True)]
        arrives = jnp.asarray(False)
        if watch.section is not None:
            arrives = crossed[-1] & (at_end[-1].value > 0.0) & (landed.accepted > 0)
            crossed[-1] = arrives
            # Whether it counts is asked where the step ends just past it, not before.
            arrives = arrives & (at_start if watch.asked_before else at_end)[-1].live
        others = (watch.peak is not None) + (watch.section is not None)
        count = len(crossed) - others
        switching = crossed[:count]
        jumps = [c for c, s in zip(switching, at_end, strict=False) if s.force_jumps]
        turns = None
        if count:
            turns = turns_of(
                lambda y: watch.field(jnp.zeros_like(span), y, scene),
                functools.partial(watch.switches, scene),
                span,
                before,
                after,
                errors=jtu.tree_map(lambda size: self.rtol * size, landed.sizes),
            )
            turns = turns._replace(touches=turns.touches & ~jnp.stack(begins[:count]))
        none = jnp.asarray(False)
        any_crossed = functools.reduce(jnp.logical_or, crossed, none)
        if turns is not None:
            any_crossed = any_crossed | jnp.any(turns.touches)

        def locate() -> tuple[Scalar, Scalar, Scalar, Scalar]:
            parts = []
            for state, found in ((before, at_start), (after, at_end)):
                rate = watch.field(jnp.zeros_like(span), state, scene)
                values = jnp.stack([s.value for s in found])
                _, slopes = jax.jvp(lambda y: [s.value for s in surfaces(y)], (state,), (rate,))
                parts += [values, span * jnp.stack(slopes)]
            roots = StepCubic(parts[0], parts[2], parts[1], parts[3]).sign_change()
            roots = jnp.where(jnp.stack(crossed), roots, 1.0)
            first, place, which = jnp.min(roots), jnp.ones_like(span), jnp.asarray(0)
            read = jnp.min(jnp.append(roots[count:], 1.0)) <= first if count else none
            for number, switch in enumerate(at_end[:count], 1):
                if switch.corner and not self.corners:
                    continue
                root, sign = roots[number - 1], -1 if switch.corner else 1
                other = which == 0 if switch.corner else which <= 0
                is_first = crossed[number - 1] & (other | ((which * sign > 0) & (root < place)))
                place = jnp.where(is_first, root, place)
                which = jnp.where(is_first, sign * number, which)
            if turns is not None:
                touch = jnp.min(jnp.where(turns.touches, turns.places, 1.0))
                read = read & (touch > first)
                first = jnp.minimum(first, touch)
            return first, place, which, read

        part, place, which, read = jnp.ones_like(span), jnp.ones_like(span), jnp.asarray(0), none
        if crossed:
            part, place, which, read = fusion_barrier(any_crossed, locate)
            part, place = (jnp.where(any_crossed, each, 1.0) for each in (part, place))
            which = jnp.where(any_crossed, which, 0)
        found = _Crossed(
            any_crossed,
            functools.reduce(jnp.logical_or, switching, none),
            functools.reduce(jnp.logical_or, jumps, none),
            arrives,
            none if turns is None else turns.graze,
            which,
            read & any_crossed,
        )
        return found, part, place

    def _landed(
        self,
        inner: PyTree,
        keep: Scalar,
        crossed: "_Crossed",
        scene: PyTree,
        after: PyTree,
        y1: PyTree,
        old: SwitchLocatorState,
    ) -> SwitchLocatorState:
        code, sizes = old.code, old.sizes
        if sizes is not None:
            grown = jtu.tree_map(lambda s, leaf: jnp.maximum(s, jnp.abs(leaf)), sizes, after)
            sizes = select(keep, grown, sizes)
        if self.watch.ending is not None:
            ending = functools.partial(self.watch.ending, scene, after)
            code = jnp.where(keep, fusion_barrier(keep, ending), 0)
        peak, at_peak, jumps_at_peak = old.peak, old.at_peak, old.jumps_at_peak
        if self.watch.peak is not None:
            value = fusion_barrier(keep, functools.partial(self.watch.peak, scene, after))
            # A step across the section ends behind it, where the load is none of the cycle's.
            record = keep & (value > peak) & ~crossed.section
            peak = jnp.where(record, value, peak)
            jumps_at_peak = jnp.where(record, crossed.jump, jumps_at_peak)
            at_peak = select(record, y1, at_peak)
        return SwitchLocatorState(
            inner=inner,
            sizes=sizes,
            accepted=old.accepted + jnp.where(keep, 1, 0),
            landings=old.landings + jnp.where(keep & crossed.switch, 1, 0),
            jumps=old.jumps + jnp.where(keep & crossed.jump, 1, 0),
            grazes=old.grazes + jnp.where(keep & crossed.graze, 1, 0),
            saltation_pending=jnp.where(keep, crossed.field, old.saltation_pending),
            jumps_at_peak=jumps_at_peak,
            crossed_field=jnp.where(keep, crossed.which, 0),
            past=old.past,
            # What has fallen by then has not arrived.
            arrived=keep & crossed.section & (code == 0),
            code=code,
            peak=peak,
            at_peak=at_peak,
        )


def surfaces_of(watch: Watch, peak: PyTree, scene: PyTree, state: PyTree) -> list[Switch]:
    """Every surface to end steps on: switches, the peak quantity's maxima, and last the section."""
    found = list(watch.switches(scene, state))
    if watch.peak is not None:
        rate = watch.field(jnp.zeros_like(peak), state, scene)
        quantity = functools.partial(watch.peak, scene)
        value, slope = jax.jvp(quantity, (state,), (rate,))
        # The same value computed twice may differ by its rounding.
        found.append(Switch(slope, value >= peak - _PEAK_ROUNDING * jnp.abs(peak)))
    if watch.section is not None:
        found.append(Switch(*watch.section(scene, state)))
    return found


def _crosses(before: Switch, after: Switch) -> Scalar:
    """Whether a step crosses a surface that matters; one that resets the state only downwards."""
    if before.resets:
        return (before.value > 0.0) & (after.value <= 0.0) & before.live
    return ((before.value > 0.0) != (after.value > 0.0)) & (before.live | after.live)


class _Crossed(NamedTuple):
    any: Scalar
    switch: Scalar
    jump: Scalar
    section: Scalar
    graze: Scalar
    which: Scalar
    read: Scalar

    @property
    def field(self) -> Scalar:
        """Whether one of the surfaces is a switch where the field itself is not smooth."""
        return self.which > 0
