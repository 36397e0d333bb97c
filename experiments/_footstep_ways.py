"""Ways to differentiate a footstep: ours, and what other tools do with the same equations.

All but ours give the state and its derivatives at the time at which the truth's footstep ends, and
are then projected on the section alike.
"""

from collections.abc import Callable
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from _ball_ways import KVAERNO, Answer, Run, relative_error
from _footstep_collocation import Footstep, footstep
from _footstep_equations import LAWS, PARAMETERS, START, rates_of

import jaxbiped as jb

OUTPUTS = ("time", "hip_x", "hip_z", "theta_2", "hip_vx", "hip_vz", "omega_1", "omega_2")
"""Of a footstep, at whose end leg 1 is upright."""
INPUTS = ("hip_z", "theta_1", "theta_2", "hip_vx", "hip_vz", "omega_1", "omega_2", *PARAMETERS)
"""What they are differentiated with respect to: the start, and logarithms of parameters."""
UPRIGHT = 2
"""θ1 among the state's numbers."""
STEP, LAW_STEP = 1e-4, 3e-3
"""Of differences by the start (in its own sizes, at least 0.1) and by the laws' logarithms."""


def answer_of(found: Footstep) -> Answer:
    """Outputs and their derivatives."""
    rows = np.vstack([found.time_gradient, np.delete(found.gradient, UPRIGHT, 0)])[:, 1:]
    return Answer(np.append(found.time, np.delete(found.state, UPRIGHT)), rows)


def references() -> tuple[Answer, float, float]:
    """The truth, its change by coarser collocation, and its difference to our finest solve."""
    fine, coarse = (answer_of(footstep(stages=s, resolution=r)) for s, r in ((9, 1e-10), (7, 1e-9)))
    ours = _linearised(1e-11, 1e-10)
    apart = (relative_error(each.gradient, fine.gradient) for each in (coarse, ours))
    return fine, *apart


def ours(truth: Answer, rtol: float) -> Run:
    """Tolerances as named accuracies have them; the error is that to a ten times looser solve."""

    def run() -> Answer:
        fine, loose = (_linearised(each, 10.0 * each) for each in (rtol, 10.0 * rtol))
        return fine._replace(said=relative_error(loose.gradient, fine.gradient))

    return run


def _linearised(rtol: float, tangent_rtol: float) -> Answer:
    found = jb.gait.linearise_return_map(
        jb.seed_scene(),
        jb.State(*map(jnp.asarray, START)),
        rtol=rtol,
        tangent_rtol=tangent_rtol,
        parameters=PARAMETERS,
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


def _projected(truth: Answer, state: Any, tangents: Any) -> Answer:
    """A footstep from state (8,) and tangents (8, 11) at about its end."""
    state, tangents = np.asarray(state), np.asarray(tangents)
    velocity = rates_of(state, LAWS)
    late = -state[UPRIGHT] / velocity[UPRIGHT]
    later = -tangents[UPRIGHT] / velocity[UPRIGHT]
    ends, rows = state + velocity * late, tangents + np.outer(velocity, later)
    return Answer(
        np.append(truth.state[0] + late, np.delete(ends, UPRIGHT)),
        np.vstack([later, np.delete(rows, UPRIGHT, 0)]),
    )


def _forwards(truth: Answer, final: Callable[[jb.Scene, jb.State], jb.State]) -> Run:
    """A function of scene and start with its forward-mode derivatives, compiled once."""
    scene, kept = jb.seed_scene(), {"mu_static": LAWS[2], "mu_kinetic": LAWS[3]}

    def of(inputs: jax.Array) -> jax.Array:
        factors = jnp.exp(inputs[7:])
        values = {"K": LAWS[0], "c": LAWS[1], **kept}
        changed = {name: values[name] * factors[k] for k, name in enumerate(PARAMETERS)}
        moved = jb.with_parameters(scene, changed)
        start = jb.State(jnp.zeros(()), *inputs[:7])
        return jnp.stack(final(moved, start))

    point = jnp.concatenate([jnp.asarray(START[1:]), jnp.zeros(4)])
    both = jax.jit(lambda inputs: (of(inputs), jax.jacfwd(of)(inputs)))
    return lambda: _projected(truth, *jax.block_until_ready(both(point)))


def by_diffrax(truth: Answer, rtol: float) -> Run:
    """Kvaerno5, differentiated forwards through the steps that it takes."""

    def final(scene: jb.Scene, start: jb.State) -> jb.State:
        return jax.tree.map(
            lambda leaf: leaf[-1],
            diffrax.diffeqsolve(
                diffrax.ODETerm(jb.dynamics.vector_field),
                KVAERNO,
                0.0,
                truth.state[0],
                1e-6,
                start,
                args=scene,
                stepsize_controller=diffrax.PIDController(rtol=rtol, atol=1e-2 * rtol),
                adjoint=diffrax.ForwardMode(),
                saveat=diffrax.SaveAt(t1=True),
                max_steps=100_000,
            ).ys,
        )

    return _forwards(truth, final)


def by_semi_implicit_euler(truth: Answer, dt: float) -> Run:
    """Velocities first, in equal steps of about dt, differentiated forwards."""
    steps = round(truth.state[0] / dt)
    own, half = truth.state[0] / steps, len(jb.State._fields) // 2

    def final(scene: jb.Scene, start: jb.State) -> jb.State:
        def step(_: Any, y: jb.State) -> jb.State:
            rates = jb.dynamics.vector_field(0.0, y, scene)
            speeds = [v + own * a for v, a in zip(y[half:], rates[half:], strict=True)]
            places = [q + own * v for q, v in zip(y[:half], speeds, strict=True)]
            return jb.State(*places, *speeds)

        return jax.lax.fori_loop(0, steps, step, start)

    return _forwards(truth, final)


def by_differences(truth: Answer, rtol: float) -> Run:
    """SciPy's Radau, and differences of fourth order."""
    from scipy.integrate import solve_ivp

    def final(start: np.ndarray, logarithms: np.ndarray) -> np.ndarray:
        laws = LAWS * np.exp(logarithms)
        how: dict[str, Any] = dict(method="Radau", rtol=rtol, atol=1e-2 * rtol)
        with np.errstate(over="ignore"):
            found = solve_ivp(lambda t, y: rates_of(y, laws), (0.0, truth.state[0]), start, **how)
        return found.y[:, -1]

    def run() -> Answer:
        columns = []
        for k in range(1, 12):
            h = STEP * max(abs(START[k]), 0.1) if k < 8 else LAW_STEP

            def at(times: float, k: int = k, h: float = h) -> np.ndarray:
                start, logarithms = START.copy(), np.zeros(4)
                (start if k < 8 else logarithms)[k if k < 8 else k - 8] += times * h
                return final(start, logarithms)

            columns.append((8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * h))
        return _projected(truth, final(START, np.zeros(4)), np.stack(columns, axis=1))

    return run


WAYS: tuple[tuple[str, str, tuple[float, ...], Callable[[Answer, float], Run]], ...] = (
    ("jaxbiped", "rtol", (1e-4, 3e-7, 1e-9), ours),
    ("diffrax Kvaerno5", "rtol", (1e-4, 1e-6, 1e-8), by_diffrax),
    ("SciPy Radau, differences", "rtol", (1e-6, 1e-8, 1e-10), by_differences),
    ("semi-implicit Euler in JAX", "dt", (1e-5, 3e-6, 1e-6), by_semi_implicit_euler),
)
"""Name, what is varied, its values from rough to fine, and the way."""
