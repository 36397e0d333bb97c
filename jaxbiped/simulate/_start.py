"""Start of a simulation, and what else is asked of it, checked."""

from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import ArrayLike, PyTree

from jaxbiped._checks import (
    ArgumentError,
    check_choice,
    check_count,
    check_positive,
    check_type,
    check_unbatched,
    holds_somewhere,
    warn,
)
from jaxbiped._jax_versions import untraced
from jaxbiped._types import Scalar, is_traced
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.constraints._constraint_methods import check_independent
from jaxbiped.dynamics._constrained_motion import Consistent, consistent_state, coordinates_of
from jaxbiped.dynamics._contacts import feet, limits_of
from jaxbiped.dynamics._footfalls import touches
from jaxbiped.dynamics._state import check_state, state_for, without_whole_turns
from jaxbiped.hybrid._endings import WATCHES
from jaxbiped.hybrid._hybrid_system import HybridSystem, section_of_system, start_of_system
from jaxbiped.hybrid._scales import is_smooth, patience_of
from jaxbiped.hybrid._sections import AbstractSection, check_section_body
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene._modes import check_mode, rigid_modes
from jaxbiped.scene._scene import CompliantScene, RedundantScene, RigidScene, Scene
from jaxbiped.solve.controllers._event_steps import PATIENCE

_PRECISIONS = (np.float16, np.float32, np.float64)
"""Of NumPy's, those that JAX has."""
_DEEPEST = 0.25
"""Penetration of a foot that touches, in units of l, from which it starts below the ground."""
_HIGHEST = 100.0
"""Energy stored in a foot's contact, in units of m g l, from which it does."""
_TOLD_DEPTH = 0.01
"""Penetration of a foot that is reported, in units of the walker's height."""
_TOLD_ANGLE = 0.1
"""Angle beyond a stop that is reported [rad]."""


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


def start_for(
    scene: Scene | RedundantScene | RigidScene | HybridSystem, state: PyTree
) -> tuple[PyTree, Consistent | None]:
    """A checked start of the kind that a scene needs, and how it was put on its constraints.

    Raises:
        ArgumentError: a start that is not allowed, or constraints that the method cannot hold.
    """
    if isinstance(scene, HybridSystem):
        check_unbatched("scene", scene, "one system")
        start = start_of_system(scene, state)
        check_unbatched("state", start, "one start")
        return start, None
    check_single_scene(scene)
    if isinstance(scene, RigidScene):
        state = check_state(in_own_precision(state), scene.state_type)
        start = in_one_precision(without_whole_turns(scene, state))
        check_unbatched("state", start, "one start")
        if (modes := rigid_modes(scene.mechanism)).any:
            check_mode(scene.mechanism, modes, scene.ground.slope, start)
        return start, None
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


def saved_section(scene: Any, asked: Options) -> AbstractSection | None:
    """The section at which to save, checked with all that a hybrid system has not.

    Raises:
        ArgumentError: a section that is none of the scene's, or an option that it has not.
    """
    if not isinstance(scene, HybridSystem):
        check_section_body(scene.minimal, asked.section)
        return asked.section
    asked.refuse(scene, "footsteps", "dt", "adjoint")
    return None if asked.section is None else section_of_system(scene, asked.section)


def check_limits(
    duration: Scalar | float | None, footsteps: int | None, max_solver_steps: int
) -> None:
    """Raises `ArgumentError` for what cannot end a simulation."""
    if duration is None and footsteps is None:
        raise ArgumentError("duration = None and footsteps = None: give one of them.")
    if footsteps is not None:
        check_count("footsteps", footsteps)
    check_unbatched("duration", duration)
    check_count("max_solver_steps", max_solver_steps)


def longest_time(scene: Any, asked: Options) -> Scalar | float:
    """The duration that is asked for, or the time that bounds the wait for footsteps [s].

    Raises:
        ArgumentError: a duration that is not positive, or ground on which no rigid foot comes down.
    """
    if asked.duration is not None:
        check_positive("duration", asked.duration, "s")
        return asked.duration
    if not is_smooth(scene):
        return PATIENCE * (asked.footsteps or 0)
    return patience_of(scene, asked.footsteps or 0)


def watched_by(scene: Any, watch: Any) -> tuple[str, ...]:
    """The failures to watch for: those named; of a hybrid system, by default all of its endings.

    Raises:
        ArgumentError: a name that is none of a failure.
    """
    check_type("watch", watch, tuple, list)
    allowed = system_of(scene).watches
    watch = allowed if tuple(watch) == WATCHES else watch
    for name in watch:
        check_choice("watch", name, allowed)
    return tuple(watch)


def check_steps(
    solver: diffrax.AbstractSolver[PyTree] | None,
    dt: float | None,
    *,
    most_steps: int,
    duration: Scalar | float,
) -> None:
    """Raises `ArgumentError` for steps that a solver cannot make or the cap on steps forbids."""
    if dt is None:
        if isinstance(solver, diffrax.Euler):
            raise ArgumentError(
                "dt = None is not allowed for solver = euler, whose steps have a fixed size: give "
                "it in seconds, such as dt = 1e-6."
            )
        return
    check_unbatched("dt", dt)
    check_positive("dt", dt, "s")
    if holds_somewhere(duration > dt * most_steps):
        raise ArgumentError(
            f"dt = {float(dt):g} is not allowed: {float(duration):g} s of such steps are more than "
            f"max_solver_steps = {most_steps}; simulate less time, or allow more."
        )


@untraced()
def check_start_height(scene: Scene | RedundantScene, state: Any) -> None:
    """Refuses a start in minimal coordinates below the ground, where all values are known.

    The deepest that is allowed is l/4, and so deep that the contact stores what would throw the
    walker a hundred legs high, 100 m g l: contact so stiff is to be started near its surface.

    Raises:
        ArgumentError: a deeper start.
    """
    if is_traced((scene, state)):
        return
    root = f"{scene.mechanism.structure.root}_z"
    if not hasattr(state, root):
        return
    # Plain numbers: operations of JAX by themselves would be compiled one by one.
    mechanism = scene.mechanism
    structure, length = mechanism.structure, float(mechanism.height)
    lift = float(mechanism.total_mass) * float(scene.ground.g) * length
    height = float(getattr(state, root))
    if height <= 0.0:
        raise ArgumentError(
            f"state.{root} = {height:g} is not allowed: the walker starts below the ground, its "
            f"{structure.root} under the surface; start higher."
        )
    begun = _contacts_at(scene, state)
    depths, energies, passed = (list(map(float, each)) for each in begun)
    names = structure.feet_told
    stored, depth, foot = max(zip(energies, depths, names, strict=True))
    if stored > 0.0 and (depth > _DEEPEST * length or stored > _HIGHEST * lift > 0.0):
        raise ArgumentError(
            f"state.{root} = {height:g} is not allowed: foot {foot} starts {depth:.3g} m below the "
            f"ground, where its contact stores {stored:.3g} J (m g l is {lift:.3g} J); it just "
            f"touches at {root} = {height + depth:.9g}."
        )
    if stored > 0.0 and depth > _TOLD_DEPTH * length:
        warn(
            f"foot {foot} starts {depth:.3g} m below the ground; it just touches at "
            f"{root} = {height + depth:.9g}.",
            UserWarning,
        )
    if passed and max(passed) > _TOLD_ANGLE:
        warn(
            f"a stop is passed by {max(passed):.3g} rad at the start: begin within its limits.",
            UserWarning,
        )


class _Begun(NamedTuple):
    """Contacts at a start, in lists.

    Attributes:
        depths: of each foot [m].
        energies: in its contact, 0 where it does not touch [J].
        passed: how far each limit of a stop is passed [rad].
    """

    depths: list[Scalar]
    energies: list[Scalar]
    passed: list[Scalar]


@cached_jit
def _contacts_at(scene: CompliantScene, state: PyTree) -> _Begun:
    found = feet(scene, state)
    energies = [
        jnp.where(touches(foot), scene.normal.elastic_energy(foot.penetration), 0.0)
        for foot in found
    ]
    passed = [limit.penetration for _, limit in limits_of(scene, state)]
    return _Begun([foot.penetration for foot in found], energies, passed)


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
