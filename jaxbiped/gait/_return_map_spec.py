"""Specification of a return map: whose it is, and how it is solved."""

import diffrax
import equinox as eqx
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time
from jaxbiped.dynamics._redundant_state import minimal_state
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.variational._hybrid_system import AbstractSystem
from jaxbiped.variational._switch_locator import Watch


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


class _Arrival(eqx.Module):
    """The section's value and whether a crossing counts, looked at after the reset."""

    system: AbstractSystem
    section: AbstractSection

    def __call__(self, args: PyTree, y: PyTree) -> tuple[Scalar, Scalar]:
        after_reset = minimal_state(args, self.system.reset_map(args, y))
        return self.section.value(args, after_reset), self.section.counts(args, after_reset)
