"""Simulators whose contact is MuJoCo's constraint, on the bouncing ball: MJX and Brax.

While they act, MuJoCo's soft constraints cancel the share `IMPEDANCE` of all other forces, and
those of Brax's generalized pipeline all of them: such a ball has a truth of its own, in the same
closed form. Brax's other two pipelines have contacts without stiffness: an impulse of one step.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from _ball_closed_form import Problem
from _ball_ways import differentiate
from _gradient_ways import Run

IMPEDANCE, RADIUS = 0.9999, 0.05
"""Of the constraint, the largest that MuJoCo allows; of the sphere [m]."""
_MODEL = """
<mujoco>
  <option timestep="{dt}" gravity="0 0 -9.81" {solver}iterations="20"/>
  <default>
    <geom solref="-1 -1" solimp="{d} {d} 0.001 0.5 2" {contact}/>
  </default>
  <worldbody>
    <geom type="plane" size="1 1 0.1"/>
    <body>
      <joint type="slide" axis="0 0 1"/>
      <geom type="sphere" size="{radius}" mass="1"/>
    </body>
  </worldbody>
</mujoco>
"""


def ball_model(dt: float, *, contact: str, solver: str = "") -> str:
    """The model in MuJoCo's language, with attributes of its contacts and of the solver."""
    return _MODEL.format(dt=dt, d=IMPEDANCE, radius=RADIUS, contact=contact, solver=solver)


def constrained(weight: float) -> Callable[[Problem], Problem | None]:
    """The ball as a constraint has it that leaves so much of the weight, or None.

    Under damping the constraint lets go elsewhere, where the ball would fall freely anyway.
    """

    def law(problem: Problem) -> Problem | None:
        damped = problem.c != 0.0
        return None if damped else dataclasses.replace(problem, weight_in_contact=weight)

    return law


def by_mjx(problem: Problem, dt: float) -> Run:
    """MJX's step, its gravity and its solref differentiated forwards."""
    import mujoco
    from mujoco import mjx

    text = ball_model(dt, contact='condim="1"', solver='solver="Newton" ')
    model = mjx.put_model(mujoco.MjModel.from_xml_string(text))
    data = mjx.make_data(model)

    def final(problem: Problem, values: dict[str, Any]) -> jax.Array:
        zero = jnp.zeros(())
        own = model.tree_replace(
            {
                "opt.gravity": jnp.stack([zero, zero, -values["g"]]),
                "geom_solref": jnp.broadcast_to(jnp.stack([-values["K"], zero]), (2, 2)),
            }
        )
        begin = data.replace(qpos=values["height"][None] + RADIUS)
        steps = round(problem.duration / dt)
        end = jax.lax.fori_loop(0, steps, lambda _, each: mjx.step(own, each), begin)
        return jnp.stack([end.qpos[0] - RADIUS, end.qvel[0]])

    return differentiate(final, problem)


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
