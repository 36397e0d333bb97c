"""Fusion barrier: keeps XLA's CPU backend from computing the same thing many times over."""

import contextlib
import contextvars
from collections.abc import Callable, Iterator

import equinox.internal as eqxi
import jax
import jax.extend
import jax.numpy as jnp
import jax.tree_util as jtu

from jaxbiped._types import Scalar, SomeTree

_UP = contextvars.ContextVar("barriers are up", default=True)


@contextlib.contextmanager
def without_barriers() -> Iterator[None]:
    """Within, `fusion_barrier` does nothing: for other compilers than XLA's."""
    token = _UP.set(False)
    try:
        yield
    finally:
        _UP.reset(token)


def fusion_barrier(happens: Scalar, compute: Callable[[], SomeTree]) -> SomeTree:
    """`compute()`, kept apart from what comes before and after it in the compiled program.

    XLA's CPU backend fuses every scalar operation into each of its consumers, repeating it for
    each: hundreds of sines a step where a dozen are needed. It removes optimisation barriers
    first, but never fuses across a conditional. So the work is put into one whose condition the
    compiler cannot know. `happens` (boolean) says where the result is wanted; where no lane wants
    it, the result may be zeros. Elsewhere than on a CPU there is nothing to keep apart.
    """
    if not _UP.get() or jax.default_backend() != "cpu":
        return compute()
    program, shapes = jax.make_jaxpr(compute, return_shape=True)()
    leaves, structure = jtu.tree_flatten(shapes)
    results = jax.lax.cond(
        eqxi.unvmap_any(happens),
        jax.extend.core.jaxpr_as_fun(program),
        lambda: [jnp.zeros(leaf.shape, leaf.dtype) for leaf in leaves],
    )
    return jtu.tree_unflatten(structure, results)
