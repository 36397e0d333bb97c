"""Accuracy: named tolerances, the norm that errors are measured in, and what float32 can bear."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice, check_positive
from jaxbiped._types import Scalar


class Tolerances(NamedTuple):
    """Tolerances of the step-size control: relative, and absolute.

    Both must resolve the slip speed over which friction builds up, or steps chatter about it. By
    default the absolute one is a hundredth of the relative one, in the scene's `Units`.
    """

    rtol: float
    atol: float


ACCURACIES = {"fast": 1e-5, "balanced": 1e-6, "tight": 2e-9}
"""Relative tolerance of each named accuracy, at most.

Looser than "fast" is no faster: the tolerance of a velocity comes near v0, and steps chatter.
"""


_RESOLVED = 0.5
"""Error of a walker's speed √(g l), in units of the slip speed over which friction builds up, from
which steps may chatter about that."""


def tolerances(
    accuracy: str, rtol: float | None, atol: float | None, scene: Any = None
) -> Tolerances:
    """The tolerances that a name stands for in a scene, either one replaced where it is given.

    Raises:
        ArgumentError: an unknown name, or a tolerance that is not above zero.
    """
    check_choice("accuracy", accuracy, ACCURACIES)
    relative = resolve_slip_speed(ACCURACIES[accuracy], scene) if rtol is None else rtol
    check_positive("rtol", relative)
    absolute = 1e-2 * relative if atol is None else atol
    check_positive("atol", absolute)
    return Tolerances(relative, absolute)


def resolve_slip_speed(rtol: float, scene: Any) -> Any:
    """A relative tolerance, or the largest below it that resolves how friction builds up."""
    law = getattr(scene, "friction", None)
    name = getattr(law, "builds_up_over", None)
    if name is None:
        return rtol
    leaves = (getattr(law, name), scene.ground.g, scene.walker.l)
    traced = any(isinstance(leaf, jax.core.Tracer) for leaf in leaves)
    xp: Any = jnp if traced else np  # where numbers are known nothing is compiled for them
    slow, g, l = (jax.lax.stop_gradient(leaf) if traced else np.asarray(leaf) for leaf in leaves)
    fast = xp.sqrt(g * l)
    finest = _RESOLVED * slow / xp.where(fast > 0.0, fast, 1.0)
    return xp.where(_RESOLVED * slow < rtol * fast, finest, rtol)


def rms_norm(error: PyTree) -> Scalar:
    """Root mean square over all leaves, without gluing them into one array first.

    Args:
        error: numbers of any shapes, scaled by their tolerances [–].

    Returns:
        The norm [–], a scalar.
    """
    leaves = jtu.tree_leaves(error)
    size = sum(jnp.size(leaf) for leaf in leaves)
    total = sum(jnp.sum(leaf * leaf) for leaf in leaves)
    return jnp.sqrt(total / size)


def check_precision(scene: Any, dtype: np.dtype) -> None:
    """Refuses a precision too coarse for the scene's contact.

    Rounding a position of the order of l moves a foot by ε l. Where that alone changes the
    reaction (its stiffness K at one metre's penetration, times ε l) by more than the walker's
    weight, contact is noise.

    Raises:
        ArgumentError: for float32 (or less) where contact is too stiff.
    """
    leaves = jtu.tree_leaves(scene)
    if dtype == np.float64 or any(isinstance(leaf, jax.core.Tracer) for leaf in leaves):
        return
    walker = scene.walker
    stiffness = scene.normal.elastic_force(jnp.ones_like(walker.l))
    rounding = stiffness * float(jnp.finfo(dtype).eps) * walker.l
    worst = float(jnp.max(rounding / (walker.total_mass * scene.ground.g)))
    if worst > 1.0:
        raise ArgumentError(
            f"dtype = {np.dtype(dtype).name} is too coarse for this contact: rounding a position "
            f"changes the reaction by {worst:.3g} times the walker's weight; use float64."
        )
