"""Functions that are kept programs where they are called by themselves."""

import functools
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import jax.tree_util as jtu
import numpy as np

from jaxbiped._debug_switches import without_switches
from jaxbiped._jax_versions import nothing_is_traced
from jaxbiped.compiler.host_code._host_jit import host_jit

_P = ParamSpec("_P")
_T = TypeVar("_T")
_FEW = 1000
"""Numbers in an array up to which NumPy runs a function: it holds all that lies in between."""


def kept_alone(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """Decorator: a function of arrays that is one kept program where it is called by itself.

    Operation by operation JAX would compile a program for each. NumPy runs it where arrays are
    small: its program is written many times sooner than XLA compiles one. Where something traces
    it, it is a part of the whole as it is.
    """
    kept = host_jit(_are_small)(function)

    @without_switches
    @functools.wraps(function)
    def called(*args: _P.args, **kwargs: _P.kwargs) -> _T:
        if not nothing_is_traced():
            return function(*args, **kwargs)
        args, kwargs = jtu.tree_map(_as_array, (args, kwargs))
        return kept(*args, **kwargs)

    return called


def _are_small(*args: Any, **kwargs: Any) -> bool:
    return all(getattr(leaf, "size", 1) <= _FEW for leaf in jtu.tree_leaves((args, kwargs)))


def _as_array(leaf: Any) -> Any:
    """A number of Python's as an array, for it not to be compiled in."""
    return np.asarray(leaf) if isinstance(leaf, float | int) else leaf
