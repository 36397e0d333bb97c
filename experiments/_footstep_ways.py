"""Ways to differentiate a footstep of the walker: ours, and what other tools' users would write.

Plain diffrax and equal steps in JAX are differentiated through the steps taken; CasADi's CVODES
where it is installed; and differences of SciPy's solves. An event, or the step taken, ends each
where leg 1 is upright. The truth is by collocation on one smooth piece of the laws at a time
(`reference/footstep.py`), which shares nothing with ours.
"""

import functools
from collections.abc import Callable
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from _casadi import by_cvodes
from _gradient_ways import (
    KVAERNO5,
    TOLERANCES,
    Answer,
    Run,
    Way,
    differentiate,
    diffrax_solution,
    relative_error,
    with_estimate,
)
from reference.compliant import numbers
from reference.footstep import LAWS, PARAMETERS, UPRIGHT, Footstep, footstep
from reference.footstep import MID_STANCE as START
from reference.scipy_solves import solution

import jaxbiped as jb

OUTPUTS = ("time", "hip_x", "hip_z", "theta_2", "hip_vx", "hip_vz", "omega_1", "omega_2")
"""Of a footstep, at whose end leg 1 is upright."""
INPUTS = ("hip_z", "theta_1", "theta_2", "hip_vx", "hip_vz", "omega_1", "omega_2", *PARAMETERS)
"""What they are differentiated with respect to: the start, and logarithms of parameters."""
LONGEST = 1.0
"""No footstep takes as long [s]."""
DIFFERENCES = (1e-4, 1e-5, 1e-6, 1e-7)
"""Of the start [SI], and of logarithms of parameters."""
TIME_STEPS = (1e-4, 1e-5, 1e-6)


def answer_of(found: Footstep) -> Answer:
    """Outputs and their derivatives."""
    rows = np.vstack([found.time_gradient, np.delete(found.gradient, UPRIGHT, 0)])[:, 1:]
    return Answer(np.append(found.time, np.delete(found.state, UPRIGHT)), rows)


def references() -> tuple[Answer, float, float]:
    """The truth, its change by coarser collocation, and its difference to our finest solve."""
    fine, coarse = (answer_of(footstep(stages=s, resolution=r)) for s, r in ((9, 1e-10), (7, 1e-9)))
    ours = _linearised(1e-11)
    apart = (relative_error(each.gradient, fine.gradient) for each in (coarse, ours))
    return fine, *apart


def ours(truth: Answer, rtol: float) -> Run:
    """Tolerances as named accuracies have them, witnesses as walks with a number for accuracy."""
    return with_estimate(_linearised, rtol)


def _linearised(rtol: float, *, solver: str = "rodas4") -> Answer:
    found = jb.gait.linearise_return_map(
        jb.seed_scene(),
        jb.State(*map(jnp.asarray, START)),
        rtol=rtol,
        tangent_rtol=10.0 * rtol,
        parameters=PARAMETERS,
        solver=solver,
        engine="lanes",
        max_solver_steps=1 << 20,
    )
    if int(found.code) != 0:
        raise RuntimeError(f"no footstep at rtol = {rtol:g}: code {int(found.code)}")
    # The legs are renamed at its end.
    state, rows = np.asarray(found.recurring), np.asarray(found.jacobian)
    own = [0, 1, 3, 4, 6, 5]
    return Answer(
        np.concatenate([[found.period], np.ravel(found.advance), state[own]]),
        np.vstack([found.period_row, np.ravel(found.advance_rows), rows[own]]),
    )


def rates(scene: jb.Scene, y: jax.Array) -> jax.Array:
    """Rates of the eight numbers of the state."""
    return jnp.stack(jb.dynamics.vector_field(0.0, jb.State(*y), scene))


def by_diffrax(solver: diffrax.AbstractSolver, _: Answer, rtol: float) -> Run:
    """Its own event ends the solve, whose time it differentiates by the implicit function."""

    def follow(scene: jb.Scene, start: jax.Array) -> tuple[jax.Array, jax.Array]:
        upright = lambda t, y, args, **kwargs: y[UPRIGHT]  # noqa: E731
        event = diffrax.Event(upright, optx.Newton(1e-12, 1e-12), direction=False)
        field = lambda t, y, args: rates(args, y)  # noqa: E731
        found = diffrax_solution(field, solver, rtol, LONGEST, start, scene, event=event)
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

    def outputs(inputs: jax.Array) -> jax.Array:
        start = jnp.asarray(START).at[1:].add(inputs[: len(START) - 1])
        laws = jnp.asarray(LAWS) * jnp.exp(inputs[len(START) - 1 :])
        scene = jb.seed_scene(**dict(zip(PARAMETERS, laws, strict=True)))
        time, end = follow(scene, start)
        return jnp.concatenate([time[None], jnp.delete(end, UPRIGHT)])

    return differentiate(outputs, len(INPUTS))


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
WAYS = (
    Way("jaxbiped", "rtol", (1e-4, 3e-7, 1e-9), ours),
    Way("diffrax Tsit5", "rtol", TOLERANCES, TSIT5),
    Way("diffrax Kvaerno5", "rtol", TOLERANCES, KVAERNO),
    Way("semi-implicit Euler in JAX", "dt", TIME_STEPS, by_semi_implicit_euler),
    Way("CasADi CVODES", "rtol", TOLERANCES, by_cvodes, "casadi"),
    Way("differences of SciPy's LSODA", "rtol", (*TOLERANCES, 1e-10), LSODA),
    Way("differences of SciPy's Radau", "rtol", TOLERANCES, RADAU),
)
