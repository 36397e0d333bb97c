"""Vertex elimination: Jacobians of functions of scalars from their own program.

Linearised, a program is a graph whose edges are partial derivatives; an entry of the Jacobian is
the sum over all paths of the products along them. Forward mode multiplies these out from the
inputs, reverse mode from the outputs. Here the vertex goes first that leaves fewest edges more than
there were, wherever it is (Griewank and Walther, Evaluating Derivatives, chapters 9 and 10).
"""

import heapq
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
from jax.extend.core import Jaxpr, JaxprEqn, Literal, Var

from jaxbiped._jax_versions import called_program
from jaxbiped._types import Numbers, Scalar

Weight: TypeAlias = float | Scalar
"""Of an edge: a traced scalar, or a plain number."""
_PASSED_ON = ("copy", "copy_p", "convert_element_type", "optimization_barrier", "neg")


def jacobian(function: Callable[[list[Scalar]], list[Scalar]], inputs: Sequence[Scalar]) -> Scalar:
    """Derivatives of every output with respect to every input, shape (outputs, inputs)."""
    rows, dtype = _rows(function, list(inputs)), jnp.result_type(inputs[0])
    return jnp.stack([jnp.stack([jnp.asarray(w, dtype=dtype) for w in row]) for row in rows])


def partial_derivatives(
    function: Callable[[list[Scalar]], list[Scalar]], inputs: Sequence[Scalar]
) -> dict[tuple[int, int], Scalar]:
    """Derivatives by (output, input), without those that are zero whatever the inputs.

    In a function of arrays none is known to be zero.
    """
    dtype = jnp.result_type(inputs[0])
    return {
        (i, j): jnp.asarray(weight, dtype=dtype)
        for i, row in enumerate(_rows(function, list(inputs)))
        for j, weight in enumerate(row)
        if not _is(weight, 0.0)
    }


def _rows(
    function: Callable[[list[Scalar]], list[Scalar]], inputs: list[Scalar]
) -> list[list[Weight]]:
    outputs, pushed = jax.linearize(function, inputs)
    closed, graph = jax.make_jaxpr(pushed)(inputs), _Graph(len(inputs))
    try:
        ends = _linear(graph, closed.jaxpr, closed.consts, list(range(len(inputs))))
    except _NoRuleError:
        pull = jax.linear_transpose(pushed, inputs)
        unit = jnp.eye(len(outputs))
        return [pull(list(row))[0] for row in unit]
    found = [graph.output(end) for end in ends]
    graph.eliminate()
    return [[graph.weight(i, output) for i in range(len(inputs))] for output in found]


class _NoRuleError(NotImplementedError):
    """An operation that is not one of scalars."""


class _Zero:
    """A derivative that is zero."""


_ZERO = _Zero()


class _Known:
    """A value that does not depend on the inputs' tangents."""

    def __init__(self, value: Numbers) -> None:
        self.value = value


_Operand: TypeAlias = int | _Known | _Zero
"""A vertex by its number, or what depends on none."""


class _Graph:
    """Vertices by number, inputs first; edges lead from earlier ones to later ones."""

    def __init__(self, inputs: int) -> None:
        self.inputs = inputs
        self.into: list[dict[int, Weight]] = [{} for _ in range(inputs)]
        self.out_of: list[dict[int, Weight]] = [{} for _ in range(inputs)]
        self.outputs: set[int] = set()

    def vertex(self, edges: Sequence[tuple[int, Weight]]) -> "int | _Zero":
        """A sum of earlier ones; itself an earlier one, where it is nothing else."""
        edges = [(source, weight) for source, weight in edges if not _is(weight, 0.0)]
        if not edges:
            return _ZERO
        if len(edges) == 1 and _is(edges[0][1], 1.0):
            return edges[0][0]
        return self._new(edges)

    def output(self, end: "_Operand") -> int:
        """A vertex that is kept."""
        found = self._new([(end, 1.0)] if isinstance(end, int) else [])
        self.outputs.add(found)
        return found

    def weight(self, source: int, target: int) -> Weight:
        """Of an edge, zero where there is none."""
        return self.into[target].get(source, 0.0)

    def eliminate(self) -> None:
        """Removes all vertices but inputs and outputs."""
        inner = [v for v in range(self.inputs, len(self.into)) if v not in self.outputs]
        queue = [(self._cost(v), -v) for v in inner]
        heapq.heapify(queue)
        left = set(inner)
        while queue:
            cost, negative = heapq.heappop(queue)
            v = -negative
            if v not in left:
                continue
            if cost != self._cost(v):  # it was lower or higher when that was pushed
                heapq.heappush(queue, (self._cost(v), -v))
                continue
            left.remove(v)
            for near in self._removed(v) & left:
                heapq.heappush(queue, (self._cost(near), -near))

    def _new(self, edges: Sequence[tuple[int, Weight]]) -> int:
        number = len(self.into)
        self.into.append({})
        self.out_of.append({})
        for source, weight in edges:
            self._join(source, number, weight)
        return number

    def _join(self, source: int, target: int, weight: Weight) -> None:
        known = self.into[target].get(source)
        total = weight if known is None else _sum(known, weight)
        self.into[target][source] = self.out_of[source][target] = total

    def _cost(self, v: int) -> int:
        """How many more edges there are without it."""
        new = sum(s not in self.into[t] for s in self.into[v] for t in self.out_of[v])
        return new - len(self.into[v]) - len(self.out_of[v])

    def _removed(self, v: int) -> set[int]:
        """Removes a vertex; the ones next to it."""
        before, after = self.into[v], self.out_of[v]
        for target in after:
            del self.into[target][v]
        for source in before:
            del self.out_of[source][v]
        for source, first in before.items():
            for target, second in after.items():
                self._join(source, target, _product(first, second))
        return {*before, *after}


def _linear(
    graph: _Graph, jaxpr: Jaxpr, consts: Sequence[Numbers], args: Sequence[_Operand]
) -> list[_Operand]:
    """Adds a linear program's vertices; what its results are."""
    known: dict[Var, _Operand] = {
        variable: _Known(const) for variable, const in zip(jaxpr.constvars, consts, strict=True)
    }
    known.update(zip(jaxpr.invars, args, strict=True))

    def read(atom: Var | Literal) -> _Operand:
        return _Known(atom.val) if isinstance(atom, Literal) else known[atom]

    for equation in jaxpr.eqns:
        given: list[Any] = [read(atom) for atom in equation.invars]
        inner = called_program(equation)
        if all(isinstance(g, _Known) for g in given):
            found = equation.primitive.bind(*[g.value for g in given], **equation.params)
            found = found if equation.primitive.multiple_results else [found]
            results: list[_Operand] = [_Known(each) for each in found]
        elif inner is not None:
            results = _linear(graph, *inner, given)
        else:
            results = [_vertex(graph, equation, given)]
        known.update(zip(equation.outvars, results, strict=True))
    return [read(atom) for atom in jaxpr.outvars]


def _vertex(graph: _Graph, equation: JaxprEqn, given: list[Any]) -> int | _Zero:
    """What a linear operation on scalars gives."""
    name = equation.primitive.name

    def scaled(each: _Operand, weight: Weight) -> list[tuple[int, Weight]]:
        # What a linear program knows beforehand of a sum or a choice can only be a zero.
        return [] if isinstance(each, _Known | _Zero) else [(each, weight)]

    if name in ("add", "add_any"):
        return graph.vertex([*scaled(given[0], 1.0), *scaled(given[1], 1.0)])
    if name == "sub":
        return graph.vertex([*scaled(given[0], 1.0), *scaled(given[1], -1.0)])
    if name in _PASSED_ON:
        return graph.vertex(scaled(given[0], -1.0 if name == "neg" else 1.0))
    if name == "mul":
        (factor,) = (g.value for g in given if isinstance(g, _Known))
        (other,) = (g for g in given if not isinstance(g, _Known))
        weight = factor if isinstance(factor, jax.core.Tracer) else float(factor)
        return graph.vertex(scaled(other, weight))
    if name == "div":
        return graph.vertex(scaled(given[0], 1.0 / given[1].value))
    if name == "select_n":
        which = given[0].value
        no, yes = given[1:]
        dtype = equation.outvars[0].aval.dtype  # type: ignore[attr-defined]
        one, zero = jnp.ones((), dtype), jnp.zeros((), dtype)
        chosen = scaled(yes, jax.lax.select_n(which, zero, one))
        return graph.vertex([*chosen, *scaled(no, jax.lax.select_n(which, one, zero))])
    raise _NoRuleError(name)


def _is(weight: Weight, number: float) -> bool:
    return isinstance(weight, float) and weight == number


def _product(a: Weight, b: Weight) -> Weight:
    for one, other in ((a, b), (b, a)):
        if _is(one, 1.0):
            return other
        if _is(one, -1.0):
            return _negative(other)
    return a * b if isinstance(a, float) or isinstance(b, float) else jax.lax.mul(a, b)


# Of traced scalars the primitives themselves: NumPy's operators take ten times as long to trace.


def _sum(a: Weight, b: Weight) -> Weight:
    return a + b if isinstance(a, float) or isinstance(b, float) else jax.lax.add(a, b)


def _negative(a: Weight) -> Weight:
    return -a if isinstance(a, float) else jax.lax.neg(a)
