"""Mode changes within a rigid walker's steps: whether a step meets one, and landing on it.

A step that ends behind a surface is followed back to it by Newton's method, as to a heel strike.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxbiped._types import Scalar, select
from jaxbiped.dynamics._joint_loads import of_all_bodies
from jaxbiped.dynamics._mode_changes import mode_switches
from jaxbiped.dynamics._stance import angles_and_rates
from jaxbiped.dynamics._stance_motion import rolling_field
from jaxbiped.scene._modes import rigid_modes
from jaxbiped.scene._scene import RigidScene
from jaxbiped.solve._step_polynomials import Quintic, StepCubic

_KNOWN = 1.0
"""Error that a surface may have, in units of rtol."""
_INTERPOLATED = 2.0
"""Largest error of an interpolated gap [rad], as of an opening; see `_rolling_step`."""
_NEAR = 0.1
"""Distance from a surface, in units of rtol, from which one Euler step leads onto it."""


class SurfaceCourse(NamedTuple):
    """The surfaces of a mode at a state.

    Attributes:
        values, rates: of each, shape (k,), the rates in 1/s.
        live: whether it matters there (booleans), shape (k,).
        bends: second derivatives of the first h, the gaps of limits, shape (h,).
        turning: angular accelerations there [rad/s²].
    """

    values: Scalar
    rates: Scalar
    live: Scalar
    bends: Scalar
    turning: tuple[Scalar, ...] = ()


def course_of(scene: RigidScene, state: Any) -> SurfaceCourse:
    """The surfaces at a state, followed along its motion."""

    def values(y: Any) -> tuple[list[Scalar], list[Scalar]]:
        found = mode_switches(scene, y)
        return [each.value for each in found], [jnp.asarray(each.live) for each in found]

    mechanism = scene.mechanism
    rates = rolling_field(0.0, state, scene)
    value, slope, live = jax.jvp(values, (state,), (rates,), has_aux=True)
    _, moves = angles_and_rates(mechanism.structure, rates)
    turning = of_all_bodies(mechanism.structure, moves, rates[0])
    bends = [limit.gap.of(turning) for limit in rigid_modes(mechanism).limits]
    return SurfaceCourse(
        jnp.stack(value),
        jnp.stack(slope),
        jnp.stack(live),
        jnp.stack(bends) if bends else jnp.zeros(0, value[0].dtype),
        moves,
    )


class ModeEvents(NamedTuple):
    """What surfaces do within a step.

    Attributes:
        crosses: whether one is crossed (boolean).
        which: its number, the first one in time.
        place: the share of the step that lies before, roughly; 1 where none is.
        unclear: whether the step is too long to tell.
        grazes: whether one is touched by less than it is known to.
    """

    crosses: Scalar
    which: Scalar
    place: Scalar
    unclear: Scalar
    grazes: Scalar


def mode_events(
    step: Scalar, before: SurfaceCourse, after: SurfaceCourse, rtol: Scalar, length: Scalar
) -> ModeEvents:
    """What happens within a step of one mode.

    Args:
        step: its length [s].
        before, after: the surfaces at its ends.
        rtol: relative tolerance.
        length: its length in units of the one whose error is the tolerance.
    """
    known = _KNOWN * rtol
    begins_off = before.live & (before.values > known)
    leaves = before.live & (before.values > -known) & (before.rates > 0.0)
    crosses = (begins_off | leaves) & (after.values <= 0.0)
    # At rest on its surface its acceleration alone tells where it goes first.
    crosses = crosses | (before.live & (after.values <= -known))
    cubic = StepCubic(before.values, after.values, step * before.rates, step * after.rates)
    lowest = cubic.at(cubic.turning_point())
    touches = begins_off & ~crosses & cubic.may_touch()
    unclear, grazes = touches & (lowest < -known), touches & (jnp.abs(lowest) <= known)
    gaps = len(before.bends)
    if gaps:
        # Gaps are sums of angles, whose quintic bounds them.
        root = jnp.sqrt(rtol)
        off = _INTERPOLATED * root * jnp.sqrt(root) * length**6
        ends = ((each.values[:gaps], each.rates[:gaps], each.bends) for each in (before, after))
        width = jnp.maximum(off, known)
        first, second, third, *others = Quintic.of(step, *ends).control
        # What rests on its surface leaves it by its acceleration.
        rests = ~begins_off[:gaps] & (jnp.abs(second) <= width)
        first, second = (jnp.where(rests, third, each) for each in (first, second))
        course = Quintic((first, second, third, *others))
        counts = [
            course.sign_changes(shift, from_second=~begins_off[:gaps]) for shift in (width, -width)
        ]
        live = before.live[:gaps]
        several = live & (jnp.minimum(*counts) > 1)
        perhaps = live & (jnp.maximum(*counts) > 1) & ~several
        unclear = jnp.concatenate([several | (perhaps & (off > known)), unclear[gaps:]])
        grazes = jnp.concatenate(
            [perhaps & (off <= known) & ~crosses[:gaps] & ~rests, grazes[gaps:]]
        )
    happens = jnp.any(crosses)

    def locate() -> tuple[Scalar, Scalar]:
        # What begins on its surface is followed from behind: there it may lie for a while.
        falls = after.rates < 0.0
        behind = 1.0 - after.values / jnp.where(falls, step * after.rates, 1.0)
        from_end = ~begins_off & falls
        places = jnp.where(from_end, jnp.clip(behind, 0.0, 1.0), cubic.sign_change())
        places = jnp.where(crosses, places, 1.0)
        which, first = jnp.zeros((), dtype=jnp.int64), places[0]
        for k in range(1, len(places)):
            which = jnp.where(places[k] < first, k, which)
            first = jnp.minimum(first, places[k])
        return which, first

    none = jnp.zeros((), dtype=jnp.int64), jnp.ones_like(step)
    which, place = jax.lax.cond(happens, locate, lambda: none)
    return ModeEvents(happens, which, place, jnp.any(unclear), jnp.any(grazes))


class OntoSurface(NamedTuple):
    """From a state onto a surface: whether one Euler step leads there, and its length [s]."""

    near: Scalar
    rest: Scalar


def onto_surface(at: SurfaceCourse, which: Scalar, rtol: Scalar, pace: Scalar) -> OntoSurface:
    """The way from a state to the surface of this number.

    Args:
        at: the surfaces there.
        which: its number.
        rtol: relative tolerance.
        pace: a step whose error is about the tolerance [s].
    """
    straight = [jnp.zeros_like(pace)] * (len(at.values) - len(at.bends))
    every = zip(at.values, at.rates, [*at.bends, *straight], at.live, strict=True)
    value, rate, bend, live = next(every)
    known = jnp.asarray(len(at.bends) > 0)
    for k, each in enumerate(every, start=1):
        value, rate, bend, live, known = select(
            which == k, (*each, jnp.asarray(k < len(at.bends))), (value, rate, bend, live, known)
        )
    there = jnp.abs(value) <= _NEAR * rtol
    # So slow that it lies on its surface as far as that is known.
    lies = there & (jnp.abs(rate) <= jnp.sqrt(rtol))
    rest = -value / jnp.where(rate == 0.0, 1.0, rate)
    turned = 0.5 * bend * rest * rest
    # Where it is known how a gap bends, one step leads onto it from farther away.
    root = jnp.sqrt(rtol)
    close = known & (rate < 0.0) & (jnp.abs(value) <= _NEAR * root) & (jnp.abs(rest) <= root * pace)
    close = close & (jnp.abs(turned) <= 0.2 * _NEAR * rtol)
    near = (there & (lies | (rate != 0.0))) | close
    rest = jnp.where(lies, 0.0, rest - turned / jnp.where(rate == 0.0, 1.0, rate))
    return OntoSurface(live & near, rest)
