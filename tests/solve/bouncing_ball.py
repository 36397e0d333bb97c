"""A ball that bounces, as a landing system, and its solve."""

from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp

from jaxbiped import Ending
from jaxbiped.compiler import BY_NAME, Request
from jaxbiped.hybrid._landing_system import AbstractLandingSystem
from jaxbiped.solve._landing_program import LandingSolve
from jaxbiped.solve._recorders import StrikeRecorder, TimeRecorder, program_of

RECORDERS = {"bounces": StrikeRecorder(), "times": TimeRecorder(), "end": None}


class Height(NamedTuple):
    z: jax.Array
    v: jax.Array


class Drop(NamedTuple):
    """Gravity, the coefficient of restitution, and the height of a ceiling."""

    g: jax.Array
    restitution: jax.Array
    ceiling: jax.Array


class Ball(AbstractLandingSystem):
    """It bounces, which counts as a footstep, until it hits the ceiling."""

    endings: ClassVar[tuple[Ending, ...]] = (Ending.FINISHED,)

    def vector_field(self, t, y, args):
        return Height(y.v, -args.g)

    def switches(self, args, y):
        return ()

    def reset_map(self, args, y):
        return Height(y.z, -args.restitution * y.v)

    def load(self, args, y):
        return None

    def positions(self, args):
        return slice(0, 1)

    def accelerations(self, args, y):
        return (0.0 * y.z - args.g,)

    def time_scale(self, args):
        return jnp.sqrt(1.0 / args.g)

    def arrival_surface(self, args, y):
        return y.z

    def arrival_counts(self, args, y):
        return 1.0 + 0.0 * y.z

    def surface_of_ending(self, args, near):
        return lambda y: args.ceiling - y.z

    def ending_on_surface(self, args, y):
        return jnp.asarray(int(Ending.FINISHED))


def solved(saved, engine, *, restitution=0.5, v=0.0, duration=10.0, **asked):
    """From a height of 1 under a ceiling of 3, with a gravity of 2."""
    args = Drop(*map(jnp.asarray, (2.0, restitution, 3.0)))
    start = Height(jnp.asarray(1.0), jnp.asarray(v))
    how = LandingSolve(system=Ball(), recorder=RECORDERS[saved])
    limits = dict(duration=duration, footsteps=3.0, rtol=1e-9, max_attempts=1000.0)
    inputs = how.inputs(args, start, **{name: jnp.asarray(x) for name, x in limits.items()})
    return BY_NAME[engine].run(Request(program_of(how), inputs, **asked))
