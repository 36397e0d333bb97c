"""Simulators of others on the bouncing ball, where installed: MuJoCo MJX, Brax, Warp and Newton."""

from typing import Any

import numpy as np
from _ball_closed_form import Problem
from _ball_mujoco import IMPEDANCE, by_brax, by_mjx, constrained
from _ball_newton import TIME_STEPS as NEWTON_STEPS
from _ball_newton import by_newton, newton_law
from _ball_ways import TIME_STEPS
from _gradient_ways import Answer, Run, Way


def by_warp(problem: Problem, dt: float) -> Run:
    """Semi-implicit Euler as a Warp kernel, differentiated backwards through its tape."""
    import warp as wp

    wp.config.quiet = True
    kernel, steps = _warp_kernel(wp), round(problem.duration / dt)
    values = {name: getattr(problem, name) for name in ("height", "g", "K", "c")}

    def zeros(count: int) -> Any:
        return wp.zeros(count, dtype=wp.float64, requires_grad=True, device="cpu")

    def row(index: int) -> tuple[list[float], list[float]]:
        held = {name: zeros(1) for name in values}
        for name, value in values.items():
            held[name].fill_(value)
        path = zeros(steps + 1), zeros(steps + 1)
        with wp.Tape() as tape:
            for step in range(-1, steps):
                inputs = [step, wp.float64(dt), *held.values(), *path]
                wp.launch(kernel, dim=1, inputs=inputs, device="cpu")
        seed = np.zeros(steps + 1)
        seed[-1] = 1.0
        tape.backward(grads={path[index]: wp.array(seed, dtype=wp.float64, device="cpu")})
        slopes = [values[name] * held[name].grad.numpy()[0] for name in problem.parameters]
        return [each.numpy()[-1] for each in path], slopes

    def run() -> Answer:
        (state, first), (_, second) = row(0), row(1)
        return Answer(state, [first, second])

    return run


def _warp_kernel(wp: Any) -> Any:
    @wp.kernel
    def step_ball(
        i: int,
        dt: wp.float64,
        height: wp.array(dtype=wp.float64),
        g: wp.array(dtype=wp.float64),
        stiffness: wp.array(dtype=wp.float64),
        damping: wp.array(dtype=wp.float64),
        z: wp.array(dtype=wp.float64),
        v: wp.array(dtype=wp.float64),
    ):
        if i < 0:
            z[0] = height[0]
        else:
            push = wp.float64(0.0)
            if z[i] < wp.float64(0.0):
                push = wp.max(wp.float64(0.0), -stiffness[0] * z[i] - damping[0] * v[i])
            speed = v[i] + dt * (push - g[0])
            v[i + 1] = speed
            z[i + 1] = z[i] + dt * speed

    return step_ball


PEERS = (
    Way("MuJoCo MJX", "dt", TIME_STEPS, by_mjx, "mujoco", constrained(1.0 - IMPEDANCE)),
    Way("Brax", "dt", TIME_STEPS, by_brax, "brax", constrained(0.0)),
    Way("Warp", "dt", TIME_STEPS, by_warp, "warp"),
    Way("Newton", "dt", NEWTON_STEPS, by_newton, "newton", newton_law),
)
