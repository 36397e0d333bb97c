"""Walks of the seed's walker from many starts: how we walk them, and how far off they end."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from reference.compliant import START
from reference.scipy_solves import FINEST, final_of

import jaxbiped as jb

DURATION = 2.0


def perturbed(count: int) -> np.ndarray:
    """Starts about the seed's (n, 8), every number off by about a thousandth of itself."""
    noise = np.random.default_rng(0).standard_normal((count, 8))
    return START * (1.0 + 1e-3 * noise)


def walk_from(start: Any, rtol: Any, *, scene: Any = None, duration: float = DURATION, **how: Any):
    """The end of a walk from eight numbers; its absolute tolerance is the same for all of them.

    With `atol=None` it is that of `simulate`, in units of the walker.
    """
    scene = jb.seed_scene() if scene is None else scene
    given = dict(duration=duration, rtol=rtol, atol=1e-2 * rtol, save="end") | how
    return jb.simulate(scene, jb.State(*start), **given)


def walker(rtol: float, **how: Any) -> Callable[[np.ndarray], tuple[np.ndarray, Any, Any]]:
    """A function of starts (n, 8): final states (n, 8), attempted and rejected steps (n,)."""

    def one(*start: Any) -> Any:
        end = walk_from(start, rtol, **how)
        return end.final, end.attempted, end.rejected

    # What lanes run is compiled by itself.
    many = jax.vmap(one) if how.get("engine") == "lanes" else jax.jit(jax.vmap(one))

    def run(starts: np.ndarray) -> tuple[np.ndarray, Any, Any]:
        final, *steps = jax.block_until_ready(many(*map(jnp.asarray, starts.T)))
        return np.stack(final, axis=1), *map(np.asarray, steps)

    return run


def exact_ends(starts: np.ndarray) -> np.ndarray:
    """Final states (n, 8) by SciPy's Radau and the independent equations."""
    return np.stack([final_of(DURATION, *FINEST, start=start) for start in starts])


def errors_of(ends: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """The largest error of each state (SI units), of as many as the exact ones are."""
    return np.max(np.abs(ends[: len(exact)] - exact), axis=1)
