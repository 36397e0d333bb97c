"""What each rung of the ladder costs and how far its gait lies from the rung above."""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import jaxbiped as jb

DURATION = 10.0
SPREAD = 0.01
"""Largest relative change of a component of the gait's state among the starts of a batch."""
EXACT = 1e-10
MOST_STEPS = 1_000_000
TOLERANCES = tuple(float(x) for x in np.logspace(-4.0, -7.0, 13))
COMPLIANT_TOLERANCE = 1e-6
MEASURES = ("period", "step_length", "speed", "spectral_radius")
REPEATS, LEAST_TIME = 5, 1.0
"""Runs of which the median counts: so many, and so many that they take so long together [s]."""
WITNESSES = 64


class Cost(NamedTuple):
    """What a footstep costs by lanes, at a tolerance whose error was measured.

    Attributes:
        rtol: relative tolerance.
        error: median over the starts of the largest error of an angle or rate after ten seconds.
        single_us: one walk, for each footstep [µs]; batch_us in a batch on all cores [µs].
    """

    rtol: float
    error: float
    single_us: float
    batch_us: float


def gait_of(scene: jb.Scene | jb.RigidScene) -> jb.Gait:
    """The gait at heel strike, which every rung has."""
    return jb.find_gait(scene, section=jb.HeelStrike(), parameters=(), radius_sensitivities=False)


def measures_of(gait: jb.Gait) -> dict[str, Any]:
    """Measures of a gait, and its leading multipliers."""
    values = np.asarray(gait.multipliers)
    return {name: float(getattr(gait.measures, name)) for name in MEASURES} | {
        "multipliers": [[float(v.real), float(v.imag)] for v in values[:3]],
        "unit_multiplier_error": float(gait.unit_multiplier_error),
    }


def distances(measures: dict[str, Any], above: dict[str, Any]) -> dict[str, float]:
    """Relative differences of the measures from those of the rung above."""
    return {name: measures[name] / above[name] - 1.0 for name in MEASURES}


def cost_of(
    scene: jb.Scene | jb.RigidScene,
    gait: jb.Gait,
    batch: int,
    *,
    rtol: float = COMPLIANT_TOLERANCE,
    error: float = np.inf,
) -> Cost:
    """Cost at a tolerance; a rigid walker's, at the loosest one that keeps it below an error."""
    starts = starts_about(gait.measures.state, batch)
    some = jax.tree.map(lambda leaf: leaf[:WITNESSES], starts)
    rigid = isinstance(scene, jb.RigidScene)
    exact = walked(scene, EXACT)(some)
    for chosen in TOLERANCES if rigid else (rtol,):
        reached = _error(walked(scene, chosen)(some), exact)
        if reached <= error:
            break
    footsteps = DURATION / float(gait.measures.period)
    one = jax.tree.map(lambda leaf: leaf[0], starts)
    alone, many = walked(scene, chosen, single=True), walked(scene, chosen)
    single = seconds(lambda: alone(one)) / footsteps
    together = seconds(lambda: many(starts)) / (batch * footsteps)
    return Cost(chosen, reached, 1e6 * single, 1e6 * together)


def starts_about(state: Any, count: int) -> Any:
    """Starts scattered about a gait's state; a compliant foot is not lifted by it."""
    generator = np.random.default_rng(0)

    def scattered(name: str, leaf: Any) -> Any:
        moves = name.startswith(("theta", "omega"))
        spread = SPREAD * generator.uniform(-1.0, 1.0, count) * moves
        return leaf * (1.0 + jnp.asarray(spread))

    names = state._fields
    return type(state)(*map(scattered, names, state))


def walked(
    scene: jb.Scene | jb.RigidScene, rtol: float, *, single: bool = False
) -> Callable[[Any], Any]:
    """A walk of ten seconds as a compiled function of its start; of a batch unless `single`."""

    def end(start: Any) -> Any:
        if isinstance(scene, jb.RigidScene):
            walk = jb.rigid_walk(scene, start, duration=DURATION, rtol=rtol, engine="lanes")
            return walk.final, walk.ending
        walk = jb.simulate(
            scene,
            start,
            duration=DURATION,
            rtol=rtol,
            save="end",
            max_solver_steps=MOST_STEPS,
            engine="lanes",
        )
        return walk.final, walk.ending

    return jax.jit(end if single else jax.vmap(end))


def seconds(work: Callable[[], Any]) -> float:
    """Median time of a warm run."""
    jax.block_until_ready(work())
    times: list[float] = []
    while len(times) < REPEATS or sum(times) < LEAST_TIME:
        begin = time.perf_counter()
        jax.block_until_ready(work())
        times.append(time.perf_counter() - begin)
    return float(np.median(times))


def _error(found: Any, exact: Any) -> float:
    """Of the walks that both count as walking."""
    (state, ending), (truth, true_ending) = found, exact
    walking = (np.asarray(ending) == 0) & (np.asarray(true_ending) == 0)
    names = [n for n in state._fields if n.startswith(("theta", "omega"))]
    gaps = [np.abs(np.asarray(getattr(state, n)) - np.asarray(getattr(truth, n))) for n in names]
    return float(np.median(np.max(gaps, axis=0)[walking]))
