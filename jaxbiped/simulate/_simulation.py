"""Checked request to simulate by solvers of stiff motion, which can be compiled."""

import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import ArrayLike, PyTree

from jaxbiped._types import Numbers
from jaxbiped.compiler import BY_NAME, Request
from jaxbiped.hybrid._hybrid_system import HybridSystem
from jaxbiped.hybrid._scales import Units, resolve_slip_speed, si_units, units_of
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene._linkage_scene import LinkageScene
from jaxbiped.scene._scene import AbstractScene, RedundantScene, Scene
from jaxbiped.simulate._abstract_simulation import AbstractSimulation
from jaxbiped.simulate._backends import (
    by_lanes,
    by_xla,
    choose_engine,
    lane_request,
    prepare_lanes,
    trim,
)
from jaxbiped.simulate._derivatives import Slopes, slopes_of
from jaxbiped.simulate._start import Options
from jaxbiped.simulate._trajectory import Trajectory, scene_key
from jaxbiped.solve._error_estimate import LOOSER
from jaxbiped.solve._solvers import solver_named
from jaxbiped.solve.rosenbrock._rodas_tableaux import Rodas4P, Rodas5P
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock

_FIRST = 1e-2
"""First tolerance as a share of the relative error wanted: errors of walks are about 0.5 to 6
tolerances (the seed's walk of two seconds, 1e-5 to 1e-9), and bars some fifteen times that."""
_FINEST_FIRST = 1e-10
"""Finest tolerance to begin with."""
_AS_FINE = 2.0
"""Weight of a witness whose own error is about the walk's: their difference may be either's.

Weight and share were chosen on 1000 random scenes (draw 23 of `experiments/accuracy_coverage.py`):
without them every number lay within its bar in 95.1 % of the scenes, with them in 99.1 %."""


class Simulation(AbstractSimulation):
    """A checked request for a simulation: `prepare` makes it, `compile` compiles it.

    Attributes:
        units: scale of each leaf of the state, in which `atol` is measured.
        solver: as in `simulate`.
        replaceable: whether XLA may replace the lanes engine.
    """

    kinds: ClassVar[tuple[type, ...]] = (Scene, RedundantScene, LinkageScene, HybridSystem)
    finest_tolerance: ClassVar[float] = 1e-12
    units: Units
    solver: diffrax.AbstractSolver[PyTree]
    replaceable: bool = eqx.field(static=True)

    @staticmethod
    def prepare(scene: AbstractScene, state: PyTree, **options: Any) -> "Simulation":
        """Checks the arguments, which are those of `simulate`; an accuracy must be a name."""
        return Simulation.of(scene, state, Options(**options))

    @classmethod
    def method_of(cls, asked: Options) -> diffrax.AbstractSolver[PyTree]:
        return solver_named(asked.solver)

    @classmethod
    def completed(
        cls, fields: dict[str, Any], scene: Any, asked: Options, method: Any
    ) -> "Simulation":
        state = fields["state"]
        dtype = jnp.result_type(jtu.tree_leaves(state)[0])

        def known(leaf: ArrayLike) -> Numbers:
            # As it is where nothing is traced: each array of JAX's costs 0.1 ms.
            traced = isinstance(leaf, jax.core.Tracer)
            return jnp.asarray(leaf, dtype=dtype) if traced else np.asarray(leaf, dtype)

        # A tolerance that is given is one in SI units.
        units = units_of(scene, state)
        units = units if asked.atol is None else si_units(units)
        return cls(
            **fields,
            units=jtu.tree_map(known, units),
            solver=method,
            engine=choose_engine(asked, method, (fields["scene"], state, fields["duration"])),
            replaceable=asked.engine == "auto" and asked.section is None and not asked.integrals,
        )

    def solved(self) -> Trajectory:
        request = self.lane_request()
        return trim(by_xla(self)) if request is None else by_lanes(self, request)

    def slopes(self, found: Trajectory, places: tuple[int, ...], active: tuple[int, ...]) -> Slopes:
        # The columns take the walk's own method of steps, where that is one for them.
        solver = self.solver if isinstance(self.solver, AbstractRosenbrock) else Rodas4P()
        return slopes_of(
            self.scene,
            self.state,
            found,
            until=self.duration if self.times is None else None,
            solver=solver,
            section=self.section,
            rtol=self.rtol,
            places=places,
            active=active,
            device=self.engine == "cuda",
        )

    def by_other_method(self) -> tuple["Simulation", float, float]:
        if isinstance(self.solver, Rodas5P):
            # Rodas4P takes about as many steps as Rodas5P at a ten times looser tolerance.
            return dataclasses.replace(self, solver=solver_named("rodas4p")), LOOSER, 1.0
        return dataclasses.replace(self, solver=solver_named("rodas5p")), 1.0, _AS_FINE

    def first_tolerance(self, wanted: float) -> float:
        # What cannot be met is told with the error that can: not at once by the finest steps.
        # Coarser than what resolves slip both witnesses may chatter alike.
        resolved = float(resolve_slip_speed(1.0, self.scene.minimal))
        return min(max(_FIRST * wanted, _FINEST_FIRST), float(self.rtol) * 10.0, resolved)

    def lane_request(self) -> Request | None:
        """The program that runs it; None where diffrax does, also for what lanes lack."""
        by_program = self.section is not None or self.integrals is not None
        if self.engine == "xla" and not by_program and not system_of(self.scene).lands:
            return None
        request = lane_request(self)
        hindered = self.replaceable and BY_NAME[self.engine].can(request) is not None
        return None if hindered else request

    def compile(self) -> "CompiledSimulation":
        """Compiles the solve, so its run can be timed by itself."""
        if (request := self.lane_request()) is not None:
            return CompiledSimulation(prepare_lanes(self, request), self)
        return CompiledSimulation(by_xla.lower(self).compile(), self)


class CompiledSimulation:
    """A compiled request; call it to run."""

    def __init__(self, program: Callable[[Simulation], Trajectory], request: Simulation) -> None:
        self._program, self._request = program, request

    def __call__(self) -> Trajectory:
        """Runs the solve and waits for it."""
        walk = trim(jax.block_until_ready(self._program(self._request)))
        return dataclasses.replace(walk, scene_key=scene_key(self._request.scene))
