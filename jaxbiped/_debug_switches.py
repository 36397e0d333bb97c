"""JAX's debugging switches, off within the package's own programs.

They are for the user's code. The package says "not known" by NaN and broadcasts as NumPy does, so
that under `jax_debug_nans` and its like its functions would raise where nothing is wrong.
"""

import contextlib
import functools
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import jax

_P = ParamSpec("_P")
_T = TypeVar("_T")
_USUAL = {
    "debug_nans": False,
    "debug_infs": False,
    "numpy_rank_promotion": "allow",
    "numpy_dtype_promotion": "standard",
    "check_tracer_leaks": False,
    "enable_checks": False,
}


def without_switches(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """Decorator: a function in which these switches of JAX are as they usually are."""

    @functools.wraps(function)
    def called(*args: _P.args, **kwargs: _P.kwargs) -> _T:
        config: Any = jax.config
        changed = {n: x for n, x in _USUAL.items() if getattr(config, f"jax_{n}") != x}
        if not changed:
            return function(*args, **kwargs)
        with contextlib.ExitStack() as usual:
            for name, value in changed.items():
                usual.enter_context(getattr(jax, name)(value))
            return function(*args, **kwargs)

    return called
