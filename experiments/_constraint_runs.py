"""Runs of the hip's constraint methods: integrators, their truth, and what methods cost."""

import functools
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np
from _timing import seconds_of
from _walks import scattered

import jaxbiped as jb

METHODS = tuple(jb.constraints.CONSTRAINT_METHODS)
MOVING = ("theta_1", "omega")
"""What starts of a batch differ in, by a thousandth."""
FLOOR = 1e-18
"""Where a violation of exactly nothing is drawn [m]."""


class Integrator(NamedTuple):
    """A solver's name, and its relative tolerance or its step [s]."""

    solver: str
    rtol: float | None = None
    dt: float | None = None


def truth_of(scene: jb.Scene, duration: float) -> np.ndarray:
    """The minimal formulation's state at the end, at a tolerance of 1e-10."""
    how: dict[str, Any] = dict(rtol=1e-10, save="end", max_solver_steps=1 << 22)
    return np.array(jb.simulate(scene, jb.seed_state(), duration=duration, **how).final)


def relative_costs(
    scene: jb.Scene, methods: tuple[str, ...], how: Integrator, *, single: float, batch: float,
    count: int, turns: int,
) -> dict[str, dict[str, float]]:  # fmt: skip
    """What each method costs beside the standard one: for one walk, and in a batch.

    Medians over runs that the methods, and the minimal formulation, take in turns, so that a
    machine that is busy for a while is busy for all of them.

    Args:
        scene: that is walked.
        methods, how: that hold the hip, and the integrator.
        single, batch: simulated time of the one walk and of those in a batch [s].
        count: walks in a batch.
        turns: runs of each.

    Returns:
        By method, and `minimal`: seconds of a run, and the same relative to the standard method's.
    """
    scenes = {"minimal": scene} | {name: jb.RedundantScene(scene, name) for name in methods}

    def timed(duration: float, mapped: Any, start: jb.State) -> dict[str, float]:
        def run(held: Any) -> Any:
            options: dict[str, Any] = how._asdict() | dict(duration=duration, engine="xla")
            options |= dict(save="end", watch=(), max_solver_steps=1 << 22)
            end = mapped(lambda start: jb.simulate(held, start, **options).state)
            return functools.partial(eqx.filter_jit(end), start)

        return seconds_of({name: run(held) for name, held in scenes.items()}, turns)

    seconds = {
        "single": timed(single, lambda end: end, jb.seed_state()),
        "batch": timed(batch, jax.vmap, scattered(jb.seed_state(), count, 1e-3, MOVING)),
    }
    return {
        name: {f"{key}_s": found[name] for key, found in seconds.items()}
        | {key: found[name] / found["standard"] for key, found in seconds.items()}
        for name in scenes
    }
