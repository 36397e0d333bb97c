"""Accuracy: what its names stand for, and the norm of errors."""

from typing import NamedTuple

import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._checks import check_choice, check_positive
from jaxbiped._types import RealScalarLike, Scalar
from jaxbiped.hybrid._scales import is_smooth, resolve_slip_speed


class Tolerances(NamedTuple):
    """Tolerances of the step-size control: relative, and absolute.

    Both must resolve the slip speed over which friction builds up, or steps chatter about it. By
    default the absolute one is a hundredth of the relative one, in the scene's `Units`.
    """

    rtol: RealScalarLike
    atol: RealScalarLike


class Precision(NamedTuple):
    """How exactly to solve for derivatives.

    Attributes:
        rtol: relative tolerance of the state; the absolute one is a hundredth of it in the
            scene's units.
        tangent_rtol: relative tolerance of the columns.
    """

    rtol: RealScalarLike
    tangent_rtol: RealScalarLike


class Accuracy(NamedTuple):
    """What a named accuracy stands for, in relative tolerances.

    Attributes:
        walk: of a walk with laws of contact, at most: looser than "draft" is no faster, for the
            tolerance of a velocity comes near the speed over which friction builds up.
        rigid_walk: of the rigid walker.
        gait, rigid_gait: of gaits and return maps; None where derivatives cannot be asked for.
            Rolling is smooth, and a gait of it costs little at any precision.
        max_solver_steps: cap on the attempted steps of a gait to its next arrival.
    """

    walk: float
    rigid_walk: float
    gait: Precision | None = None
    rigid_gait: Precision | None = None
    max_solver_steps: int = 0


ACCURACIES = {
    "draft": Accuracy(2e-5, 1e-4, Precision(1e-4, 1e-3), Precision(1e-6, 1e-5), 16384),
    "balanced": Accuracy(1e-6, 1e-6, Precision(3e-7, 3e-6), Precision(1e-9, 1e-8), 16384),
    "tight": Accuracy(2e-9, 1e-11, Precision(1e-9, 1e-8), Precision(1e-12, 1e-11), 32768),
}
"""Named accuracies; the absolute tolerance is a hundredth of the relative one."""
GAIT_ACCURACIES = tuple(name for name, each in ACCURACIES.items() if each.gait is not None)
"""The accuracies that derivatives can be asked for."""


def tolerances(
    accuracy: str, rtol: float | None, atol: float | None, scene: PyTree = None
) -> Tolerances:
    """The tolerances that a name stands for in a scene, either one replaced where it is given.

    Raises:
        ArgumentError: an unknown name, or a tolerance that is not above zero.
    """
    check_choice("accuracy", accuracy, ACCURACIES)
    named = ACCURACIES[accuracy]
    relative: RealScalarLike
    if rtol is not None:
        relative = rtol
    else:
        smooth = is_smooth(scene)
        relative = named.rigid_walk if smooth else resolve_slip_speed(named.walk, scene)
    check_positive("rtol", relative)
    absolute = 1e-2 * relative if atol is None else atol
    check_positive("atol", absolute)
    return Tolerances(relative, absolute)


_COARSER_THAN_A_WALK = 4.0
"""Times that a gait's tolerance may be coarser than a walk's where the slip speed limits both: its
columns ask for short steps, too. Of eight gaits at v0 of 5e-6 to 1.3e-5 m/s, multipliers were up to
2.4 bars off at 40 times, 1.6 at 8 times and 0.07 at 4 times, in as many steps."""


def precision_of(accuracy: str, scene: PyTree = None) -> Precision:
    """Tolerances of state and derivatives of a gait; one of `GAIT_ACCURACIES`.

    Both are finer where the name's own would leave unresolved how friction builds up.
    """
    named = ACCURACIES[accuracy]
    found = named.rigid_gait if is_smooth(scene) else named.gait
    assert found is not None
    rtol = _COARSER_THAN_A_WALK * resolve_slip_speed(found.rtol / _COARSER_THAN_A_WALK, scene)
    return Precision(rtol, found.tangent_rtol * (rtol / found.rtol))


def rms_norm(error: PyTree) -> Scalar:
    """Root mean square over all leaves, without joining them into one array first.

    Args:
        error: numbers of any shapes, scaled by their tolerances [–].

    Returns:
        The norm [–], a scalar.
    """
    leaves = jtu.tree_leaves(error)
    size = sum(jnp.size(leaf) for leaf in leaves)
    total = sum(jnp.sum(leaf * leaf) for leaf in leaves)
    return jnp.sqrt(total / size)


def check_accuracy_name(accuracy: object) -> None:
    """Raises `ArgumentError` unless `accuracy` is a name of `ACCURACIES`."""
    check_choice("accuracy", accuracy, (*ACCURACIES, "or a relative error above 0"))
