"""Specification of a return map: whose it is, and how it is solved."""

from typing import cast

import diffrax
import equinox as eqx
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time, by_numpy
from jaxbiped.dynamics._redundant_state import minimal_state
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.scene._scene import AbstractScene, RedundantScene
from jaxbiped.solve._projected_solver import with_projection
from jaxbiped.variational._hybrid_system import AbstractSystem, RedundantWalking, system_of
from jaxbiped.variational._variational_problem import Watch

_PATIENCE = 50.0
"""Time allowed to the next arrival, in units of √(l/g)."""


class ReturnMapSpec(eqx.Module):
    """What does not change from one evaluation of the return map to the next.

    Attributes:
        system, section: whose return map.
        solver: one-step solver.
        steps: arrivals that make one cycle.
        max_time: longest time to the next arrival [s].
        max_solver_steps: cap on the attempted steps to the next arrival.
        engine: "xla" or "lanes".
        within: the system that is solved, where its coordinates are redundant: every solve
            enters them and leaves them again, so that a cycle knows nothing of constraints.
    """

    system: AbstractSystem
    section: AbstractSection
    solver: diffrax.AbstractAdaptiveSolver[PyTree]
    max_time: Time
    steps: int = eqx.field(static=True)
    max_solver_steps: int = eqx.field(static=True)
    engine: str = eqx.field(static=True)
    within: AbstractSystem | None = None

    def watch(
        self,
        args: PyTree,
        y: PyTree,
        *,
        peak: bool = True,
        of: AbstractSystem | None = None,
    ) -> Watch:
        """What the solves end on: a section is looked at after the arrival's reset."""
        system = self.system if of is None else of
        loaded = eqx.filter_eval_shape(system.load, args, y) is not None
        return Watch(
            field=system.vector_field,
            switches=system.switches,
            section=_Arrival(system, self.section),
            ending=system.ending,
            peak=system.load if peak and loaded else None,
        )


def runs_by_lanes(spec: ReturnMapSpec, *_: object, **__: object) -> bool:
    """Whether a function of a return map leaves the work to programs of lanes."""
    return spec.engine == "lanes"


def walking_spec(
    scene: AbstractScene,
    section: AbstractSection,
    solver: diffrax.AbstractAdaptiveSolver[PyTree],
    engine: str,
    *,
    steps: int,
    most: int,
) -> ReturnMapSpec:
    """The return map of a walker, of cycles of so many footsteps."""
    within = None
    if scene.redundant:
        solver, within = with_projection(cast("RedundantScene", scene), solver), RedundantWalking()
    return ReturnMapSpec(
        system=system_of(scene),
        section=section,
        solver=solver,
        max_time=_patience(scene.walker.l, scene.ground.g),
        steps=steps,
        max_solver_steps=most,
        engine=engine,
        within=within,
    )


class _Arrival(eqx.Module):
    """The section's value and whether a crossing counts, looked at after the reset."""

    system: AbstractSystem
    section: AbstractSection

    def __call__(self, args: PyTree, y: PyTree) -> tuple[Scalar, Scalar]:
        after_reset = minimal_state(args, self.system.reset_map(args, y))
        return self.section.value(args, after_reset), self.section.counts(args, after_reset)


def _patience(length: Scalar, g: Scalar) -> Scalar:
    found: Scalar = by_numpy(lambda numpy, l, g: _PATIENCE * numpy.sqrt(l / g), length, g)
    return found
