"""What the lanes do in a step, what the machine could do, and scenes of more and less work."""

import time
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from _batches import perturbed
from _smoothed_laws import smoothed_seed

import jaxbiped as jb
from jaxbiped.compiler import LANES, Program, Request

_WATCH = ("fall", "stop", "stumble")
_CHAINS, _LENGTH = 24, 2000
_FLOPS = {"fadd": 1, "fsub": 1, "fmul": 1, "fdiv": 1, "sqrt": 1, "fma": 2}


def final_slopes(
    duration: float, rtol: float, *, solver: str = "rodas4"
) -> Callable[[], tuple[np.ndarray, np.ndarray]]:
    """Final state (8,) and its derivatives in log K, log c and log ξ (8, 3), by lanes."""
    scene, state = jb.seed_scene(), jb.seed_state()

    def final(logs: Any) -> Any:
        leaves = (scene.normal.K, scene.normal.c, scene.friction.xi)
        moved = [leaf * jnp.exp(logs[i]) for i, leaf in enumerate(leaves)]
        new = eqx.tree_at(lambda s: (s.normal.K, s.normal.c, s.friction.xi), scene, moved)
        options: dict[str, Any] = dict(save="end", rtol=rtol, atol=1e-2 * rtol, engine="lanes")
        walk = jb.simulate(new, state, duration=duration, solver=solver, **options)
        end = jnp.stack(walk.final)
        return end, end

    both = jax.jit(jax.jacfwd(final, has_aux=True))

    def run() -> tuple[np.ndarray, np.ndarray]:
        slopes, end = both([jnp.asarray(0.0)] * 3)
        return np.asarray(end), np.stack(slopes, axis=1)

    return run


def peak_flops() -> float:
    """Floating-point operations a second of independent multiply-adds, on all threads."""

    def attempt(x: Any, carried: Any) -> Any:
        chains, count = carried

        def once(_: int, now: tuple[Any, ...]) -> tuple[Any, ...]:
            return tuple(each * x + 0.5 for each in now)

        return (jax.lax.fori_loop(0, _LENGTH, once, chains), count + 1.0), count >= 20.0

    program = Program(
        start=lambda x: (tuple(x + 0.1 * k for k in range(_CHAINS)), jnp.zeros(())),
        attempt=attempt,
        finish=lambda x, carried: sum(carried[0]),
    )
    request = Request(program, np.full(512, 0.999), batch=True)
    LANES.run(request)
    seconds = []
    for _ in range(5):
        began = time.perf_counter()
        LANES.run(request)
        seconds.append(time.perf_counter() - began)
    return 2.0 * _CHAINS * _LENGTH * 21 * len(request.inputs) / min(seconds)


def _compiled(scene: jb.Scene) -> Any:
    """The very program that `simulate` runs, so that it is traced once."""
    options: dict[str, Any] = dict(save="end", engine="lanes", watch=_WATCH)
    run = jb.Simulation.prepare(scene, jb.seed_state(), duration=1.0, **options)
    return LANES.compile(run.lane_request())


def flops_per_step() -> int:
    """Floating-point operations of an attempted step of the seed's scene."""
    graph = _compiled(jb.seed_scene()).kernel.graph
    return sum(_FLOPS.get(value.op, 0) for value in graph.body.values)


def scenes(count: int, duration: float, *, quick: bool) -> list[dict[str, Any]]:
    """Machine instructions and attempted steps a second of scenes that model more and less.

    Where `quick`, of those that model most and least.
    """
    seed, smooth = jb.seed_scene(), smoothed_seed()
    friction, normal = seed.friction, seed.normal
    mu = friction.mu_static
    choices = {
        "the seed's": (normal, friction),
        "smooth laws": (smooth.normal, smooth.friction),
        "regularised Coulomb": (normal, jb.laws.RegularisedCoulomb(mu=mu, v_d=1e-2)),
        "frictionless": (normal, jb.laws.Frictionless()),
        "frictionless Hertz": (jb.laws.Hertz(K=1e6), jb.laws.Frictionless()),
    }
    if quick:
        choices = {name: choices[name] for name in ("smooth laws", "frictionless Hertz")}
    rows = []
    starts = [jnp.asarray(column) for column in perturbed(count).T]
    for name, (force, slip) in choices.items():
        scene = jb.Scene(walker=seed.walker, ground=seed.ground, normal=force, friction=slip)

        def one(*state: Any, scene: jb.Scene = scene) -> Any:
            options: dict[str, Any] = dict(save="end", engine="lanes", watch=_WATCH)
            end = jb.simulate(scene, jb.State(*state), duration=0.2 * duration, **options)
            return end.attempted

        jax.vmap(one)(*starts)
        began = time.perf_counter()
        steps = int(np.sum(jax.vmap(one)(*starts)))
        rate = steps / (time.perf_counter() - began)
        rows.append(dict(scene=name, instructions=_compiled(scene).kernel.instructions(),
                         steps_per_s=rate))  # fmt: skip
    return rows
