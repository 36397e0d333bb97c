"""Choice of the solver that follows the orbits of a search."""

import diffrax
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped.solve._solvers import solver_named


def orbit_solver(
    solver: str | diffrax.AbstractSolver[PyTree] | None, *, rigid: bool
) -> diffrax.AbstractAdaptiveSolver[PyTree]:
    """The solver of that name, the one given, or the usual one: "rodas4", and "rodas5p" if rigid.

    Raises:
        ArgumentError: an unknown name, or a solver that does not estimate its errors.
    """
    usual = "rodas5p" if rigid else "rodas4"
    found = solver_named(usual if solver is None else solver)
    if not isinstance(found, diffrax.AbstractAdaptiveSolver):
        raise ArgumentError(
            f"solver = {type(found).__name__} is not allowed: it does not estimate its errors, by "
            "which steps are chosen."
        )
    return found
