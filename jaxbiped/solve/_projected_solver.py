"""Projected solver: its steps end on the constraints."""

import dataclasses
from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped.constraints._constraint_method import (
    AbstractConstraintMethod,
    AbstractProjectingMethod,
)
from jaxbiped.dynamics._consistent_state import project
from jaxbiped.scene._redundant_scene import RedundantScene

_SCAN_KINDS: dict[Any, str | None] = {
    diffrax.RecursiveCheckpointAdjoint: None,
    diffrax.DirectAdjoint: "bounded",
    diffrax.ForwardMode: "lax",
}
"""Adjoints that go through the steps themselves, and how Runge–Kutta methods loop for them."""


def check_adjoint(method: AbstractConstraintMethod, adjoint: Any) -> None:
    """Raises `ArgumentError` for an adjoint that would not see a method's projections."""
    projects = isinstance(method, AbstractProjectingMethod)
    if projects and adjoint is not None and type(adjoint) not in _SCAN_KINDS:
        raise ArgumentError(
            f"adjoint = {type(adjoint).__name__} is not allowed for method = "
            f"{type(method).__name__}, which projects after each step: choose one that sees the "
            f"steps, {', '.join(kind.__name__ for kind in _SCAN_KINDS)}."
        )


class Projected(diffrax.AbstractWrappedSolver):
    """Wraps a solver: what a step arrives at is projected before anything else sees it.

    The error estimate is the solver's own. A solver that keeps a slope from its last step finds it
    anew, for it belonged to the state before the projection.

    Attributes:
        solver: any one-step solver.
        project: `project(args, y)`, the state on the constraints.
    """

    solver: Any  # type: ignore[misc]
    project: Callable[[PyTree, PyTree], PyTree] = eqx.field(static=True)

    @property
    def term_structure(self) -> Any:
        """The solver's."""
        return self.solver.term_structure

    @property
    def interpolation_cls(self) -> Any:  # type: ignore[override]
        """The solver's."""
        return self.solver.interpolation_cls

    @property
    def scan_kind(self) -> Any:
        """The solver's, where it has one: diffrax asks Runge–Kutta methods."""
        return getattr(self.solver, "scan_kind", None)

    def order(self, terms: Any) -> int | None:
        """The solver's."""
        return self.solver.order(terms)

    def error_order(self, terms: Any) -> Any:
        """The solver's."""
        return self.solver.error_order(terms)

    def init(self, terms: Any, t0: Any, t1: Any, y0: PyTree, args: PyTree) -> Any:
        """The solver's."""
        return self.solver.init(terms, t0, t1, y0, args)

    def func(self, terms: Any, t0: Any, y0: PyTree, args: PyTree) -> PyTree:
        """The vector field at a point."""
        return self.solver.func(terms, t0, y0, args)

    def step(
        self,
        terms: Any,
        t0: Any,
        t1: Any,
        y0: PyTree,
        args: PyTree,
        solver_state: Any,
        made_jump: Any,
    ) -> tuple[PyTree, PyTree, dict[str, Any], Any, Any]:
        """One step, as `diffrax.AbstractSolver.step` describes it."""
        anew = jnp.ones_like(jnp.asarray(made_jump))
        y1, error, dense, state, result = self.solver.step(
            terms, t0, t1, y0, args, solver_state, anew
        )
        y1 = self.project(args, y1)
        return y1, error, dense | ({"y1": y1} if "y1" in dense else {}), state, result


def wrap_projected(
    solver: Any, project: Callable[[PyTree, PyTree], PyTree], adjoint: Any = None
) -> Any:
    """A `Projected` solver, ready for what will differentiate it."""
    kind = _SCAN_KINDS.get(type(adjoint))
    if kind is not None and getattr(solver, "scan_kind", "none") is None:
        # diffrax would set it, but cannot through a wrapper.
        solver = dataclasses.replace(solver, scan_kind=kind)
    return Projected(solver, project)


def with_projection(scene: RedundantScene, solver: Any, adjoint: Any = None) -> Any:
    """The solver, wrapped where the scene's method projects after each step."""
    projects = isinstance(scene.method, AbstractProjectingMethod)
    return wrap_projected(solver, project, adjoint) if projects else solver
