"""Ends of a solve: its first and last step, and controllers that end it at a footstep or event."""

from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Numbers, RealScalarLike, Scalar
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._contacts import feet
from jaxbiped.dynamics._footfalls import any_of, landings, standing_leg
from jaxbiped.solve._ending_surfaces import ending_surface
from jaxbiped.solve._failure_events import ending_events
from jaxbiped.solve._fusion_barrier import fusion_barrier
from jaxbiped.solve.controllers._wrapped_control import (
    AbstractMemorylessControl,
    AbstractWrappedControl,
    Adapted,
    Attempt,
    try_again,
)

PATIENCE = 100.0
"""Time allowed for each footstep asked for [s]."""
_FIRST_STEP = 1e-5
"""First step tried, in units of time; a start that is not a number must not choose it."""
_CLIPPED_ULPS = 100
"""A step that would end this near the end, in units in the last place, ends there."""
_OVERSHOOT = 1e-9
"""Part of the way to an event that the last step may go past it."""
_MARGIN = 1e-12
"""Time that it may do besides [s]: on which side it ends must be beyond doubt."""


def first_step(duration: Numbers, time_unit: RealScalarLike = 1.0) -> Scalar:
    """The first step to try [s] in a solve of at most `duration` [s]."""
    return jnp.minimum(jnp.full_like(duration, _FIRST_STEP) * time_unit, duration)


@cached_jit  # many small operations
def just_before_end(duration: Numbers) -> Scalar:
    """The time such that a step that would end at or after it ends at `duration`, as in diffrax.

    Units are counted in the bits of the 64-bit number, which have the numbers' own order: the same
    count of steps to the preceding number would take XLA seconds to compile.
    """
    bits = jax.lax.bitcast_convert_type(duration, jnp.int64)
    below = jnp.where(duration > 0.0, bits - _CLIPPED_ULPS, bits + _CLIPPED_ULPS)
    # Numbers below the least normal one count for none.
    nothing = -np.finfo(np.float64).tiny * (1.0 + (_CLIPPED_ULPS - 1) * np.finfo(np.float64).eps)
    earlier = jax.lax.bitcast_convert_type(below, jnp.float64)
    return jnp.where(duration == 0.0, nothing, earlier)


def clip_step(
    keep: Scalar, t: Scalar, next_t: Scalar, end: Numbers, almost_end: Numbers
) -> tuple[Scalar, Scalar]:
    """The times at which the next step begins and ends, when it comes near `end`."""
    t = jnp.minimum(t, end)
    last = jnp.where(keep, end, t + 0.5 * (end - t))
    return t, jnp.where(next_t > almost_end, last, next_t)


class FootstepLimit(AbstractWrappedControl):
    """Wraps a controller; ends the solve at the end of the step with the last heel strike.

    Its state carries what cannot be computed from the walker's state: the leg that struck last, and
    the number of strikes. The solve's `args` must be the scene.

    Attributes:
        limit: number of heel strikes after which the solve ends.
    """

    limit: RealScalarLike

    def init(self, *request: Any) -> tuple[Scalar, Any]:
        first, inner = self.controller.init(*request)
        _, _, _, y0, _, args, *_ = request
        last = standing_leg(args.mechanism.structure, feet(args, y0))
        return first, (inner, last, jnp.zeros_like(last))

    def adapt(self, attempt: Attempt) -> Adapted:
        inner, last, count = attempt.memory
        adapted = attempt.by(self.controller, memory=inner)
        structure = attempt.args.mechanism.structure
        before, after = feet(attempt.args, attempt.y0), feet(attempt.args, attempt.y1)
        lands = landings(structure, before, after)
        # Of several legs another one made the strike before; a single leg hops.
        strikes = [
            adapted.keep & landed & (last != leg if len(lands) > 1 else True)
            for leg, landed in enumerate(lands, 1)
        ]
        for leg, strike in reversed(list(enumerate(strikes, 1))):
            last = jnp.where(strike, leg, last)
        count = count + jnp.where(any_of(strikes), 1, 0)
        successful = diffrax.RESULTS.successful
        done = diffrax.RESULTS.where(
            count >= self.limit, diffrax.RESULTS.event_occurred, successful
        )
        result = diffrax.RESULTS.where(adapted.result == successful, done, adapted.result)
        return adapted._replace(memory=(adapted.memory, last, count), result=result)


class LocatedEnding(AbstractMemorylessControl):
    """Wraps a controller; a step in which the solve ends is retried up to just past that point.

    The point is located with the secant of the ending's surface, in a few attempts. A step whose
    ends are not on opposite sides of the surface stays as it is. After the last footstep, the
    wrapped controller ends the solve. The solve's `args` must be the scene.

    Attributes:
        watch: failures that end the solve.
        probe: a state near the step's end at which failures are looked for first, if that costs
            less; None if there is no such state.
    """

    watch: tuple[str, ...] = eqx.field(static=True)
    probe: PyTree = None

    def adapt(self, attempt: Attempt) -> Adapted:
        adapted = attempt.by(self.controller)
        scene, y1, t1 = attempt.args, attempt.y1, attempt.t1
        start, span = jnp.asarray(attempt.t0), jnp.asarray(t1 - attempt.t0)
        walked = jnp.asarray(adapted.result != diffrax.RESULTS.successful)
        probe = y1 if self.probe is None else self.probe
        failures = {
            name: happens
            for name, happens in ending_events(self.watch).items()
            if name != Ending.SOLVER_FAILED
        }
        ends = adapted.keep & walked
        for happens in failures.values():
            ends = ends | (adapted.keep & jnp.asarray(happens(t1, probe, scene)))

        def part_before() -> Scalar:
            code = jnp.asarray(int(Ending.WALKING))
            for name, happens in failures.items():
                code = jnp.where(happens(t1, y1, scene), int(name), code)
            before, after = (ending_surface(code, scene, y1, y) for y in (attempt.y0, y1))
            crossed = (before < 0.0) & (after > 0.0)
            crossed = crossed & (walked | (code != int(Ending.WALKING)))
            return jnp.where(crossed, before / jnp.where(crossed, before - after, 1.0), 1.0)

        way = span * jnp.where(ends, fusion_barrier(ends, part_before), 1.0)
        again = ends & (span - way > jnp.maximum(_OVERSHOOT * way, 4.0 * _MARGIN))
        target = start + way * (1.0 + 0.5 * _OVERSHOOT) + _MARGIN
        possible = (target > start) & (target < start + span)
        again, target = jax.lax.stop_gradient((again & possible, target))
        result = diffrax.RESULTS.where(again, diffrax.RESULTS.successful, adapted.result)
        return try_again(attempt, adapted, again, target)._replace(result=result)
