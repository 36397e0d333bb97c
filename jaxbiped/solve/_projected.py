"""A solver whose steps end on the constraints."""

import dataclasses
from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped.dynamics._consistent import projected
from jaxbiped.scene._constraint_method import AbstractProjectingMethod
from jaxbiped.scene._redundant_scene import RedundantScene


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


def wrapped(solver: Any, project: Callable[[PyTree, PyTree], PyTree], adjoint: Any = None) -> Any:
    """A `Projected` solver, ready for what will differentiate it."""
    unset = getattr(solver, "scan_kind", "none") is None
    if isinstance(adjoint, diffrax.ForwardMode) and unset:
        # diffrax would set it, but cannot through a wrapper.
        solver = dataclasses.replace(solver, scan_kind="lax")
    return Projected(solver, project)


def projecting(scene: RedundantScene, solver: Any, adjoint: Any = None) -> Any:
    """The solver, wrapped where the scene's method projects after each step."""
    projects = isinstance(scene.method, AbstractProjectingMethod)
    return wrapped(solver, projected, adjoint) if projects else solver
