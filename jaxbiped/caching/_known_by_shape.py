"""What is known of arguments by their shapes, before anything runs; asked once for each shape."""

import functools
from collections.abc import Callable, Hashable
from typing import Any, TypeVar, cast

import equinox as eqx
import jax
import jax.tree_util as jtu
import numpy as np

from jaxbiped.caching._cached_jit import Skeleton
from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.caching._fingerprint import leaf_of

_Function = TypeVar("_Function", bound=Callable[..., Any])


def known_by_shape(function: _Function) -> _Function:
    """Decorator: a function whose result follows from the shapes of the numbers in its arguments.

    It is evaluated with numbers that only have a shape, and once for all arguments that differ in
    nothing else: a trace of equations of motion takes milliseconds, which a warm call would spend
    each time.

    Args:
        function: a function of trees whose result holds no arrays.

    Returns:
        The same function, for positional arguments.
    """

    @bounded_cache(PROGRAMS)
    @functools.wraps(function)
    def of_shapes(structure: jtu.PyTreeDef, *leaves: Hashable) -> Any:
        return eqx.filter_eval_shape(function, *Skeleton(list(leaves), structure).shapes())

    @functools.wraps(function)
    def called(*args: Any) -> Any:
        leaves, structure = jtu.tree_flatten(args)
        try:
            return of_shapes(structure, *map(_without_value, leaves))
        except TypeError:  # what cannot be hashed is not kept
            return eqx.filter_eval_shape(function, *args)

    return cast(_Function, called)


def _without_value(leaf: Any) -> Any:
    """The shape of an array or of a number with digits; all else decides by its value."""
    if isinstance(leaf, float):
        leaf = np.asarray(leaf)
    return leaf_of(leaf) if isinstance(leaf, jax.Array | np.ndarray | np.generic) else leaf
