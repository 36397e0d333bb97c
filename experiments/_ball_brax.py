"""Brax on the bouncing ball: its generalized pipeline, whose contact is a constraint like MuJoCo's.

Its other two pipelines have contacts without stiffness: an impulse of one step. While it acts, the
constraint cancels gravity: that ball has a truth of its own, in the same closed form.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
from _ball_closed_form import Problem
from _ball_mjcf import IMPEDANCE, RADIUS, ball_model
from _ball_ways import differentiate
from _gradient_ways import Run


def brax_law(problem: Problem) -> Problem | None:
    """The ball as Brax's constraint has it, or None where a damper makes it let go elsewhere."""
    if problem.c != 0.0:
        return None
    return dataclasses.replace(problem, weight_in_contact=0.0)


def by_brax(problem: Problem, dt: float) -> Run:
    """Its step, gravity and solref differentiated forwards."""
    from brax.generalized import pipeline
    from brax.io import mjcf

    system = mjcf.loads(ball_model(dt, contact='friction="0 0 0" condim="3"'))

    def final(problem: Problem, values: dict[str, Any]) -> jax.Array:
        zero = jnp.zeros(())
        solref = jnp.stack([-IMPEDANCE * values["K"], zero])
        own = system.replace(
            gravity=jnp.stack([zero, zero, -values["g"]]),
            geom_solref=jnp.broadcast_to(solref, (2, 2)),
        )
        begin = pipeline.init(own, values["height"][None] + RADIUS, jnp.zeros(1))
        steps = round(problem.duration / dt)
        still = jnp.zeros(0)
        end = jax.lax.fori_loop(0, steps, lambda _, each: pipeline.step(own, each, still), begin)
        return jnp.stack([end.q[0] - RADIUS, end.qd[0]])

    return differentiate(final, problem)
