"""Other ways to differentiate a footstep, as their users would write these.

Plain diffrax and equal steps in JAX are differentiated through the steps taken; SciPy's solves by
differences. An event, or the step taken, ends each where leg 1 is upright.
"""

import functools
from collections.abc import Callable
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from _ball_ways import KVAERNO5
from _casadi import by_cvodes
from _footstep_ways import INPUTS, UPRIGHT
from _gradient_ways import Answer, Run, Way, relative_error
from reference.compliant import numbers
from reference.footstep import LAWS, PARAMETERS
from reference.footstep import MID_STANCE as START
from reference.scipy_solves import solution

import jaxbiped as jb

LONGEST = 1.0
"""No footstep takes as long [s]."""
MOST_STEPS = 1 << 18
DIFFERENCES = (1e-4, 1e-5, 1e-6, 1e-7)
"""Of the start [SI], and of logarithms of parameters."""
TOLERANCES, TIME_STEPS = (1e-4, 1e-6, 1e-8), (1e-4, 1e-5, 1e-6)


def rates(scene: jb.Scene, y: jax.Array) -> jax.Array:
    """Rates of the eight numbers of the state."""
    return jnp.stack(jb.dynamics.vector_field(0.0, jb.State(*y), scene))


def by_diffrax(solver: diffrax.AbstractSolver, _: Answer, rtol: float) -> Run:
    """Its own event ends the solve, whose time it differentiates by the implicit function."""

    def follow(scene: jb.Scene, start: jax.Array) -> tuple[jax.Array, jax.Array]:
        upright = lambda t, y, args, **kwargs: y[UPRIGHT]  # noqa: E731
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
            event=diffrax.Event(upright, optx.Newton(1e-12, 1e-12), direction=False),
            max_steps=MOST_STEPS,
        )
        return found.ts[-1], found.ys[-1]

    return _compiled(follow)


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


def _compiled(follow: Callable[[jb.Scene, jax.Array], tuple[jax.Array, jax.Array]]) -> Run:
    """Time and state where leg 1 is upright, with their forward derivatives, by one program."""

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


def by_differences(method: str, truth: Answer, rtol: float) -> Run:
    """Central differences of a method's solves, by the best of four steps: the truth chooses it."""

    def differences(step: float) -> Answer:
        columns = []
        for name in INPUTS:
            up, down = (_end(method, name, sign * step, rtol) for sign in (1.0, -1.0))
            columns.append((up - down) / (2.0 * step))
        ends, at = _end(method, INPUTS[0], 0.0, rtol), UPRIGHT + 1
        return Answer(np.delete(ends, at), np.delete(np.stack(columns, axis=1), at, 0))

    best = min(DIFFERENCES, key=lambda h: relative_error(differences(h).gradient, truth.gradient))
    return lambda: differences(best)


def _end(method: str, name: str, change: float, rtol: float) -> np.ndarray:
    """Time and state at the footstep's end, one input changed."""
    start, laws = START.copy(), LAWS.copy()
    if name in PARAMETERS:
        laws[PARAMETERS.index(name)] *= np.exp(change)
    else:
        start[1 + INPUTS.index(name)] += change
    moved = numbers(**dict(zip(PARAMETERS, laws, strict=True)))

    def upright(t: float, y: np.ndarray, *_: Any) -> float:
        return y[UPRIGHT]

    upright.terminal, upright.direction = True, -1.0  # type: ignore[attr-defined]
    found = solution(LONGEST, rtol, method=method, start=start, p=moved, events=upright)
    return np.append(found.t[-1], found.y[:, -1])


TSIT5, KVAERNO = (functools.partial(by_diffrax, each) for each in (diffrax.Tsit5(), KVAERNO5))
LSODA, RADAU = (functools.partial(by_differences, method) for method in ("LSODA", "Radau"))
PEERS = (
    Way("diffrax Tsit5", "rtol", TOLERANCES, TSIT5),
    Way("diffrax Kvaerno5", "rtol", TOLERANCES, KVAERNO),
    Way("semi-implicit Euler in JAX", "dt", TIME_STEPS, by_semi_implicit_euler),
    Way("CasADi CVODES", "rtol", TOLERANCES, by_cvodes, "casadi"),
    Way("differences of SciPy's LSODA", "rtol", (*TOLERANCES, 1e-10), LSODA),
    Way("differences of SciPy's Radau", "rtol", TOLERANCES, RADAU),
)
