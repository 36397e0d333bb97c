"""Ways to differentiate a bouncing ball: ours, and what other tools do with the same equations."""

from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from _ball_closed_form import Problem
from _gradient_ways import (
    KVAERNO5,
    TOLERANCES,
    Answer,
    Run,
    Way,
    differentiate,
    diffrax_solution,
    with_estimate,
)

import jaxbiped as jb


class Ball(NamedTuple):
    """Parameters of the ball, and when its state is asked for."""

    g: Any
    K: Any
    c: Any
    duration: Any


def force(z: Any, v: Any, K: Any, c: Any) -> Any:
    """Force of the floor [N]."""
    return jnp.where(z < 0.0, jnp.maximum(0.0, -K * z - c * v), 0.0)


class Bouncing(jb.hybrid.AbstractSystem):
    """The ball and a clock, (z, v, t): touchdown and release are its switches."""

    damped: bool = eqx.field(static=True, default=False)

    def vector_field(self, t: Any, y: Any, args: Ball) -> Any:
        """Gravity and the floor's force."""
        z, v, clock = y
        return v, force(z, v, args.K, args.c) - args.g, jnp.ones_like(clock)

    def switches(self, args: Ball, y: Any) -> tuple[jb.hybrid.Switch, ...]:
        """Touchdown, where damping makes the force jump, and the floor's force leaving zero."""
        z, v, _ = y
        touchdown = jb.hybrid.Switch(-z, True, force_jumps=self.damped)
        if not self.damped:
            return (touchdown,)
        return touchdown, jb.hybrid.Switch(-args.K * z - args.c * v, z < 0.0)

    def ending(self, args: Ball, y: Any) -> Any:
        """It never ends early."""
        return jnp.asarray(0)

    def reset_map(self, args: Ball, y: Any) -> Any:
        """Nothing happens when the time has come."""
        return y

    def load(self, args: Ball, y: Any) -> None:
        """No largest load is asked for."""
        return None


DEADLINE = jb.Section(lambda args, y: y[2] - args.duration)
"""The clock passes the duration."""


def ours(problem: Problem, rtol: float) -> Run:
    """Steps end at switches, tangents are in the norm; the error is told by two more solves."""

    def linearised(rtol: float, solver: str = "rodas4") -> Answer:
        start = tuple(jnp.asarray(value) for value in (problem.height, 0.0, 0.0))
        found = jb.gait.linearise_return_map(
            Ball(problem.g, problem.K, problem.c, problem.duration),
            start,
            rtol=rtol,
            tangent_rtol=rtol,
            parameters=problem.parameters[1:],
            section=DEADLINE,
            system=Bouncing(damped=problem.c != 0.0),
            solver=solver,
            engine="lanes",
        )
        jacobian = np.asarray(found.jacobian)[:2]
        by_height = problem.height * jacobian[:, :1]
        return Answer(found.recurring[:2], np.hstack([by_height, jacobian[:, 3:]]))

    return with_estimate(linearised, rtol)


def by_logarithms(problem: Problem, final: Callable[[dict[str, Any]], jax.Array]) -> Run:
    """The end by the values of the parameters, differentiated with respect to their logarithms."""
    numbers = jnp.asarray([getattr(problem, name) for name in problem.parameters])

    def outputs(logarithms: jax.Array) -> jax.Array:
        values = numbers * jnp.exp(logarithms)
        return final(dict(zip(problem.parameters, values, strict=True)))

    return differentiate(outputs, len(numbers))


def by_diffrax(problem: Problem, solver: diffrax.AbstractSolver, rtol: float) -> Run:
    """The same equations through diffrax."""

    def final(values: dict[str, Any]) -> jax.Array:
        K, c, g = values["K"], values.get("c", 0.0), values["g"]

        def field(t: Any, y: jax.Array, args: None) -> jax.Array:
            return jnp.stack([y[1], force(y[0], y[1], K, c) - g])

        start = jnp.stack([values["height"], jnp.zeros(())])
        return diffrax_solution(field, solver, rtol, problem.duration, start).ys[0]

    return by_logarithms(problem, final)


def by_semi_implicit_euler(problem: Problem, dt: float) -> Run:
    """The step that most differentiable simulators take, of one size."""

    def final(values: dict[str, Any]) -> jax.Array:
        K, c, g = values["K"], values.get("c", 0.0), values["g"]

        def step(_: Any, y: Any) -> Any:
            z, v = y
            v = v + dt * (force(z, v, K, c) - g)
            return z + dt * v, v

        begin = values["height"], jnp.zeros(())
        return jnp.stack(jax.lax.fori_loop(0, round(problem.duration / dt), step, begin))

    return by_logarithms(problem, final)


TIME_STEPS = (1e-3, 1e-4, 1e-5)
OUR_WAYS = (
    Way("jaxbiped", "rtol", TOLERANCES, ours),
    Way("diffrax Tsit5", "rtol", TOLERANCES, lambda p, s: by_diffrax(p, diffrax.Tsit5(), s)),
    Way("diffrax Kvaerno5", "rtol", TOLERANCES, lambda p, s: by_diffrax(p, KVAERNO5, s)),
    Way("semi-implicit Euler in JAX", "dt", TIME_STEPS, by_semi_implicit_euler),
)
