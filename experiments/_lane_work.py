"""What the lanes do in a step, what the machine could do, and scenes of more and less work."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from _scenes import SMOOTH, seed_with
from _timing import seconds_of
from _walks import perturbed

import jaxbiped as jb
from jaxbiped.compiler import LANES, Program, Request

_HOW = dict(save="end", engine="lanes", watch=("fall", "stop", "stumble"))
_CHAINS, _LENGTH = 24, 2000
_FLOPS = {"fadd": 1, "fsub": 1, "fmul": 1, "fdiv": 1, "sqrt": 1, "fma": 2}


def peak_flops():
    """Floating-point operations a second of independent multiply-adds, on all threads."""

    def attempt(x, carried):
        chains, count = carried
        once = lambda _, now: tuple(each * x + 0.5 for each in now)  # noqa: E731
        return (jax.lax.fori_loop(0, _LENGTH, once, chains), count + 1.0), count >= 20.0

    program = Program(
        start=lambda x: (tuple(x + 0.1 * k for k in range(_CHAINS)), jnp.zeros(())),
        attempt=attempt,
        finish=lambda x, carried: sum(carried[0]),
    )
    request = Request(program, np.full(512, 0.999), batch=True)
    seconds = seconds_of({0: functools.partial(LANES.run, request)}, 5, statistic=min)[0]
    return 2.0 * _CHAINS * _LENGTH * 21 * len(request.inputs) / seconds


def _compiled(scene, state=None):
    """The very program that `simulate` runs, so that it is traced once."""
    state = jb.seed_state() if state is None else state
    run = jb.Simulation.prepare(scene, state, duration=1.0, **_HOW)
    return LANES.compile(run.lane_request())


def flops_per_step(scene=None, state=None):
    """Floating-point operations of an attempted step, of the seed's scene unless told otherwise."""
    graph = _compiled(jb.seed_scene() if scene is None else scene, state).kernel.graph
    return sum(_FLOPS.get(value.op, 0) for value in graph.body.values)


def scenes(count, duration, *, quick):
    """Machine instructions and attempted steps a second of scenes that model more and less.

    Where `quick`, of those that model most and least.
    """
    seed, mu = jb.seed_scene(), jb.seed_scene().friction.mu_static
    choices = {
        "the seed's": (seed.normal, seed.friction),
        "smooth laws": (seed_with(**SMOOTH).normal, seed_with(**SMOOTH).friction),
        "regularised Coulomb": (seed.normal, jb.laws.RegularisedCoulomb(mu=mu, v_d=1e-2)),
        "frictionless": (seed.normal, jb.laws.Frictionless()),
        "frictionless Hertz": (jb.laws.Hertz(K=1e6), jb.laws.Frictionless()),
    }
    names = ("smooth laws", "frictionless Hertz") if quick else choices
    starts, rows = [jnp.asarray(column) for column in perturbed(count).T], []
    for name in names:
        force, slip = choices[name]
        scene = jb.Scene(walker=seed.walker, ground=seed.ground, normal=force, friction=slip)

        def steps(*state, scene=scene):
            return jb.simulate(scene, jb.State(*state), duration=duration, **_HOW).attempted

        run = functools.partial(jax.vmap(steps), *starts)
        rate = int(np.sum(run())) / seconds_of({0: run}, 1, warm=False)[0]
        instructions = _compiled(scene).kernel.instructions()
        rows.append(dict(scene=name, instructions=instructions, steps_per_s=rate))
    return rows
