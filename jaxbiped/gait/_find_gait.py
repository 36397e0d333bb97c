"""The search for the walker's periodic gait."""

import functools
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Literal

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
import optax
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice, check_positive, check_type
from jaxbiped._types import as_float
from jaxbiped.dynamics._bristles import state_for
from jaxbiped.dynamics._consistent import consistent_state
from jaxbiped.dynamics._redundant_state import minimal_state
from jaxbiped.dynamics._rigid_state import RigidState
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.dynamics._state import checked_state
from jaxbiped.gait._engine import orbit_engine
from jaxbiped.gait._gait import Gait, described
from jaxbiped.gait._newton import Method
from jaxbiped.gait._precision import GAIT_ACCURACIES, MOST_SOLVER_STEPS, precision_of
from jaxbiped.gait._search import Found, search
from jaxbiped.gait._seed_start import seed_start
from jaxbiped.gait._solver import orbit_solver
from jaxbiped.gait._system import RedundantWalking, checked_section, system_of
from jaxbiped.gait._turn import Turning
from jaxbiped.lanes._call import lowered_ahead
from jaxbiped.scene._parameters import chosen_parameters
from jaxbiped.scene._redundant_scene import RedundantScene
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._passage import Precision
from jaxbiped.solve._projected import projecting

_RESIDUAL_SHARE = 0.3
"""Residual that counts as none, in units of the state's tolerance."""
_PATIENCE = 50.0
"""Time allowed to the next arrival, in units of √(l/g)."""


def find_gait(
    scene: Scene | RigidScene | RedundantScene,
    guess: Any = None,
    *,
    period: int = 1,
    section: AbstractSection | None = None,
    parameters: tuple[str, ...] | None = None,
    accuracy: str = "balanced",
    method: Literal["newton", "optax"] = "newton",
    optimiser: optax.GradientTransformation | None = None,
    most_turns: int | None = None,
    radius_sensitivities: bool = True,
    solver: str | diffrax.AbstractSolver | None = None,
    engine: str = "auto",
) -> Gait:
    """Finds a periodic gait, its Floquet multipliers and its sensitivities to the parameters.

    Newton's method on the return map, damped as Levenberg and Marquardt do where a step fails;
    derivatives are carried along the motion under a tolerance of their own, and no step straddles
    a switch. Works under `jit` and `vmap`, over scenes and over guesses.

    Args:
        scene: the walker, compliant or rigid. In redundant coordinates every passage starts on the
            constraints, and returns, multipliers and sensitivities are told in minimal ones: the
            constraint directions are left out. Second derivatives (the spectral radius's) take the
            minimal equations along the redundant motion: on the constraints these are the method's
            own, but for what a penalty leaves (a share of 1/(A s), see `Penalty`).
        guess: a start near the gait, on the section or not; unless given, the seed's start, its
            stance foot set down as deep for the scene's own legs and rolling as fast.
        period: footsteps in a cycle.
        section: where the cycle begins, `MidStance()` unless given. A rigid walker's cycles begin
            just after its impact, at `HeelStrike()`.
        parameters: names of the parameters to differentiate by (see `parameter_names`); all of
            them unless given, none for ().
        accuracy: "balanced" or "tight".
        method: "newton", or "optax" to minimise the squared residual by gradient.
        optimiser: for "optax"; Adam with a rate of 1e-2 unless given.
        most_turns: cycles allowed; 40 for "newton", 400 for "optax".
        radius_sensitivities: whether to differentiate the spectral radius, which takes second
            derivatives of the motion.
        solver: a name (see `SOLVERS`) or any diffrax solver without memory; unless given "rodas4",
            for a rigid walker "rodas5p".
        engine: "xla", "lanes" or "auto" (see `ENGINES`).

    Returns:
        The gait, or the best that was found instead: look at its `ending`.

    Raises:
        ArgumentError: an argument that is not allowed, before anything is compiled.
    """
    check_type("scene", scene, Scene, RigidScene, RedundantScene)
    check_choice("accuracy", accuracy, GAIT_ACCURACIES)
    check_choice("method", method, ("newton", "optax"))
    check_positive("period", period)
    if int(period) != period:
        raise ArgumentError(f"period = {period} is not allowed: it must be a whole number.")
    rigid = isinstance(scene, RigidScene)
    start = _checked_start(scene, seed_start(scene) if guess is None else guess)
    if jnp.ndim(start.hip_x) != 0:
        raise ArgumentError(
            f"guess has leaves of shape {jnp.shape(start.hip_x)}: give one state, and use jax.vmap "
            "for many."
        )
    most = (40 if method == "newton" else 400) if most_turns is None else most_turns
    check_positive("most_turns", most)
    scene = jtu.tree_map(as_float, scene)
    # A redundant scene's leaves begin with those of what it models.
    modelled = scene.scene if isinstance(scene, RedundantScene) else scene
    names, active = chosen_parameters(modelled, parameters)
    precision = precision_of(accuracy, scene)
    method_of_steps = orbit_solver(solver, rigid=rigid)
    section = checked_section(scene, section)
    chosen = orbit_engine(
        engine,
        solver=method_of_steps,
        section=section,
        leaves=(scene, start),
        redundant=isinstance(scene, RedundantScene),
    )
    within = None
    if isinstance(scene, RedundantScene):
        method_of_steps, within = projecting(scene, method_of_steps), RedundantWalking()
    turning = Turning(
        system=system_of(scene),
        section=section,
        solver=method_of_steps,
        time_limit=_PATIENCE * jnp.sqrt(scene.walker.l / scene.ground.g),
        steps=int(period),
        max_solver_steps=MOST_SOLVER_STEPS[accuracy],
        engine=chosen,
        within=within,
    )
    how = Method(
        optimiser=None if method == "newton" else (_adam() if optimiser is None else optimiser),
        most_turns=int(most),
        residual=_RESIDUAL_SHARE * precision.rtol,
    )
    return _find(turning, scene, start, precision, how, names, active, radius_sensitivities)


def _checked_start(scene: Any, start: Any) -> Any:
    if isinstance(scene, RigidScene):
        return checked_state(start, RigidState, "guess")
    if isinstance(scene, RedundantScene):
        return minimal_state(scene, consistent_state(scene, start).state)
    return state_for(scene, start, "guess")


@functools.cache  # the same object each time, so that nothing is compiled again
def _adam() -> optax.GradientTransformation:
    return optax.adam(1e-2)


def _find(
    turning: Turning,
    scene: Any,
    start: Any,
    precision: Precision,
    method: Method,
    names: tuple[str, ...],
    active: tuple[int, ...],
    radius: bool,
) -> Gait:
    searching = (turning, scene, active, start, precision, method)
    describing = (names, active, radius)
    kind = None if _is_traced(searching) else _kind_of((searching, names, radius))
    if kind is not None and kind not in _COMPILED:
        _compile(searching, describing)
        _COMPILED.add(kind)
    found = _searched(*searching)
    return described(turning, scene, start, found, *describing)


def _compile(searching: tuple, describing: tuple) -> None:
    """Compiles both programs, and what lanes run for them, at the same time."""
    turning, scene, _, start, *_ = searching
    nothing = _nothing(eqx.filter_eval_shape(_searched, *searching))
    first: Any = _searched
    second: Any = described
    with ThreadPoolExecutor() as meanwhile:
        with lowered_ahead() as programs:
            # What takes lanes longest begins first.
            lowered = second.lower(turning, scene, start, nothing, *describing)
            ready = [meanwhile.submit(lowered.compile)]
            ready.append(meanwhile.submit(first.lower(*searching).compile))
        for program in programs:
            program.check()
        for each in ready:
            each.result()


_COMPILED: set[Any] = set()
"""Kinds of searches whose programs are compiled."""


def _kind_of(tree: PyTree) -> Any:
    """What decides whether one compiled program can serve for another."""
    arrays, rest = eqx.partition(tree, eqx.is_array)
    shapes = tuple((leaf.shape, leaf.dtype) for leaf in jtu.tree_leaves(arrays))
    leaves, structure = jtu.tree_flatten(rest)
    return jtu.tree_structure(arrays), shapes, tuple(leaves), structure


def _is_traced(tree: PyTree) -> bool:
    return any(isinstance(leaf, jax.core.Tracer) for leaf in jtu.tree_leaves(tree))


@eqx.filter_jit
def _searched(*searching: Any) -> Found:
    # Without weak types, which would make the next program another one than was compiled.
    return jtu.tree_map(
        lambda leaf: jax.lax.convert_element_type(leaf, leaf.dtype), search(*searching)
    )


def _nothing(shape: PyTree) -> PyTree:
    """Arrays of these shapes that hold nothing."""
    return jtu.tree_map(
        # Made by NumPy: JAX would compile a program for every shape.
        lambda leaf: np.full(leaf.shape, np.nan if leaf.dtype.kind == "f" else 0, leaf.dtype),
        shape,
    )
