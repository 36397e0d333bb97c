"""Ways to differentiate a bouncing ball: ours, and what other tools do with the same equations.

Each way prepares a function that gives the state at the end, its derivatives with respect to the
logarithms of the parameters, and what it says about their error (None where it says nothing).
"""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from _ball_closed_form import Problem

import jaxbiped as jb


class Answer(NamedTuple):
    """What a way says.

    Attributes:
        state: height [m] and velocity [m/s].
        gradient: two rows, with respect to the logarithm of each parameter.
        said: its own estimate of the gradient's error, as `relative_error` measures; or None.
    """

    state: Any
    gradient: Any
    said: float | None = None


def relative_error(rows: Any, truth: Any) -> float:
    """Largest difference of two gradients, relative to the largest entry of each row."""
    rows, truth = np.asarray(rows), np.asarray(truth)
    return float(np.max(np.abs(rows - truth) / np.max(np.abs(truth), axis=1, keepdims=True)))


Run = Callable[[], Answer]


class Ball(NamedTuple):
    """Parameters of the ball, and when its state is asked for."""

    g: Any
    K: Any
    c: Any
    duration: Any


def force(z: Any, v: Any, K: Any, c: Any) -> Any:
    """Force of the floor [N]."""
    return jnp.where(z < 0.0, jnp.maximum(0.0, -K * z - c * v), 0.0)


class Bouncing(jb.gait.AbstractSystem):
    """The ball and a clock, (z, v, t): touchdown and release are its switches."""

    damped: bool = eqx.field(static=True, default=False)

    def vector_field(self, t: Any, y: Any, args: Ball) -> Any:
        """Gravity and the floor's force."""
        z, v, clock = y
        return v, force(z, v, args.K, args.c) - args.g, jnp.ones_like(clock)

    def switches(self, args: Ball, y: Any) -> tuple[jb.dynamics.Switch, ...]:
        """Touchdown, where damping makes the force jump, and the floor's force leaving zero."""
        z, v, _ = y
        touchdown = jb.dynamics.Switch(-z, True, force_jumps=self.damped)
        if not self.damped:
            return (touchdown,)
        return touchdown, jb.dynamics.Switch(-args.K * z - args.c * v, z < 0.0)

    def ending(self, args: Ball, y: Any) -> Any:
        """It never ends early."""
        return jnp.asarray(0)

    def reset_map(self, args: Ball, y: Any) -> Any:
        """Nothing happens when the time has come."""
        return y

    def load(self, args: Ball, y: Any) -> None:
        """No largest load is asked for."""
        return None


class Deadline(jb.dynamics.AbstractSection):
    """The clock passes the duration."""

    def value(self, args: Ball, y: Any) -> Any:
        """Time past the duration [s]."""
        return y[2] - args.duration

    def counts(self, args: Ball, y: Any) -> Any:
        """Always."""
        return jnp.asarray(True)


def with_estimate(fine: Answer, *, loose: Answer, other: Answer) -> Answer:
    """An answer that says the changes of its gradient by two witnesses together.

    `loose` is by a ten times looser tolerance; `other` by another method, and counts twice. A sum,
    as in the bars of gaits: either may agree by chance.
    """
    first, second = (relative_error(each.gradient, fine.gradient) for each in (loose, other))
    return fine._replace(said=first + 2.0 * second)


def ours(problem: Problem, rtol: float) -> Run:
    """Steps end at switches, tangents are in the norm; the error is told by two more solves."""

    def run() -> Answer:
        fine, loose = (_linearised(problem, each) for each in (rtol, 10.0 * rtol))
        other = _linearised(problem, rtol, solver="rodas5p")
        return with_estimate(fine, loose=loose, other=other)

    return run


def _linearised(problem: Problem, rtol: float, *, solver: str = "rodas4") -> Answer:
    start = tuple(jnp.asarray(value) for value in (problem.height, 0.0, 0.0))
    names = problem.parameters[1:]
    found = jb.gait.linearise_return_map(
        Ball(problem.g, problem.K, problem.c, problem.duration),
        start,
        rtol=rtol,
        tangent_rtol=rtol,
        parameters=names,
        section=Deadline(),
        system=Bouncing(damped=problem.c != 0.0),
        solver=solver,
        engine="lanes",
    )
    jacobian = np.asarray(found.jacobian)[:2]
    by_height = problem.height * jacobian[:, :1]
    return Answer(found.recurring[:2], np.hstack([by_height, jacobian[:, 3:]]))


def _numbers(problem: Problem) -> jax.Array:
    return jnp.asarray([getattr(problem, name) for name in problem.parameters])


def differentiate(final: Callable[[Problem, Any], jax.Array], problem: Problem) -> Run:
    """A function of the parameters with its forward-mode derivatives, compiled once."""

    def of_logarithms(logarithms: jax.Array) -> jax.Array:
        values = _numbers(problem) * jnp.exp(logarithms)
        return final(problem, dict(zip(problem.parameters, values, strict=True)))

    def both(logarithms: jax.Array) -> tuple[jax.Array, jax.Array]:
        return of_logarithms(logarithms), jax.jacfwd(of_logarithms)(logarithms)

    compiled, zeros = jax.jit(both), jnp.zeros(len(problem.parameters))
    return lambda: Answer(*jax.block_until_ready(compiled(zeros)))


def by_diffrax(problem: Problem, solver: diffrax.AbstractSolver, rtol: float) -> Run:
    """The same equations through diffrax as a user would write it."""

    def final(problem: Problem, values: dict[str, Any]) -> jax.Array:
        K, c, g = values["K"], values.get("c", 0.0), values["g"]

        def field(t: Any, y: jax.Array, args: None) -> jax.Array:
            return jnp.stack([y[1], force(y[0], y[1], K, c) - g])

        return diffrax.diffeqsolve(
            diffrax.ODETerm(field),
            solver,
            0.0,
            problem.duration,
            None,
            jnp.stack([values["height"], jnp.zeros(())]),
            stepsize_controller=diffrax.PIDController(rtol=rtol, atol=1e-2 * rtol),
            adjoint=diffrax.ForwardMode(),
            saveat=diffrax.SaveAt(t1=True),
            max_steps=100_000,
        ).ys[0]

    return differentiate(final, problem)


def by_semi_implicit_euler(problem: Problem, dt: float) -> Run:
    """The step that most differentiable simulators take, of one size."""

    def final(problem: Problem, values: dict[str, Any]) -> jax.Array:
        K, c, g = values["K"], values.get("c", 0.0), values["g"]

        def step(_: Any, y: Any) -> Any:
            z, v = y
            v = v + dt * (force(z, v, K, c) - g)
            return z + dt * v, v

        begin = values["height"], jnp.zeros(())
        return jnp.stack(jax.lax.fori_loop(0, round(problem.duration / dt), step, begin))

    return differentiate(final, problem)


KVAERNO = diffrax.Kvaerno5(
    root_finder=diffrax.with_stepsize_controller_tols(optx.Chord)(),
)


@dataclasses.dataclass(frozen=True)
class Way:
    """A tool and the settings at which it is asked.

    Attributes:
        name: a word for it.
        setting: what is varied.
        settings: its values, from rough to fine.
        prepare: makes ready what answers a problem at a setting.
        module: what must be installed beside this project's own requirements; "" for nothing.
        law: the problem that it solves, where its contact is not the problem's own.
    """

    name: str
    setting: str
    settings: tuple[float, ...]
    prepare: Callable[[Problem, float], Run]
    module: str = ""
    law: Callable[[Problem], Problem | None] = lambda problem: problem


TOLERANCES, TIME_STEPS = (1e-4, 1e-6, 1e-8), (1e-3, 1e-4, 1e-5)
OUR_WAYS = (
    Way("jaxbiped", "rtol", TOLERANCES, ours),
    Way("diffrax Tsit5", "rtol", TOLERANCES, lambda p, s: by_diffrax(p, diffrax.Tsit5(), s)),
    Way("diffrax Kvaerno5", "rtol", TOLERANCES, lambda p, s: by_diffrax(p, KVAERNO, s)),
    Way("semi-implicit Euler in JAX", "dt", TIME_STEPS, by_semi_implicit_euler),
)
