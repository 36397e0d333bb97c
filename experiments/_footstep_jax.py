"""A footstep differentiated through the steps taken: plain diffrax, and equal steps in JAX."""

from collections.abc import Callable
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from _footstep_ways import INPUTS, UPRIGHT
from _gradient_ways import Answer, Run
from reference.footstep import LAWS, PARAMETERS
from reference.footstep import MID_STANCE as START

import jaxbiped as jb

LONGEST = 1.0
"""No footstep takes as long [s]."""
MOST_STEPS = 1 << 18
Follow = Callable[[jb.Scene, jax.Array], tuple[jax.Array, jax.Array]]
"""From a scene and a start to the time at which leg 1 is upright, and the state then."""


def by_diffrax(solver: diffrax.AbstractSolver) -> Callable[[Answer, float], Run]:
    """Its own event ends the solve, whose time it differentiates by the implicit function."""

    def prepare(_: Answer, rtol: float) -> Run:
        def follow(scene: jb.Scene, start: jax.Array) -> tuple[jax.Array, jax.Array]:
            event = diffrax.Event(
                lambda t, y, args, **kwargs: y[UPRIGHT],
                optx.Newton(1e-12, 1e-12),
                direction=False,
            )
            found = diffrax.diffeqsolve(
                diffrax.ODETerm(lambda t, y, args: rates(args, y)),
                solver,
                0.0,
                LONGEST,
                None,
                start,
                scene,
                stepsize_controller=diffrax.PIDController(rtol=rtol, atol=1e-2 * rtol),
                adjoint=diffrax.ForwardMode(),
                event=event,
                max_steps=MOST_STEPS,
            )
            return found.ts[-1], found.ys[-1]

        return _compiled(follow)

    return prepare


def by_semi_implicit_euler(_: Answer, dt: float) -> Run:
    """Equal steps until leg 1 has been upright, and a straight line over the last of them."""

    def follow(scene: jb.Scene, start: jax.Array) -> tuple[jax.Array, jax.Array]:
        def step(carry: Any) -> Any:
            steps, _, y = carry
            speeds = y[4:] + dt * rates(scene, y)[4:]
            return steps + 1, y, jnp.concatenate([y[:4] + dt * speeds, speeds])

        def goes_on(carry: Any) -> Any:
            steps, before, after = carry
            passed = (before[UPRIGHT] > 0.0) & (after[UPRIGHT] <= 0.0)
            return ~passed & (steps * dt < LONGEST)

        steps, before, after = jax.lax.while_loop(goes_on, step, (0, start, start))
        share = before[UPRIGHT] / (before[UPRIGHT] - after[UPRIGHT])
        return (steps - 1 + share) * dt, before + share * (after - before)

    return _compiled(follow)


def rates(scene: jb.Scene, y: jax.Array) -> jax.Array:
    """Rates of the eight numbers of the state."""
    return jnp.stack(jb.dynamics.vector_field(0.0, jb.State(*y), scene))


def _compiled(follow: Follow) -> Run:
    """Outputs and their forward derivatives, one program."""

    def outputs(inputs: jax.Array) -> tuple[jax.Array, jax.Array]:
        start = jnp.asarray(START).at[1:].add(inputs[: len(START) - 1])
        laws = jnp.asarray(LAWS) * jnp.exp(inputs[len(START) - 1 :])
        scene = jb.seed_scene(**dict(zip(PARAMETERS, laws, strict=True)))
        time, end = follow(scene, start)
        found = jnp.concatenate([time[None], jnp.delete(end, UPRIGHT)])
        return found, found

    program = jax.jit(jax.jacfwd(outputs, has_aux=True))
    zeros = jnp.zeros(len(INPUTS))

    def run() -> Answer:
        rows, values = program(zeros)
        return Answer(np.asarray(values), np.asarray(rows))

    return run


KVAERNO5 = diffrax.Kvaerno5(root_finder=diffrax.with_stepsize_controller_tols(optx.Chord)())
