"""Names for the shapes that annotations use, and what is done with trees of any shape."""

import functools
import operator
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias, TypeVar

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxbiped._checks import is_number
from jaxbiped._files import JsonObject as JsonObject

Scalar: TypeAlias = Float[Array, "..."]
"""A number: one scalar leaf, or one such leaf for each entry of a batch or a time series."""

StateLeaf: TypeAlias = Any
"""A `Scalar` of a state, which users also write as a number of Python's or an array of NumPy's."""

Numbers: TypeAlias = Array | np.ndarray
"""An array, of JAX or of NumPy."""


SomeTree = TypeVar("SomeTree")
"""A pytree that comes back in the same structure."""

Parameter: TypeAlias = Any
"""A number that a constructor turns into a floating-point array: a float, an array, a tracer."""

RealScalarLike: TypeAlias = Array | np.ndarray | float
"""A number as diffrax takes it: of JAX, of NumPy or of Python."""

BoolScalarLike: TypeAlias = Array | np.ndarray | bool
"""A truth value, likewise."""

Time: TypeAlias = RealScalarLike
"""A time [s], likewise."""

AT_ONCE = 4096
"""Times or states in one call of a compiled function: one size for all lengths."""

VectorField: TypeAlias = Callable[[Time, PyTree, PyTree], PyTree]
"""Rates of change f(t, state, args), in the form that `diffrax.ODETerm` takes."""


def any_of(values: Sequence[Scalar]) -> Scalar:
    """Whether any of some conditions holds (boolean); at least one is given."""
    return functools.reduce(operator.or_, values)


def select(condition: Scalar, a: SomeTree, b: SomeTree) -> SomeTree:
    """`a` where the condition holds, else `b`: pytrees of the same structure."""
    return jtu.tree_map(lambda x, y: jnp.where(condition, x, y), a, b)


def choose(condition: Scalar, a: SomeTree, b: SomeTree) -> SomeTree:
    """`select` by one conditional: for many leaves XLA compiles it in less time.

    Both trees have leaves of the same types.
    """
    return jax.lax.cond(condition, lambda: a, lambda: b)


def as_array(values: np.ndarray) -> Array:
    """An array of JAX from one of NumPy's that nobody changes any more.

    Told its own type, JAX compiles no program for it: else one for each shape.
    """
    values = np.asarray(values)  # an entry of one, too
    return jnp.asarray(values, dtype=values.dtype)


def is_traced(tree: PyTree) -> bool:
    """Whether JAX traces any leaf, so that its number is not known yet."""
    return any(isinstance(leaf, jax.core.Tracer) for leaf in jtu.tree_leaves(tree))


def is_real(leaf: Any) -> bool:
    """Whether a number is a real one, and not a whole one or a boolean."""
    return jnp.issubdtype(jnp.result_type(leaf), jnp.inexact)


def by_numpy(function: Callable[..., Any], *given: Any) -> Any:
    """`function(numpy, *given)` of arrays: by JAX's NumPy where any is traced, else by NumPy.

    There JAX would compile a program for each operation. The results are arrays of JAX, of plain
    numbers plain numbers.
    """
    if is_traced(given):
        return function(jnp, *given)
    if all(isinstance(each, float | int) for each in given):
        return function(np, *given)
    return jtu.tree_map(as_array, function(np, *map(np.asarray, given)))


def in_64_bits(tree: SomeTree) -> SomeTree:
    """A tree of real numbers in 64 bits."""
    return jtu.tree_map(lambda leaf: jnp.asarray(leaf, float), tree)


def as_float(value: Parameter) -> Scalar:
    """A floating-point array of JAX's default width (64 bits unless changed) or its own.

    What is no number is returned as it is, for the check that follows to refuse by name.
    """
    if isinstance(value, jax.core.Tracer) or (isinstance(value, jax.Array) and is_number(value)):
        # A weak type would be a type of its own to `jit`.
        floating = jnp.issubdtype(value.dtype, jnp.floating)
        return jax.lax.convert_element_type(value, value.dtype if floating else float)
    if not is_number(value):
        return value
    try:
        # A copy: the caller's own array may change.
        return as_array(np.array(value, dtype=jax.dtypes.canonicalize_dtype(float)))
    except (TypeError, ValueError):
        return value


def rows_of(tree: SomeTree, rows: Any) -> SomeTree:
    """Rows of each leaf of a tree, as NumPy arrays; None for one more axis."""
    return jtu.tree_map(lambda leaf: np.asarray(leaf)[rows], tree)


def in_parts(function: Callable[[Any], PyTree], tree: PyTree, size: int = AT_ONCE) -> PyTree:
    """`function` of a tree with leaves of shape (n, …), as NumPy arrays of n rows.

    It is called with parts of one size, the last one filled up; with one part where n is 0.
    """
    leaves, structure = jtu.tree_flatten(jtu.tree_map(np.asarray, tree))
    count = len(leaves[0])
    whole = leaves if count else [np.zeros((1, *leaf.shape[1:]), leaf.dtype) for leaf in leaves]
    places = np.minimum(np.arange(max(-(-count // size), 1) * size), max(count - 1, 0))
    parts = [[leaf[k] for leaf in whole] for k in places.reshape(-1, size)]
    found = jax.device_get([function(jtu.tree_unflatten(structure, part)) for part in parts])
    return jtu.tree_map(lambda *rows: np.concatenate(rows)[:count], *found)
