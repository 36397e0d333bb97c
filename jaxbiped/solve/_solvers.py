"""Solvers by name: the Rosenbrock family of this project and diffrax's own."""

from collections.abc import Callable

import diffrax
import equinox as eqx
import optimistix
from jaxtyping import PyTree

from jaxbiped._checks import check_choice
from jaxbiped._types import Numbers
from jaxbiped.solve._accuracy import rms_norm
from jaxbiped.solve.rosenbrock._rodas_tableaux import Rodas3P, Rodas4, Rodas4P, Rodas5P


def _chord() -> optimistix.AbstractRootFinder[PyTree, PyTree, PyTree, PyTree]:
    # diffrax's default, VeryChord, rejects steps that converge (diffrax 0.7.2).
    return diffrax.with_stepsize_controller_tols(optimistix.Chord)()


SOLVERS: dict[str, Callable[[], diffrax.AbstractSolver[PyTree]]] = {
    "rodas3p": Rodas3P,
    "rodas4": Rodas4,
    "rodas4p": Rodas4P,
    "rodas5p": Rodas5P,
    "kvaerno3": lambda: diffrax.Kvaerno3(root_finder=_chord()),
    "kvaerno4": lambda: diffrax.Kvaerno4(root_finder=_chord()),
    "kvaerno5": lambda: diffrax.Kvaerno5(root_finder=_chord()),
    "bosh3": diffrax.Bosh3,
    "tsit5": diffrax.Tsit5,
    "dopri5": diffrax.Dopri5,
    "dopri8": diffrax.Dopri8,
    "euler": diffrax.Euler,
    "runge2": diffrax.Heun,
}


def solver_named(solver: str | diffrax.AbstractSolver[PyTree]) -> diffrax.AbstractSolver[PyTree]:
    """The solver with a name; a solver is returned as it is.

    Args:
        solver: a name in `SOLVERS`, or a diffrax solver.

    Returns:
        A diffrax solver.

    Raises:
        ArgumentError: the name is unknown.
    """
    if isinstance(solver, diffrax.AbstractSolver):
        return solver
    check_choice("solver", solver, SOLVERS)
    return SOLVERS[solver]()


def with_root_tolerances(
    solver: diffrax.AbstractSolver[PyTree], rtol: Numbers, atol: Numbers
) -> diffrax.AbstractSolver[PyTree]:
    """The solver with these tolerances for the equations of its stages, unless it has its own.

    An implicit solver of diffrax takes its tolerances from the step-size controller, which steps of
    constant size do not have.
    """
    root_finder = getattr(solver, "root_finder", None)
    if root_finder is None or eqx.is_inexact_array_like(root_finder.rtol):
        return solver
    return eqx.tree_at(
        lambda each: (each.root_finder.rtol, each.root_finder.atol, each.root_finder.norm),
        solver,
        (rtol, atol, rms_norm),
        is_leaf=lambda leaf: leaf is root_finder.rtol or leaf is root_finder.norm,
    )
