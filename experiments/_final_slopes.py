"""Derivatives of a walk's final state with respect to the logarithms of K, c and ξ."""

import functools
from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from _walks import walk_from

import jaxbiped as jb

ZEROS = (0.0, 0.0, 0.0)


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
