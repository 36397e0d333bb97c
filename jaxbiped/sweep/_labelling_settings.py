"""Settings of a labelling: how far and how accurately starts are followed."""

from typing import NamedTuple

import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError, check_positive
from jaxbiped.basins._arguments import check_whole
from jaxbiped.compiler import DEVICES
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.solve._accuracy import ACCURACIES, check_accuracy_name, resolve_slip_speed
from jaxbiped.solve._engine_names import engine_for
from jaxbiped.solve._error_estimate import check_wanted
from jaxbiped.solve._solvers import solver_named
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock

_GAP = 1e-4
"""Gap between states that repeat each other, at least."""
_GAP_SHARE = {True: 30.0, False: 3.0}
"""The same in units of the tolerance, compliant or not: rolling errs by less, and slow transients
past an unstable gait move by as little as a wider gap."""
_FIRST = 3e-3
"""First tolerance as a share of the accuracy wanted, at most that of "draft": of 100,000 labels of
the seed's slice 37 were wrong and not in doubt at 1e-5 by Rodas4, and 11 at 1e-6."""
FINEST_FIRST = {True: 1e-9, False: 1e-11}
"""Finest tolerance at which every start is labelled, compliant or not."""


class Effort(NamedTuple):
    """How starts are followed. All hashable.

    Attributes:
        rtol: relative tolerance; the absolute one is a hundredth of it in the scene's units.
        footsteps: after which a start that is not certain is given up.
        max_attempts: cap on the solver's attempted steps.
        gap: see `after_arrival`; `gap_share`: in units of the tolerance.
        solver: of the compliant walker.
        engine: "lanes", "cuda" or "xla".
        may_move: whether large batches go from lanes to a CUDA device where there is one.
        wanted: share of the labels that may be wrong; None where the tolerance decides.
        embedded: whether the rigid walker steps by the embedded method; see `rolling_step`.
    """

    rtol: float
    footsteps: int
    max_attempts: int
    gap: float
    gap_share: float
    solver: AbstractRosenbrock
    engine: str
    wanted: float | None = None
    embedded: bool = False
    may_move: bool = False

    @property
    def may_use_device(self) -> bool:
        """Whether a CUDA device may follow them."""
        moves = self.may_move and self.engine == "lanes" and DEVICES.hindrance() is None
        return moves or self.engine == "cuda"

    def engine_of(self, count: int) -> str:
        """The engine that follows `count` starts: large batches go where a device is kept busy."""
        return "cuda" if self.may_use_device and DEVICES.fills(count) else self.engine

    def at_tolerance(self, rtol: float) -> "Effort":
        """The same at another tolerance."""
        return self._replace(rtol=float(rtol), gap=_gap(float(rtol), self.gap_share))


def effort_of(
    scene: Scene | RigidScene,
    *,
    footsteps: int = 30,
    accuracy: str | float = "draft",
    rtol: float | None = None,
    solver: str | AbstractRosenbrock = "rodas4p",
    max_solver_steps: int = 65536,
    engine: str = "auto",
) -> Effort:
    """How to follow starts, from what a user says.

    Raises:
        ArgumentError: an argument that is not allowed.
    """
    scene = check_scene(scene, Scene, RigidScene)
    check_whole("footsteps", footsteps, 1)
    check_whole("max_solver_steps", max_solver_steps, 1)
    if any(np.ndim(leaf) for leaf in jtu.tree_leaves(scene)):
        raise ArgumentError(
            "scene has parameters that are arrays: give one scene, and name what differs from "
            "start to start among the parameters."
        )
    wanted = _share_wanted(accuracy, rtol)
    named = ACCURACIES["draft" if wanted is not None else str(accuracy)]
    own = named.walk if scene.compliant else named.rigid_walk
    if wanted is not None:
        own = min(own, max(_FIRST * wanted, FINEST_FIRST[scene.compliant]))
    tolerance = resolve_slip_speed(own, scene) if rtol is None else rtol
    check_positive("rtol", tolerance)
    method = solver_named(solver)
    if not isinstance(method, AbstractRosenbrock):
        raise ArgumentError(
            f"solver = {type(method).__name__} is not allowed: labelling takes rodas3p to rodas5p."
        )
    return Effort(
        rtol=float(tolerance),
        footsteps=int(footsteps),
        max_attempts=int(max_solver_steps),
        gap=_gap(float(tolerance), _GAP_SHARE[scene.compliant]),
        gap_share=_GAP_SHARE[scene.compliant],
        solver=method,
        engine=engine_for(engine, obstacle=None, by_device=True, by_any=True),
        may_move=engine == "auto",
        wanted=wanted,
    )


def _share_wanted(accuracy: str | float, rtol: float | None) -> float | None:
    """The share of wrong labels that is allowed; None where an accuracy is asked for by name."""
    if isinstance(accuracy, str):
        check_accuracy_name(accuracy)
        return None
    check_wanted(accuracy, rtol=rtol)
    if not accuracy < 1.0:
        raise ArgumentError(
            f"accuracy = {accuracy:g} is not allowed: it is the share of the labels that may be "
            "wrong, and must be below 1."
        )
    return float(accuracy)


def _gap(rtol: float, share: float) -> float:
    return max(_GAP, share * rtol)
