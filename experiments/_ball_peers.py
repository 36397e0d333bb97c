"""Simulators of others on the bouncing ball, where installed: MuJoCo MJX, Brax, Warp and Newton.

While they act, MuJoCo's soft constraints cancel the share `IMPEDANCE` of all other forces, and
those of Brax's generalized pipeline all of them; Newton's damper acts while the ball sinks and lets
go as it rises: each such ball has a truth of its own, in the same closed form. Brax's other two
pipelines have contacts without stiffness: an impulse of one step. Newton's numbers are of 32 bits.
"""

import dataclasses
import functools
import itertools

import jax
import jax.numpy as jnp
import numpy as np
from _ball_closed_form import Problem
from _ball_ways import TIME_STEPS, by_logarithms
from _gradient_ways import Answer, Way

IMPEDANCE, RADIUS = 0.9999, 0.05
"""Of the constraint, the largest that MuJoCo allows; of the sphere [m]."""
NEWTON_STEPS = (1e-3, 3e-4)
"""Finer ones take minutes: each step is several launches and a state of its own."""
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


def ball_model(dt, *, contact, solver=""):
    """The model in MuJoCo's language, with attributes of its contacts and of the solver."""
    return _MODEL.format(dt=dt, d=IMPEDANCE, radius=RADIUS, contact=contact, solver=solver)


def constrained(problem: Problem, *, weight: float):
    """The ball as a constraint has it that leaves so much of the weight; None for a damped one.

    Under damping the constraint lets go elsewhere, where the ball would fall freely anyway.
    """
    return None if problem.c else dataclasses.replace(problem, weight_in_contact=weight)


def damped_as_it_sinks(problem: Problem):
    """The ball as Newton's contact has it."""
    return dataclasses.replace(problem, damps_rebound=problem.c == 0.0)


def by_mjx(problem, dt):
    """MJX's step, its gravity and its solref differentiated forwards."""
    import mujoco
    from mujoco import mjx

    text = ball_model(dt, contact='condim="1"', solver='solver="Newton" ')
    model = mjx.put_model(mujoco.MjModel.from_xml_string(text))
    data = mjx.make_data(model)

    def final(values):
        zero = jnp.zeros(())
        gravity = jnp.stack([zero, zero, -values["g"]])
        solref = jnp.broadcast_to(jnp.stack([-values["K"], zero]), (2, 2))
        own = model.tree_replace({"opt.gravity": gravity, "geom_solref": solref})
        begin = data.replace(qpos=values["height"][None] + RADIUS)
        steps = round(problem.duration / dt)
        end = jax.lax.fori_loop(0, steps, lambda _, each: mjx.step(own, each), begin)
        return jnp.stack([end.qpos[0] - RADIUS, end.qvel[0]])

    return by_logarithms(problem, final)


def by_brax(problem, dt):
    """Its step, gravity and solref differentiated forwards."""
    from brax.generalized import pipeline
    from brax.io import mjcf

    system = mjcf.loads(ball_model(dt, contact='friction="0 0 0" condim="3"'))

    def final(values):
        zero = jnp.zeros(())
        gravity = jnp.stack([zero, zero, -values["g"]])
        solref = jnp.broadcast_to(jnp.stack([-IMPEDANCE * values["K"], zero]), (2, 2))
        own = system.replace(gravity=gravity, geom_solref=solref)
        begin = pipeline.init(own, values["height"][None] + RADIUS, jnp.zeros(1))
        steps, still = round(problem.duration / dt), jnp.zeros(0)
        end = jax.lax.fori_loop(0, steps, lambda _, each: pipeline.step(own, each, still), begin)
        return jnp.stack([end.q[0] - RADIUS, end.qd[0]])

    return by_logarithms(problem, final)


def by_tape(tool, problem, dt):
    """A tool of Warp's, through one tape for each number of the state: height, then velocity.

    `tool(warp, problem, dt, k)`: the state at the end, and the derivatives of its number k by name.
    """
    import warp

    warp.config.quiet = True
    follow = tool(warp, problem, dt)

    def run():
        (state, first), (_, second) = follow(0), follow(1)
        rows = ([getattr(problem, n) * float(each[n]) for n in problem.parameters]
                for each in (first, second))  # fmt: skip
        return Answer([float(value) for value in state], list(rows))

    return run


def _warp_ball(wp, problem, dt):
    """Semi-implicit Euler as a Warp kernel."""

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

    steps = round(problem.duration / dt)
    zeros = functools.partial(wp.zeros, dtype=wp.float64, requires_grad=True, device="cpu")

    def follow(k):
        held = {name: zeros(1) for name in ("height", "g", "K", "c")}
        for name, array in held.items():
            array.fill_(getattr(problem, name))
        path = zeros(steps + 1), zeros(steps + 1)
        with wp.Tape() as tape:
            for step in range(-1, steps):
                inputs = [step, wp.float64(dt), *held.values(), *path]
                wp.launch(step_ball, dim=1, inputs=inputs, device="cpu")
        seed = np.zeros(steps + 1)
        seed[-1] = 1.0
        tape.backward(grads={path[k]: wp.array(seed, dtype=wp.float64, device="cpu")})
        slopes = {name: array.grad.numpy()[0] for name, array in held.items()}
        return [each.numpy()[-1] for each in path], slopes

    return follow


def _newton_ball(wp, problem, dt):
    """A particle on Newton's ground plane, as in its own example, by its semi-implicit solver."""
    import newton

    scene = newton.ModelBuilder(up_axis=newton.Axis.Z, gravity=(0.0, 0.0, -problem.g))
    scene.add_particle(pos=(0.0, 0.0, problem.height), vel=(0.0, 0.0, 0.0), mass=1.0, radius=0.0)
    laws = dict(ke=problem.K, kd=problem.c, kf=0.0, mu=0.0)
    scene.add_ground_plane(cfg=newton.ModelBuilder.ShapeConfig(**laws))
    model = scene.finalize(device="cpu", requires_grad=True)
    model.soft_contact_ke, model.soft_contact_kd = problem.K, problem.c
    model.soft_contact_kf = model.soft_contact_mu = 0.0
    how = dict(broad_phase="explicit", soft_contact_gap=10.0, requires_grad=True)
    pipeline = newton.CollisionPipeline(model, **how)
    contacts = pipeline.contacts()  # of a plane that stays: found once
    pipeline.collide(model.state(), contacts)
    solver = newton.solvers.SolverSemiImplicit(model)
    states = [model.state() for _ in range(round(problem.duration / dt) + 1)]

    def follow(k):
        with wp.Tape() as tape:
            for before, after in itertools.pairwise(states):
                before.clear_forces()
                solver.step(before, after, None, contacts, dt)
        last = states[-1].particle_q, states[-1].particle_qd
        seed = wp.array([[0.0, 0.0, 1.0]], dtype=wp.vec3, device="cpu")
        tape.backward(grads={last[k]: seed})
        # The floor's stiffness and damping are means of the particle's and the plane's.
        slopes = {
            "height": states[0].particle_q.grad.numpy()[0, 2],
            "g": -np.sum(model.gravity.grad.numpy()[:, 2]),
            "K": 2.0 * model.shape_material_ke.grad.numpy()[0],
            "c": 2.0 * model.shape_material_kd.grad.numpy()[0],
        }
        end = [each.numpy()[0, 2] for each in last]
        tape.zero()
        return end, slopes

    return follow


MUJOCO_LAW = functools.partial(constrained, weight=1.0 - IMPEDANCE)
BRAX_LAW = functools.partial(constrained, weight=0.0)
BY_NEWTON = functools.partial(by_tape, _newton_ball)
PEERS = (
    Way("MuJoCo MJX", "dt", TIME_STEPS, by_mjx, "mujoco", MUJOCO_LAW),
    Way("Brax", "dt", TIME_STEPS, by_brax, "brax", BRAX_LAW),
    Way("Warp", "dt", TIME_STEPS, functools.partial(by_tape, _warp_ball), "warp"),
    Way("Newton", "dt", NEWTON_STEPS, BY_NEWTON, "newton", damped_as_it_sinks),
)
