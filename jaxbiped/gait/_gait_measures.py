"""Gait measures as a function of the scene that JAX can differentiate."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import jax.tree_util as jtu
from jax.lax import stop_gradient
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._types import Scalar, as_float, is_traced
from jaxbiped.dynamics._state import cyclic_names, recurring_names
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._gait import Gait, Measures
from jaxbiped.gait._return_map import Return, return_map
from jaxbiped.gait._return_map_spec import AbstractGradient, Implicit
from jaxbiped.hybrid._hybrid_system import SCENES
from jaxbiped.hybrid._sections import AbstractSection
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.linalg._small_matrices import solution
from jaxbiped.scene._parameter_access import select_parameters
from jaxbiped.scene._scene import AbstractScene
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.simulate._derivatives import first_derivatives_only


def gait_measures(
    scene: AbstractScene,
    guess: Gait | WalkerState | PyTree | None = None,
    *,
    gradient: AbstractGradient | None = None,
    footsteps: int | None = None,
    section: AbstractSection | None = None,
    accuracy: str = "balanced",
    engine: str = "auto",
) -> Measures:
    """Measures of the gait that `find_gait` finds, differentiable with respect to the scene.

    - `Implicit()` (the default): forward and reverse mode, all measures, one search.
    - `Forward()`, `Reverse()`: the gait is found without derivatives, and one differentiable Newton
      step then carries them. Peak force and spectral radius are None.

    The measures are NaN if no gait is found. The gait of a redundant scene does not depend on the
    constraint method, so with `Implicit()`, the derivatives with respect to a method's constants
    are zero.

    Args:
        scene, guess, footsteps, section, accuracy, engine: as for `find_gait`.
        gradient: gradient mode.

    Returns:
        The gait's measures, scalars in SI units.

    Raises:
        ArgumentError: an argument is not allowed; raised before anything is compiled.
        RuntimeError: reverse mode is used with `Forward()`.
        TypeError: forward mode is used with `Reverse()`.
    """
    gradient = Implicit() if gradient is None else gradient
    if not isinstance(gradient, AbstractGradient):
        raise ArgumentError(
            f"gradient = {gradient!r} is not allowed: choose Implicit(), Forward() or Reverse()."
        )
    check_type("scene", scene, *SCENES)
    scene = jtu.tree_map(as_float, scene)
    implicit = isinstance(gradient, Implicit)
    if implicit:
        scene = _differentiated_once(scene)
    gait = find_gait(
        stop_gradient(scene),
        jtu.tree_map(lambda leaf: stop_gradient(leaf) if is_traced(leaf) else leaf, guess),
        footsteps=footsteps,
        section=section,
        parameters=None if implicit else (),
        accuracy=accuracy,
        radius_sensitivities=implicit,
        engine=engine,
    )
    if implicit:
        return _by_theorem(scene, gait)

    once = return_map(
        scene,
        gait.measures.state,
        section=section,
        footsteps=footsteps,
        gradient=gradient,
        accuracy=accuracy,
        engine=engine,
    )
    return _by_correction(scene, gait, once)


def _by_theorem(scene: Any, gait: Gait) -> Measures:
    modelled = scene.minimal
    _, active = select_parameters(modelled, gait.parameters)
    leaves = jtu.tree_leaves(modelled)
    parameters = jnp.stack([leaves[i] for i in active])
    return _nan_unless_found(
        gait, _attach_derivatives(gait.measures, gait.sensitivities, parameters)
    )


@eqx.filter_custom_jvp
def _attach_derivatives(values: Measures, slopes: Measures, parameters: Scalar) -> Measures:
    """The values, with derivatives known beforehand: linear, so both modes follow from it."""
    return values


@_attach_derivatives.def_jvp
def _attach_derivatives_jvp(
    primals: tuple[PyTree, ...], tangents: tuple[PyTree, ...]
) -> tuple[Measures, Measures]:
    values, slopes, _ = primals
    state_dot = tangents[2]
    return values, jtu.tree_map(lambda slope: slope @ state_dot, slopes)


@eqx.filter_custom_jvp
def _differentiated_once(scene: PyTree) -> PyTree:
    """The same, refused at its second derivative: before the gait's slopes, which have none."""
    return scene


@_differentiated_once.def_jvp
def _differentiated_once_jvp(
    primals: tuple[PyTree], tangents: tuple[PyTree]
) -> tuple[PyTree, PyTree]:
    moving, still = eqx.partition(primals[0], eqx.is_array)
    once = first_derivatives_only(moving, "gait_measures by Implicit()")
    return eqx.combine(once, still), tangents[0]


def _by_correction(scene: PyTree, gait: Gait, once: Return) -> Measures:
    """Newton's correction at the gait changes nothing but has the gait's derivatives."""
    state = gait.measures.state
    recurring = recurring_names(state)
    after = system_of(scene.minimal).unwrapped(state, once.state)
    change = jnp.stack([getattr(after, n) - getattr(state, n) for n in recurring])
    size = len(recurring)
    step = solution(jnp.eye(size) - gait.return_jacobian[:size], change)
    corrected = {n: getattr(state, n) + step[i] for i, n in enumerate(recurring)}
    by_period, *by_advance = gait.return_jacobian[size:]
    time, length = once.time + by_period @ step, None
    for name, row in list(zip(cyclic_names(state), by_advance, strict=True))[:1]:
        length = getattr(after, name) + row @ step
    speed = None if length is None else length / time
    measures = Measures(time, length, speed, None, None, state._replace(**corrected))
    return _nan_unless_found(gait, measures)


def _nan_unless_found(gait: Gait, measures: Measures) -> Measures:
    # A factor, not a choice: derivatives become NaN as well.
    factor = jnp.where(gait.ending == 0, 1.0, jnp.nan)
    return jtu.tree_map(lambda leaf: leaf * factor, measures)
