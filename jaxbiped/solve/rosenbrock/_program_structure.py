"""Structure of a program of scalars: what each output can depend on, and which are plain copies."""

from typing import NamedTuple

from jax.extend.core import Jaxpr, JaxprEqn, Literal, Var

from jaxbiped._jax_versions import ClosedJaxpr, called_program


class Structure(NamedTuple):
    """Structure of a function of scalars.

    Attributes:
        depends: for each output, the positions of the inputs that it can depend on.
        copies: for each output, the position of the input that it is a plain copy of, or None.
    """

    depends: tuple[frozenset[int], ...]
    copies: tuple[int | None, ...]


def structure_of(program: ClosedJaxpr) -> Structure:
    """Structure of a traced program. Conservative: a dependence may be reported in vain."""
    jaxpr = program.jaxpr
    inputs: list[frozenset[int]] = [frozenset([i]) for i in range(len(jaxpr.invars))]
    copies: list[int | None] = list(range(len(jaxpr.invars)))
    depends, copied = _propagate(jaxpr, inputs, copies)
    return Structure(tuple(depends), tuple(copied))


def _propagate(
    jaxpr: Jaxpr, inputs: list[frozenset[int]], copies: list[int | None]
) -> tuple[list[frozenset[int]], list[int | None]]:
    depends: dict[Var, frozenset[int]] = dict(zip(jaxpr.invars, inputs, strict=True))
    copied: dict[Var, int | None] = dict(zip(jaxpr.invars, copies, strict=True))

    def read(atom: Var | Literal) -> tuple[frozenset[int], int | None]:
        if isinstance(atom, Literal):
            return frozenset(), None
        return depends.get(atom, frozenset()), copied.get(atom)

    for equation in jaxpr.eqns:
        arguments = [read(atom) for atom in equation.invars]
        called = called_program(equation)
        if called is None:
            union: frozenset[int] = frozenset().union(*(used for used, _ in arguments))
            results = [union] * len(equation.outvars)
            source = arguments[0][1] if _is_copy(equation) else None
            results_copied: list[int | None] = [source] * len(equation.outvars)
        else:
            results, results_copied = _propagate(
                called[0], [used for used, _ in arguments], [source for _, source in arguments]
            )
        for variable, used, origin in zip(equation.outvars, results, results_copied, strict=True):
            depends[variable], copied[variable] = used, origin
    outputs = [read(atom) for atom in jaxpr.outvars]
    return [used for used, _ in outputs], [source for _, source in outputs]


def _is_copy(equation: JaxprEqn) -> bool:
    """Whether its result is its argument, as where only a weak type becomes a strong one."""
    if equation.primitive.name != "convert_element_type":
        return False
    before, after = (atom.aval for atom in (*equation.invars, *equation.outvars))
    return bool(before.dtype == after.dtype)  # type: ignore[attr-defined]
