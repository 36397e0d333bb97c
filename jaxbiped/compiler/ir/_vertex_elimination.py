"""Vertex elimination: Jacobians of functions of scalars from their own program.

Linearised, a program is a graph whose edges are partial derivatives; an entry of the Jacobian is
the sum over all paths of the products along them. Forward mode multiplies these out from the
inputs, reverse mode from the outputs. Here the vertex goes first that leaves fewest edges more than
there were, wherever it is (Griewank and Walther, Evaluating Derivatives, chapters 9 and 10).

Lanes eliminate vertices, for fewest operations. XLA takes Jacobians by reverse mode, all outputs at
once, which it compiles in two thirds of the time.
"""

import functools
import heapq
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
from jax.extend.core import Jaxpr, JaxprEqn, Literal, Primitive, Var
from jax.interpreters import ad, batching, mlir

from jaxbiped._jax_versions import called_program
from jaxbiped._types import Scalar

Weight: TypeAlias = Any
"""Of an edge: what an `Arithmetic` computes with, or a plain number."""
_PASSED_ON = ("copy", "copy_p", "convert_element_type", "optimization_barrier", "neg")


class Arithmetic(NamedTuple):
    """What known values and weights of edges are in a compiler, and how they are computed.

    Attributes:
        literal: a program's constant as a known value.
        evaluate: results of an equation of known values.
        weight: a known value as a weight.
        product, sum, negative, inverse: of weights that are not all plain numbers.
        choice: 1 where a condition holds and 0 elsewhere, and the other way about, of a dtype.
    """

    literal: Callable[[Literal], Any]
    evaluate: Callable[[JaxprEqn, list[Any]], Sequence[Any]]
    weight: Callable[[Any], Weight]
    product: Callable[[Weight, Weight], Weight]
    sum: Callable[[Weight, Weight], Weight]
    negative: Callable[[Weight], Weight]
    inverse: Callable[[Weight], Weight]
    choice: Callable[[Any, Any], tuple[Weight, Weight]]


def eliminated_rows(
    program: Jaxpr, consts: Sequence[Any], inputs: Sequence[Any], arithmetic: Arithmetic
) -> list[list[Weight]]:
    """Derivatives of every output by every input, from the program of their tangents.

    Its arguments are known inputs, and then their tangents, in which it is linear.

    Raises:
        NoRuleError: an operation is not one of scalars.
    """
    count = len(inputs)
    graph = _Graph(count, arithmetic)
    given: list[_Operand] = [*map(_Known, inputs), *range(count)]
    found = [graph.output(end) for end in _linear(graph, program, consts, given)]
    graph.eliminate()
    return [[graph.into[output].get(i, 0.0) for i in range(count)] for output in found]


class NoRuleError(NotImplementedError):
    """An operation that is not one of scalars."""


class _Known:
    """A value that does not depend on the inputs' tangents."""

    def __init__(self, value: Any) -> None:
        self.value = value


_Operand: TypeAlias = int | _Known | None
"""A vertex by its number, or what depends on none; None: a derivative that is zero."""


class _Graph:
    """Vertices by number, inputs first; edges lead from earlier ones to later ones."""

    def __init__(self, inputs: int, arithmetic: Arithmetic) -> None:
        self.inputs, self.arithmetic = inputs, arithmetic
        self.into: list[dict[int, Weight]] = [{} for _ in range(inputs)]
        self.out_of: list[dict[int, Weight]] = [{} for _ in range(inputs)]
        self.outputs: set[int] = set()

    def vertex(self, edges: Sequence[tuple[int, Weight]]) -> int | None:
        """A sum of earlier ones; itself an earlier one, where it is nothing else."""
        edges = [(source, weight) for source, weight in edges if not is_number(weight, 0.0)]
        if not edges:
            return None
        if len(edges) == 1 and is_number(edges[0][1], 1.0):
            return edges[0][0]
        return self._new(edges)

    def output(self, end: "_Operand") -> int:
        """A vertex that is kept."""
        found = self._new([(end, 1.0)] if isinstance(end, int) else [])
        self.outputs.add(found)
        return found

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
        total = weight if known is None else self.arithmetic.sum(known, weight)
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
                self._join(source, target, self._product(first, second))
        return {*before, *after}

    def _product(self, a: Weight, b: Weight) -> Weight:
        for one, other in ((a, b), (b, a)):
            if is_number(one, 1.0):
                return other
            if is_number(one, -1.0):
                return -other if isinstance(other, float) else self.arithmetic.negative(other)
        return self.arithmetic.product(a, b)


def _linear(
    graph: _Graph, jaxpr: Jaxpr, consts: Sequence[Any], args: Sequence[_Operand]
) -> list[_Operand]:
    """Adds vertices of a program that is linear in these; what its results are."""
    known: dict[Var, _Operand] = {
        variable: _Known(const) for variable, const in zip(jaxpr.constvars, consts, strict=True)
    }
    known.update(zip(jaxpr.invars, args, strict=True))

    def read(atom: Var | Literal) -> _Operand:
        return _Known(graph.arithmetic.literal(atom)) if isinstance(atom, Literal) else known[atom]

    for equation in jaxpr.eqns:
        given: list[Any] = [read(atom) for atom in equation.invars]
        inner = called_program(equation)
        if all(isinstance(g, _Known) for g in given):
            found = graph.arithmetic.evaluate(equation, [g.value for g in given])
            results: list[_Operand] = [_Known(each) for each in found]
        elif inner is not None:
            results = _linear(graph, *inner, given)
        else:
            results = [_vertex(graph, equation, given)]
        known.update(zip(equation.outvars, results, strict=True))
    return [read(atom) for atom in jaxpr.outvars]


def _vertex(graph: _Graph, equation: JaxprEqn, given: list[Any]) -> int | None:
    """What a linear operation on scalars gives."""
    name, numbers = equation.primitive.name, graph.arithmetic
    if any(v.aval.shape for v in (*equation.invars, *equation.outvars)):  # type: ignore[attr-defined]
        raise NoRuleError(name)

    def scaled(each: _Operand, weight: Weight) -> list[tuple[int, Weight]]:
        # What a linear program knows beforehand of a sum or a choice can only be a zero.
        return [(each, weight)] if isinstance(each, int) else []

    if name in ("add", "add_any"):
        return graph.vertex([*scaled(given[0], 1.0), *scaled(given[1], 1.0)])
    if name == "sub":
        return graph.vertex([*scaled(given[0], 1.0), *scaled(given[1], -1.0)])
    if name in _PASSED_ON:
        return graph.vertex(scaled(given[0], -1.0 if name == "neg" else 1.0))
    if name == "mul":
        (factor,) = (g.value for g in given if isinstance(g, _Known))
        (other,) = (g for g in given if not isinstance(g, _Known))
        return graph.vertex(scaled(other, numbers.weight(factor)))
    if name == "div":
        return graph.vertex(scaled(given[0], numbers.inverse(numbers.weight(given[1].value))))
    if name == "select_n":
        dtype = equation.outvars[0].aval.dtype  # type: ignore[attr-defined]
        chosen, other = numbers.choice(given[0].value, dtype)
        return graph.vertex([*scaled(given[2], chosen), *scaled(given[1], other)])
    raise NoRuleError(name)


def is_number(weight: Weight, number: float) -> bool:
    """Whether it is this plain number."""
    return isinstance(weight, float) and weight == number


JACOBIAN = Primitive("jacobian")
"""Its operands are the constants of a program of tangents, and then the inputs."""


def jacobian(function: Callable[[list[Scalar]], list[Scalar]], inputs: Sequence[Scalar]) -> Scalar:
    """Derivatives of every output with respect to every input, shape (outputs, inputs)."""
    program, consts = _tangents_of(function, list(inputs))
    return JACOBIAN.bind(*consts, *inputs, program=program)


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
