"""Jacobians of functions of scalars, in the way that makes the better program of each compiler.

Lanes eliminate vertices, for fewest operations. XLA has them by reverse mode, all outputs at once:
it compiles that in two thirds of the time.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax.extend.core import Jaxpr, JaxprEqn, Primitive
from jax.interpreters import ad, batching, mlir

from jaxbiped._types import Scalar
from jaxbiped.compiler.ir._vertex_elimination import (
    Arithmetic,
    NoRuleError,
    Weight,
    eliminated_rows,
    is_number,
)

JACOBIAN = Primitive("jacobian")
"""Its operands are the constants of a program of tangents, and then the inputs."""


def jacobian(function: Callable[[list[Scalar]], list[Scalar]], inputs: Sequence[Scalar]) -> Scalar:
    """Derivatives of every output with respect to every input, shape (outputs, inputs)."""
    program, consts = _tangents_of(function, list(inputs))
    found: Scalar = JACOBIAN.bind(*consts, *inputs, program=program)
    return found


def partial_derivatives(
    function: Callable[[list[Scalar]], list[Scalar]], inputs: Sequence[Scalar]
) -> dict[tuple[int, int], Scalar]:
    """Derivatives by (output, input), without those that are zero whatever the inputs.

    In a function of arrays none is known to be zero.
    """
    program, consts = _tangents_of(function, list(inputs))
    rows: Sequence[Sequence[Weight]]
    try:
        rows = eliminated_rows(program, consts, inputs, _TRACED)
    except NoRuleError:
        rows = [[*row] for row in pulled_back(*consts, *inputs, program=program)]
    dtype = jnp.result_type(inputs[0])
    return {
        (i, j): jnp.asarray(weight, dtype=dtype)
        for i, row in enumerate(rows)
        for j, weight in enumerate(row)
        if not is_number(weight, 0.0)
    }


def _tangents_of(
    function: Callable[[list[Scalar]], list[Scalar]], inputs: list[Scalar]
) -> tuple[Jaxpr, Sequence[Any]]:
    """The program of a function's tangents, of inputs and their tangents; and its constants."""

    def pushed(z: list[Scalar], tangents: list[Scalar]) -> list[Scalar]:
        return jax.jvp(function, (z,), (tangents,))[1]

    # Not by `jax.linearize`, which traces each operation by itself.
    closed = jax.make_jaxpr(pushed)(inputs, inputs)
    return closed.jaxpr, closed.consts


def parted(program: Jaxpr, operands: Sequence[Any]) -> tuple[Sequence[Any], Sequence[Any]]:
    """Operands of `JACOBIAN`: constants, and inputs."""
    inputs = len(operands) - len(program.invars) // 2
    return operands[:inputs], operands[inputs:]


def pulled_back(*operands: Scalar, program: Jaxpr) -> Scalar:
    """`JACOBIAN` by reverse mode, which has rules for all operations."""
    consts, inputs = parted(program, operands)
    run = functools.partial(jax.core.eval_jaxpr, program, consts, *inputs)
    pull = jax.linear_transpose(run, *inputs)
    rows = jnp.eye(len(program.outvars), dtype=jnp.result_type(inputs[0]))
    return jnp.stack(jax.vmap(lambda *row: pull(list(row)))(*rows), axis=-1)


def _shape(*operands: Any, program: Jaxpr) -> Any:
    _, inputs = parted(program, operands)
    return jax.core.ShapedArray((len(program.outvars), len(inputs)), inputs[0].dtype)


def _batching(operands: Any, axes: Any, **how: Any) -> tuple[Scalar, int]:
    return jax.vmap(functools.partial(pulled_back, **how), axes)(*operands), 0


def _differentiated(primals: Any, tangents: Any, **how: Any) -> Any:
    given = tuple(map(ad.instantiate_zeros, tangents))
    return jax.jvp(functools.partial(pulled_back, **how), primals, given)


JACOBIAN.def_impl(pulled_back)
JACOBIAN.def_abstract_eval(_shape)
mlir.register_lowering(JACOBIAN, mlir.lower_fun(pulled_back, multiple_results=False))
batching.primitive_batchers[JACOBIAN] = _batching
ad.primitive_jvps[JACOBIAN] = _differentiated


def _evaluate(equation: JaxprEqn, values: list[Any]) -> Sequence[Any]:
    how = equation.primitive.get_bind_params(equation.params)
    found = equation.primitive.bind(*values, **how)
    return found if equation.primitive.multiple_results else [found]


def _choice(which: Any, dtype: Any) -> tuple[Weight, Weight]:
    one, zero = jnp.ones((), dtype), jnp.zeros((), dtype)
    return jax.lax.select_n(which, zero, one), jax.lax.select_n(which, one, zero)


_TRACED = Arithmetic(
    literal=lambda atom: atom.val,
    evaluate=_evaluate,
    weight=lambda value: value if isinstance(value, jax.core.Tracer) else float(value),
    # By the primitives: NumPy's operators take ten times as long to trace.
    product=lambda a, b: a * b if float in (type(a), type(b)) else jax.lax.mul(a, b),
    sum=lambda a, b: a + b if float in (type(a), type(b)) else jax.lax.add(a, b),
    negative=jax.lax.neg,
    inverse=lambda a: 1.0 / a,
    choice=_choice,
)
