"""Newton on the bouncing ball: a particle on its ground plane, differentiated by Warp's tape.

As in its own example of a ball. Its damper acts while the ball sinks and lets go as it rises: that
ball has a truth of its own, in the same closed form. All its numbers are of 32 bits.
"""

import dataclasses
import itertools
from typing import Any

import numpy as np
from _ball_closed_form import Problem
from _gradient_ways import Answer, Run

TIME_STEPS = (1e-3, 3e-4)
"""Finer ones take minutes: each step is several launches and a state of its own."""


def newton_law(problem: Problem) -> Problem:
    """The ball as Newton's contact has it."""
    return dataclasses.replace(problem, damps_rebound=problem.c == 0.0)


def by_newton(problem: Problem, dt: float) -> Run:
    """Its semi-implicit solver through one tape for each number of the state."""
    import newton
    import warp as wp

    wp.config.quiet = True
    model, contacts = _ball(newton, problem)
    solver = newton.solvers.SolverSemiImplicit(model)
    states = [model.state() for _ in range(round(problem.duration / dt) + 1)]
    values = {name: getattr(problem, name) for name in problem.parameters}

    def row(component: str) -> tuple[list[float], list[float]]:
        with wp.Tape() as tape:
            for before, after in itertools.pairwise(states):
                before.clear_forces()
                solver.step(before, after, None, contacts, dt)
        seed = wp.array([[0.0, 0.0, 1.0]], dtype=wp.vec3, device="cpu")
        tape.backward(grads={getattr(states[-1], component): seed})
        # The floor's stiffness and damping are means of the particle's and the plane's.
        found = {
            "height": states[0].particle_q.grad.numpy()[0, 2],
            "g": -np.sum(model.gravity.grad.numpy()[:, 2]),
            "K": 2.0 * model.shape_material_ke.grad.numpy()[0],
            "c": 2.0 * model.shape_material_kd.grad.numpy()[0],
        }
        end = [each.numpy()[0, 2] for each in (states[-1].particle_q, states[-1].particle_qd)]
        slopes = [values[name] * float(found[name]) for name in values]
        tape.zero()
        return [float(value) for value in end], slopes

    def run() -> Answer:
        (state, first), (_, second) = row("particle_q"), row("particle_qd")
        return Answer(state, [first, second])

    return run


def _ball(newton: Any, problem: Problem) -> tuple[Any, Any]:
    """The model and its contacts, which a plane that stays need only find once."""
    scene = newton.ModelBuilder(up_axis=newton.Axis.Z, gravity=(0.0, 0.0, -problem.g))
    scene.add_particle(pos=(0.0, 0.0, problem.height), vel=(0.0, 0.0, 0.0), mass=1.0, radius=0.0)
    laws = dict(ke=problem.K, kd=problem.c, kf=0.0, mu=0.0)
    scene.add_ground_plane(cfg=newton.ModelBuilder.ShapeConfig(**laws))
    model = scene.finalize(device="cpu", requires_grad=True)
    model.soft_contact_ke, model.soft_contact_kd = problem.K, problem.c
    model.soft_contact_kf = model.soft_contact_mu = 0.0
    pipeline = newton.CollisionPipeline(
        model, broad_phase="explicit", soft_contact_gap=10.0, requires_grad=True
    )
    contacts = pipeline.contacts()
    pipeline.collide(model.state(), contacts)
    return model, contacts
