"""Start of a simulation, and what else is asked of it, checked."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import ArrayLike, PyTree

from jaxbiped._checks import (
    ArgumentError,
    check_count,
    check_positive,
    check_unbatched,
    holds_somewhere,
)
from jaxbiped._types import Scalar
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.constraints._projection import check_independent
from jaxbiped.dynamics._consistent_state import Consistent, consistent_state
from jaxbiped.dynamics._redundant_motion import coordinates_of
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.dynamics._state import BristleState, State, state_for
from jaxbiped.scene._ground import AbstractClearance
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.scene.laws._abstract_laws import AbstractNormalLaw
from jaxbiped.solve._failure_events import WATCHES

_PRECISIONS = (np.float16, np.float32, np.float64)
"""Of NumPy's, those that JAX has."""
_DEEPEST = 0.25
"""Penetration of a foot that touches, in units of l, from which it starts below the ground."""
_HIGHEST = 100.0
"""Energy stored in a foot's contact, in units of m g l, from which it does."""


class Options(NamedTuple):
    """What is asked of a simulation: the keywords of `simulate`, as they are given."""

    duration: float | None = None
    footsteps: int | None = None
    solver: str | diffrax.AbstractSolver[PyTree] = "rodas4p"
    accuracy: Any = "balanced"
    rtol: float | None = None
    atol: float | None = None
    dt: float | None = None
    save: Any = "steps"
    max_arrivals: int = 64
    extremes: Callable[..., PyTree] | None = None
    watch: tuple[str, ...] = WATCHES
    max_solver_steps: int = 65536
    adjoint: diffrax.AbstractAdjoint | None = None
    engine: str = "auto"

    @property
    def save_steps(self) -> bool:
        """Whether every step is saved."""
        return isinstance(self.save, str) and self.save == "steps"

    @property
    def section(self) -> AbstractSection | None:
        """The section at which to save arrivals."""
        return self.save if isinstance(self.save, AbstractSection) else None

    @property
    def times(self) -> Any:
        """The times to save at, as they are given."""
        return None if isinstance(self.save, str | AbstractSection) else self.save

    def refuse(self, scene: Any, *names: str) -> None:
        """Raises `ArgumentError` for one of these options: they do not apply to such a scene."""
        for name in names:
            value, usual = getattr(self, name), self._field_defaults[name]
            if value is not usual and (usual is None or value != usual):
                kind = type(scene).__name__
                raise ArgumentError(
                    f"{name} = {value!r} is not allowed for a {kind}: leave it out."
                )


def start_for(scene: Scene | RedundantScene, state: PyTree) -> tuple[PyTree, Consistent | None]:
    """A checked start of the kind that a scene needs, and how it was put on its constraints.

    Raises:
        ArgumentError: a start that is not allowed, or constraints that the method cannot hold.
    """
    check_single_scene(scene)
    if not isinstance(scene, RedundantScene):
        start = state_for(scene, in_own_precision(state))
        check_unbatched("state", start, "one start")
        return in_one_precision(start), None
    state = in_own_precision(state)
    check_unbatched("state", state, "one start")
    correction = consistent_state(scene, state)
    q, _ = coordinates_of(scene, correction.state)
    check_independent(scene.linkage, scene.method, q)
    return correction.state, correction


def in_own_precision(state: PyTree) -> PyTree:
    """A start with NumPy's floating-point leaves as arrays of JAX, which keep their precision."""

    def kept(leaf: object) -> object:
        own = isinstance(leaf, np.ndarray | np.generic) and leaf.dtype in _PRECISIONS
        return jnp.asarray(leaf) if own else leaf

    return jtu.tree_map(kept, state)


def in_one_precision(state: PyTree) -> PyTree:
    """A start with all leaves as precise as the most precise one."""
    kinds = {leaf.dtype for leaf in jtu.tree_leaves(state)}
    if len(kinds) == 1:
        return state
    finest = max(kinds, key=lambda kind: jnp.finfo(kind).bits)
    return jtu.tree_map(lambda leaf: leaf.astype(finest), state)


def check_single_scene(scene: Scene | RigidScene | RedundantScene) -> None:
    """Raises `ArgumentError` for a batch of scenes.

    Laws of the user's own may hold arrays.
    """
    parts = [*vars(scene.minimal).items(), *(("actuation", part) for part in scene.actuation or ())]
    for name, part in parts:
        if type(part).__module__.partition(".")[0] == "jaxbiped":
            check_unbatched(f"scene.{name}", part, "one scene")


def check_limits(
    duration: Scalar | float | None, footsteps: int | None, max_solver_steps: int
) -> None:
    """Raises `ArgumentError` for what cannot end a simulation."""
    if duration is None and footsteps is None:
        raise ArgumentError("duration = None and footsteps = None: say how long to simulate.")
    if footsteps is not None:
        check_count("footsteps", footsteps)
    check_unbatched("duration", duration)
    check_count("max_solver_steps", max_solver_steps)


def check_steps(
    solver: diffrax.AbstractSolver[PyTree],
    dt: float | None,
    *,
    most_steps: int,
    duration: Scalar | float,
) -> None:
    """Raises `ArgumentError` for steps that a solver cannot make or the cap on steps forbids."""
    if dt is None:
        if isinstance(solver, diffrax.Euler):
            raise ArgumentError(
                "dt = None is not allowed for solver = euler, whose steps have one size: give it "
                "in seconds, such as dt = 1e-6."
            )
        return
    check_unbatched("dt", dt)
    check_positive("dt", dt, "s")
    if holds_somewhere(duration > dt * most_steps):
        raise ArgumentError(
            f"dt = {float(dt):g} is not allowed: {float(duration):g} s of such steps are more than "
            f"max_solver_steps = {most_steps}; simulate less time, or allow more."
        )


def check_start_height(scene: Scene | RedundantScene, state: State | BristleState) -> None:
    """Refuses a start below the ground, where all values are known.

    The deepest that is allowed is l/4, and so deep that the contact stores what would throw the
    walker a hundred legs high, 100 m g l: contact so stiff is to be started near its surface.

    Raises:
        ArgumentError: a deeper start.
    """
    leaves = jtu.tree_leaves((scene, state))
    if any(isinstance(leaf, jax.core.Tracer) for leaf in leaves):
        return
    # Plain numbers: operations of JAX by themselves would be compiled one by one.
    walker, g = jtu.tree_map(float, scene.walker), float(scene.ground.g)
    lift, hip_z = walker.total_mass * g * walker.l, float(state.hip_z)
    if hip_z <= 0.0:
        raise ArgumentError(
            f"state.hip_z = {hip_z:g} is not allowed: the walker starts below the ground, its hip "
            "under the surface; start higher."
        )
    angles, rates = (state.theta_1, state.theta_2), (state.omega_1, state.omega_2)
    depths = [walker.r - hip_z + walker.hip_to_foot * math.cos(float(angle)) for angle in angles]
    if max(depths) <= 0.0:
        return
    given = scene.clearance, scene.normal, depths, rates
    energies = _contact_energies(*jtu.tree_map(np.asarray, given))
    stored, depth, leg = max(zip(map(float, energies), depths, (1, 2), strict=True))
    if stored > 0.0 and (depth > _DEEPEST * walker.l or stored > _HIGHEST * lift > 0.0):
        raise ArgumentError(
            f"state.hip_z = {hip_z:g} is not allowed: foot {leg} starts {depth:.3g} m below the "
            f"ground, where its contact stores {stored:.3g} J (m g l is {lift:.3g} J); it just "
            f"touches at hip_z = {hip_z + depth:.9g}."
        )


@cached_jit
def _contact_energies(
    clearance: AbstractClearance,
    law: AbstractNormalLaw,
    depths: Sequence[Scalar],
    rates: Sequence[Scalar],
) -> list[Scalar]:
    """The energy in the contact of each foot, 0 where it does not touch [J]."""

    def stored(leg: int, depth: Scalar, rate: Scalar) -> Scalar:
        admitted = clearance.admits(leg, rate)
        touches = (depth > 0.0) & (True if admitted is None else admitted)
        return jnp.where(touches, law.elastic_energy(depth), 0.0)

    return [stored(1, depths[0], rates[0]), stored(2, depths[1], rates[1])]


def check_times(times: ArrayLike, duration: Scalar | float) -> None:
    """Raises `ArgumentError` unless they increase and lie within the duration [s]."""
    if isinstance(times, jax.core.Tracer) or isinstance(duration, jax.core.Tracer):
        return
    try:
        values = np.asarray(times, dtype=float)
    except (TypeError, ValueError):
        raise ArgumentError(
            f'save = {times!r} is not allowed: give "steps", "end", a section or increasing times.'
        ) from None
    allowed = values.ndim == 1 and np.all(np.diff(values) >= 0.0)
    if not allowed or not np.all((values >= 0.0) & (values <= float(duration))):
        raise ArgumentError(
            f"save = {values} is not allowed: it must be increasing times from 0 to {duration} s."
        )
