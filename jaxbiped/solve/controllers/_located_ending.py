"""Located ending: a step-size controller that ends a solve at the event, not a step past it."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Scalar
from jaxbiped.solve._ending_surfaces import ending_surface
from jaxbiped.solve._failure_events import ending_events
from jaxbiped.solve._fusion_barrier import fusion_barrier
from jaxbiped.solve.controllers._wrapped_control import (
    AbstractMemorylessControl,
    Adapted,
    Attempt,
    try_again,
)

_OVERSHOOT = 1e-9
"""Part of the way to an event that the last step may go past it."""
_MARGIN = 1e-12
"""Time that it may do besides [s]: on which side it ends must be beyond doubt."""


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
