"""What the experiments on the hip's constraints share."""

import functools
import json
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from _options import Options
from _timing import seconds_of

import jaxbiped as jb

COLOURS = ("#000000", "#E69F00", "#56B4E9", "#009E73", "#D55E00", "#0072B2", "#CC79A7")
STYLES = ("-", "--", "-.", ":", "-", "--", "-.")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
PROJECTING = ("index1", "index1aug", "described")
ASTRAY = 0.05
"""Error of the state (SI units) from which a run has failed."""
FLOOR = 1e-18
"""Where a violation of exactly nothing is drawn [m]."""


class Integrator(NamedTuple):
    """A solver's name, and its relative tolerance or its step [s]."""

    solver: str
    rtol: float | None = None
    dt: float | None = None


class Curve(NamedTuple):
    """A violation over time.

    Attributes:
        t: [s]. position: ‖Φ‖ [m]. ending: of the walk, in words. seconds: of a warm run [s].
        error: largest difference from the minimal formulation's state at the end (SI units).
        at_steps: largest ‖Φ‖ at the ends of the steps [m]; in between the curve has the error of
            the dense output, which a projection does not see.
    """

    t: np.ndarray
    position: np.ndarray
    ending: str
    seconds: float
    error: float
    at_steps: float

    def largest(self, start: float, stop: float) -> float:
        """Largest violation between two parts of the whole time, 0 to 1 [m]."""
        part = (self.t >= start * self.t[-1]) & (self.t <= stop * self.t[-1])
        return float(self.position[part].max())


def curve_of(
    scene: jb.Scene,
    method: str,
    integrator: Integrator,
    duration: float,
    truth: np.ndarray,
    points: int = 1001,
) -> Curve:
    """The violation of a method over the seed's walk, timed warm."""
    held = jb.RedundantScene(scene, method)
    times = jnp.linspace(0.0, duration, points)
    steps: dict[str, Any] = (
        dict(dt=integrator.dt) if integrator.rtol is None else dict(rtol=integrator.rtol)
    )
    request = jb.Simulation.prepare(
        held,
        jb.seed_state(),
        duration=duration,
        solver=integrator.solver,
        save=times,
        watch=(),
        extremes=jb.dynamics.violation,
        max_solver_steps=1 << 25,
        **steps,
    )
    walk = jax.block_until_ready(request())
    begin = time.perf_counter()
    walk = jax.block_until_ready(request())
    seconds = time.perf_counter() - begin
    off = np.asarray(jb.dynamics.violation(held, walk.state).position)
    final = np.array(jb.dynamics.minimal_state(held, walk.final))
    error = float(np.max(np.abs(final - truth)))
    alive = np.isfinite(off)
    at_steps = float(walk.highest.position)
    # One that came to its end somewhere else has failed all the same.
    ending = str(walk.outcome) if error < ASTRAY else "failed"
    return Curve(np.asarray(times)[alive], off[alive], ending, seconds, error, at_steps)


def compared(
    methods: tuple[str, ...], integrators: list[Integrator], duration: float
) -> list[dict[str, Any]]:
    """The runs of `jaxbiped constraints`; an error that is no number is None."""
    ways = [
        f"{how.solver}:dt={how.dt!r}" if how.rtol is None else f"{how.solver}:{how.rtol!r}"
        for how in integrators
    ]
    command = [sys.executable, "-m", "jaxbiped", "constraints", "--json", "-", "--repeats", "1"]
    command += ["--duration", repr(duration), "--methods", *methods, "--integrators", *ways]
    found = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True)
    runs: list[dict[str, Any]] = json.loads(found.stdout)["runs"]
    return runs


def truth_of(scene: jb.Scene, duration: float) -> np.ndarray:
    """The minimal formulation's state at the end, at a tolerance of 1e-10."""
    walk = jb.simulate(
        scene, jb.seed_state(), duration=duration, rtol=1e-10, save="end", max_solver_steps=1 << 22
    )
    return np.array(walk.final)


def starts(count: int) -> Any:
    """Starts scattered about the seed's by a thousandth, leaves of shape (count,)."""
    generator = np.random.default_rng(0)
    factors = 1.0 + 1e-3 * generator.uniform(-1.0, 1.0, (8, count))
    state = jb.seed_state()
    moved = [leaf * jnp.asarray(f) for leaf, f in zip(state, factors, strict=True)]
    moving = ("theta_1", "omega_1", "omega_2")
    every = dict(zip(state._fields, moved, strict=True))
    still = {n: jnp.full(count, v) for n, v in state._asdict().items()}
    return jb.State(**{n: every[n] if n in moving else still[n] for n in state._fields})


def relative_costs(
    scene: jb.Scene,
    methods: tuple[str, ...],
    integrator: Integrator,
    *,
    single: float,
    batch: float,
    count: int,
    turns: int,
) -> dict[str, dict[str, float]]:
    """What each method costs beside the standard one: for one walk, and in a batch.

    Medians over runs that the methods, and the minimal formulation, take in turns, so that a
    machine that is busy for a while is busy for all of them.

    Args:
        single, batch: simulated time of the one walk and of those in a batch [s].
        count: walks in a batch.
        turns: runs of each.

    Returns:
        By method, and `minimal`: seconds of a run, and the same relative to the standard method's.
    """
    scenes: dict[str, Any] = {"minimal": scene}
    scenes |= {name: jb.RedundantScene(scene, name) for name in methods}
    one, many = jb.seed_state(), starts(count)
    alone = {
        name: functools.partial(eqx.filter_jit(_ends(held, integrator, single)), one)
        for name, held in scenes.items()
    }
    together = {
        name: functools.partial(eqx.filter_jit(jax.vmap(_ends(held, integrator, batch))), many)
        for name, held in scenes.items()
    }
    seconds = {"single": seconds_of(alone, turns), "batch": seconds_of(together, turns)}
    return {
        name: {f"{key}_s": found[name] for key, found in seconds.items()}
        | {key: found[name] / found["standard"] for key, found in seconds.items()}
        for name in scenes
    }


def _ends(scene: Any, integrator: Integrator, duration: float) -> Callable[[Any], Any]:
    def end(start: Any) -> Any:
        return jb.simulate(
            scene,
            start,
            duration=duration,
            solver=integrator.solver,
            rtol=integrator.rtol,
            dt=integrator.dt,
            save="end",
            watch=(),
            max_solver_steps=1 << 22,
            engine="xla",
        ).state

    return end


def say_costs(options: Options, costs: dict[str, dict[str, float]]) -> None:
    """The costs as a table."""
    rows = ({"method": name} | row for name, row in costs.items())
    keys = ("single_s", "single", "batch_s", "batch")
    options.table(rows, method="", **dict.fromkeys(keys, ".3g"))
