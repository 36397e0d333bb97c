"""Solvers by name, this project's Rosenbrock family and diffrax's own; and projected ones.

A projected solver's steps end on the constraints.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, TypeVar, cast

import diffrax
import equinox as eqx
import jax.numpy as jnp
import optimistix
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._types import BoolScalarLike, Numbers, RealScalarLike, Time
from jaxbiped.constraints._constraint_methods import AbstractConstraintMethod
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.solve._accuracy import rms_norm
from jaxbiped.solve.rosenbrock._rodas_tableaux import Rodas3P, Rodas4, Rodas4P, Rodas5P

_Solver = TypeVar("_Solver", bound=diffrax.AbstractSolver[PyTree])


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


_SCAN_KINDS: dict[type, str | None] = {
    diffrax.RecursiveCheckpointAdjoint: None,
    diffrax.DirectAdjoint: "bounded",
    diffrax.ForwardMode: "lax",
}
"""Adjoints that go through the steps themselves, and how Runge–Kutta methods loop for them."""


def check_adjoint(
    method: AbstractConstraintMethod, adjoint: diffrax.AbstractAdjoint | None
) -> None:
    """Raises `ArgumentError` for an adjoint that would not see a method's projections."""
    if method.projects and adjoint is not None and type(adjoint) not in _SCAN_KINDS:
        raise ArgumentError(
            f"adjoint = {type(adjoint).__name__} is not allowed for method = "
            f"{type(method).__name__}, which projects after each step: choose one that sees the "
            f"steps, {', '.join(kind.__name__ for kind in _SCAN_KINDS)}."
        )


class Projected(diffrax.AbstractWrappedSolver):  # type: ignore[type-arg]
    """Wraps a solver: what a step arrives at is projected before anything else sees it.

    The error estimate is the solver's own. A solver that keeps a slope from its last step finds it
    anew, for it belonged to the state before the projection.

    Attributes:
        solver: any one-step solver.
        project: `project(args, y)`, the state on the constraints.
    """

    solver: diffrax.AbstractSolver[PyTree]  # type: ignore[misc]
    project: Callable[[PyTree, PyTree], PyTree] = eqx.field(static=True)

    @property
    def term_structure(self) -> PyTree:
        return self.solver.term_structure

    @property
    def interpolation_cls(self) -> Callable[..., diffrax.AbstractLocalInterpolation]:  # type: ignore[override]
        return self.solver.interpolation_cls

    @property
    def scan_kind(self) -> str | None:
        """The solver's, where it has one: diffrax asks Runge–Kutta methods."""
        return getattr(self.solver, "scan_kind", None)

    @property
    def root_finder(self) -> Any:
        """The solver's, where it has one: diffrax hands it the tolerances of the steps."""
        return getattr(self.solver, "root_finder", None)

    def order(self, terms: Any) -> int | None:
        return self.solver.order(terms)

    def error_order(self, terms: Any) -> RealScalarLike | None:
        return self.solver.error_order(terms)

    def init(self, terms: Any, t0: Time, t1: Time, y0: PyTree, args: PyTree) -> Any:
        return self.solver.init(terms, t0, t1, y0, args)

    def func(self, terms: Any, t0: Time, y0: PyTree, args: PyTree) -> PyTree:
        return self.solver.func(terms, t0, y0, args)

    def step(
        self,
        terms: Any,
        t0: Time,
        t1: Time,
        y0: PyTree,
        args: PyTree,
        solver_state: Any,
        made_jump: BoolScalarLike,
    ) -> tuple[PyTree, PyTree, dict[str, PyTree], Any, Any]:
        anew = jnp.ones_like(jnp.asarray(made_jump))
        y1, error, dense, state, result = self.solver.step(
            terms, t0, t1, y0, args, solver_state, anew
        )
        y1 = self.project(args, y1)
        return y1, error, dense | ({"y1": y1} if "y1" in dense else {}), state, result


def wrap_projected(
    solver: _Solver,
    project: Callable[[PyTree, PyTree], PyTree],
    adjoint: diffrax.AbstractAdjoint | None = None,
) -> _Solver:
    """A `Projected` solver, ready for what will differentiate it."""
    kind = _SCAN_KINDS.get(type(adjoint))
    if kind is not None and getattr(solver, "scan_kind", "none") is None:
        # diffrax would set it, but cannot through a wrapper.
        solver = dataclasses.replace(solver, scan_kind=kind)  # type: ignore[call-arg]
    return cast("_Solver", Projected(solver, project))  # as adaptive as what it wraps


def with_projection(
    system: AbstractSystem,
    args: PyTree,
    solver: _Solver,
    adjoint: diffrax.AbstractAdjoint | None = None,
) -> _Solver:
    """The solver, wrapped where the system projects what a step arrives at."""
    return wrap_projected(solver, system.project, adjoint) if system.projects(args) else solver
