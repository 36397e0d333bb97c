"""What differs between versions of JAX, and all that is used of its private names.

0.10 is the oldest version that is kept. Since 0.11 a scan gives trees of its operands instead of
two counts. Since 0.12 `ClosedJaxpr` and `Jaxpr` are one class, and `eval_jaxpr` takes the place of
`call` and `closed_call`. Also JAX's debugging switches.
"""

import contextlib
import functools
import weakref
from collections.abc import Callable, Iterator, Sequence
from typing import Any, ParamSpec, TypeAlias, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax._src.core import eval_context, top_axis_env, trace_ctx, trace_state_clean
from jax._src.interpreters.batching import BatchTracer
from jax.extend.core import Jaxpr, JaxprEqn
from jaxlib import lapack
from jaxlib.mlir import ir

from jaxbiped._types import Numbers, Scalar

ClosedJaxpr: TypeAlias = Any
"""A program with its constants: its `jaxpr` and its `consts`."""
CALLS = {
    "call": "call_jaxpr",
    "checkpoint": "jaxpr",
    "closed_call": "call_jaxpr",
    "core_call": "call_jaxpr",
    "custom_jvp_call": "call_jaxpr",
    "custom_vjp_call": "call_jaxpr",
    "custom_vjp_call_jaxpr": "fun_jaxpr",
    "eval_jaxpr": "call_jaxpr",
    "jit": "jaxpr",
    "pjit": "jaxpr",
    "remat2": "jaxpr",
    "xla_metadata_call": "jaxpr",
}
"""Primitives that only call a program, and the parameter that holds it."""


def current_trace() -> "weakref.ref[Any]":
    """The trace that operations go to now, to be compared."""
    return weakref.ref(trace_ctx.trace)


def called_program(equation: JaxprEqn) -> tuple[Jaxpr, Sequence[Numbers]] | None:
    """The program that an equation calls, with its constants; None where it does anything else."""
    name = CALLS.get(equation.primitive.name)
    if name is None:
        return None
    called = equation.params[name]
    return getattr(called, "jaxpr", called), getattr(called, "consts", ())


def scan_counts(params: dict[str, Any]) -> tuple[int, int]:
    """How many operands of a scan are constants, and how many are carried."""
    if "ft_in" in params:
        constants, carried, _ = (len(part) for part in params["ft_in"].unpack())
        return constants, carried
    return params["num_consts"], params["num_carry"]


def nothing_is_traced() -> bool:
    """Whether the caller is under no transformation of JAX."""
    return bool(trace_state_clean())


def unbatched(leaf: object) -> object:
    """What a tracer of `vmap` holds: by itself that differentiates nothing."""
    while isinstance(leaf, BatchTracer):
        leaf = leaf.val
    return leaf


def undifferentiated(leaf: Any) -> Any:
    """What a tracer of derivatives holds: by itself that is known where nothing else traces it."""
    while isinstance(leaf, jax.core.Tracer) and hasattr(leaf, "primal"):
        leaf = leaf.primal
    return leaf


@contextlib.contextmanager
def untraced() -> Iterator[None]:
    """Within, nothing is traced: for what depends on known numbers alone."""
    axes = trace_ctx.axis_env
    with eval_context():
        trace_ctx.set_axis_env(top_axis_env)
        try:
            yield
        finally:
            trace_ctx.set_axis_env(axes)


def load_lapack() -> None:
    """Registers XLA's calls of LAPACK, which tracing one of them does otherwise."""
    prepare: Any = lapack.prepare_lapack_call
    prepare("geev", np.dtype(np.float64))


def custom_call_targets(module: Any) -> set[str]:
    """Names of the functions outside of XLA that a module of StableHLO calls."""
    names: set[str] = set()

    def note(operation: Any) -> Any:
        if operation.name == "stablehlo.custom_call":
            names.add(operation.attributes["call_target_name"].value)
        return ir.WalkResult.ADVANCE

    module.operation.walk(note)
    return names


@jax.custom_jvp
def tanh(x: Scalar) -> Scalar:
    """Hyperbolic tangent; all versions round its derivative alike, and so take the same steps."""
    return jnp.tanh(x)


@tanh.defjvp
def _tanh_jvp(primals: tuple[Scalar], tangents: tuple[Scalar]) -> tuple[Scalar, Scalar]:
    value = tanh(primals[0])
    return value, tangents[0] * ((1.0 - value) * (1.0 + value))


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
    """Decorator: a function in which JAX's debugging switches are as they usually are.

    They are for the user's code. The package says "not known" by NaN and broadcasts as NumPy does,
    so that under `jax_debug_nans` and its like its functions would raise where nothing is wrong.
    """

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
