"""Walks of the seed's walker from many starts: how far off they end, and their derivatives."""

import functools
from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from reference.compliant import START
from reference.scipy_solves import FINEST, final_of

import jaxbiped as jb

DURATION, ZEROS = 2.0, (0.0, 0.0, 0.0)


def perturbed(count: int, start: np.ndarray = START) -> np.ndarray:
    """Starts about one (n, k), every number off by about a thousandth of itself."""
    noise = np.random.default_rng(0).standard_normal((count, len(start)))
    return start * (1.0 + 1e-3 * noise)


def scattered(state: Any, count: int, spread: float, moving: tuple[str, ...], *, seed: int = 0):
    """States (count,), leaves whose names begin like these off by at most that share."""
    generator = np.random.default_rng(seed)
    leaves = {}
    for name, leaf in state._asdict().items():
        shares = spread * generator.uniform(-1.0, 1.0, count) * name.startswith(moving)
        leaves[name] = leaf * (1.0 + jnp.asarray(shares))
    return type(state)(**leaves)


def walk_from(
    start: Any, rtol: Any, *, scene: Any = None, kind: Any = jb.State, duration: float = DURATION,
    **how: Any,
):  # fmt: skip
    """The end of a walk from the numbers of a kind of state, all with one absolute tolerance.

    With `atol=None` it is that of `simulate`, in units of the walker.
    """
    scene = jb.seed_scene() if scene is None else scene
    given = dict(duration=duration, rtol=rtol, atol=1e-2 * rtol, save="end") | how
    return jb.simulate(scene, kind(*start), **given)


def walker(rtol: float, **how: Any) -> Callable[[np.ndarray], tuple[np.ndarray, Any, Any]]:
    """A function of starts (n, k): final states (n, k), attempted and rejected steps (n,)."""

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


@functools.cache
def slopes_and_end(duration: float, **how: str) -> Callable[[Any], tuple[np.ndarray, np.ndarray]]:
    """From a relative tolerance to derivatives (8, 3) and state (8,) of the seed's walk.

    By one program for all tolerances, as its solver steps: lanes heed derivatives, XLA the state.
    """
    scene = jb.seed_scene()
    adjoint = {"adjoint": diffrax.ForwardMode()} if how["engine"] == "xla" else {}

    def of(scene: jb.Scene) -> Any:
        return scene.normal.K, scene.normal.c, scene.friction.xi

    def final(logs: Any, rtol: Any) -> Any:
        moved = [leaf * jnp.exp(log) for leaf, log in zip(of(scene), logs, strict=True)]
        new = eqx.tree_at(of, scene, moved)
        walk = walk_from(jb.seed_state(), rtol, scene=new, duration=duration, **how, **adjoint)
        end = jnp.stack(walk.final)
        return end, end

    both = jax.jit(jax.jacfwd(final, has_aux=True))

    def run(rtol: float) -> tuple[np.ndarray, np.ndarray]:
        slopes, end = both(list(map(jnp.asarray, ZEROS)), jnp.asarray(rtol))
        return np.stack(slopes, axis=1), np.asarray(end)

    return run
