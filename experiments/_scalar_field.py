"""A vector field of JAX as plain scalar code, for solvers of others: SciPy's, or numbalsoda.

A peer solves the very equations of a scene, traced by JAX; the solver and the code are its own.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np
from jax.extend.core import Literal

_BINARY = {
    "add": "+", "add_any": "+", "sub": "-", "mul": "*", "div": "/", "and": "&", "or": "|",
    "lt": "<", "gt": ">", "ge": ">=", "le": "<=", "eq": "==", "ne": "!=",
}  # fmt: skip
_CALLS = {"exp": "exp", "log": "log", "sin": "sin", "cos": "cos", "sqrt": "sqrt", "abs": "fabs"}
_SAME = ("convert_element_type", "copy", "stop_gradient", "broadcast_in_dim", "squeeze")


class _Writer:
    """Lines of Python, one for each operation of a program on scalars."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def write(self, closed: Any, inputs: Sequence[str]) -> list[str]:
        """Writes a program on named inputs; gives the names of its results."""
        program = closed.jaxpr
        constants = [repr(np.asarray(each).item()) for each in closed.consts]
        names = dict(zip(program.constvars, constants, strict=True))
        names |= dict(zip(program.invars, inputs, strict=True))

        def read(atom: Any) -> str:
            return repr(np.asarray(atom.val).item()) if isinstance(atom, Literal) else names[atom]

        for each in program.eqns:
            given = [read(atom) for atom in each.invars]
            inner = each.params.get("jaxpr", each.params.get("call_jaxpr"))
            if each.primitive.name == "custom_jvp_call" and len(each.outvars) == 2:
                # The package's sine and cosine in plain arithmetic: the peer takes its own.
                found = [self._named(f"math.{name}({given[0]})") for name in ("sin", "cos")]
            elif inner is not None:
                found = self.write(inner, given)
            elif each.primitive.name in _SAME:
                found = given
            else:
                found = [self._named(_written(each, given))]
            names |= dict(zip(each.outvars, found, strict=True))
        return [read(atom) for atom in program.outvars]

    def _named(self, text: str) -> str:
        name = f"t{len(self.lines)}"
        self.lines.append(f"{name} = {text}")
        return name


def _written(equation: Any, given: Sequence[str]) -> str:
    name = equation.primitive.name
    if name in _BINARY:
        return f"{given[0]} {_BINARY[name]} {given[1]}"
    if name in _CALLS:
        return f"math.{_CALLS[name]}({given[0]})"
    if name in ("max", "min"):
        return f"{name}({given[0]}, {given[1]})"
    if name == "select_n":
        return f"{given[2]} if {given[0]} else {given[1]}"
    if name == "sign":
        return f"math.copysign(1.0, {given[0]}) if {given[0]} != 0.0 else 0.0"
    if name in ("integer_pow", "square"):
        return f"{given[0]} ** {equation.params.get('y', 2)}"
    if name in ("neg", "not"):
        return f"{'-' if name == 'neg' else 'not '}{given[0]}"
    raise NotImplementedError(f"{name} is not among the operations that numba is given.")


def rates_of(field: Callable[..., Any], size: int) -> Callable[..., None]:
    """A vector field as plain Python: a function (t, u, out, p) that writes the rates of u to out.

    Args:
        field: from `size` scalars to their rates.
        size: of the state.
    """
    writer = _Writer()
    rates = writer.write(jax.make_jaxpr(field)(*[0.0] * size), [f"u[{i}]" for i in range(size)])
    lines = [*writer.lines, *(f"out[{i}] = {rate}" for i, rate in enumerate(rates))]
    made: dict[str, Any] = {"math": math}
    exec("def rates(t, u, out, p):\n" + "".join(f"    {line}\n" for line in lines), made)
    return made["rates"]


def address_of(field: Callable[..., Any], size: int) -> int:
    """Address of a vector field in numbalsoda's form, compiled by numba; see `rates_of`."""
    import numba
    import numbalsoda

    compiled = numba.cfunc(numbalsoda.lsoda_sig)(rates_of(field, size))
    _KEPT.append(compiled)
    return compiled.address


_KEPT: list[Any] = []
"""Compiled functions, which live as long as their addresses are called."""
