"""Consistent redundant states: on their constraints after each step, and at the start."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxbiped._checks import ArgumentError, holds_somewhere
from jaxbiped._types import Scalar, by_numpy, in_64_bits
from jaxbiped.compiler import kept_alone
from jaxbiped.constraints._constraint_method import AbstractProjectingMethod
from jaxbiped.constraints._linkage_constraints import masses_of
from jaxbiped.constraints._projection import correct_step, nearest_consistent
from jaxbiped.dynamics._equivalent_states import BodiesState, CompliantState, redundant_state
from jaxbiped.dynamics._redundant_motion import (
    Violation,
    coordinates_of,
    violation,
    with_coordinates,
)
from jaxbiped.dynamics._state import state_for
from jaxbiped.scene._scene import RedundantScene
from jaxbiped.scene._state_types import is_redundant

FURTHEST = Violation(position=0.01, rate=0.1, normalisation=0.01, angle=0.01, angle_rate=0.1)
"""A start that is further off its constraints is refused [m, m/s, –, rad, rad/s]."""
_UNITS = dict(zip(Violation._fields, ("m", "m/s", "(no unit)", "rad", "rad/s"), strict=True))


class Consistent(NamedTuple):
    """A start that was moved onto its constraints, and the size of the correction.

    Attributes:
        state: the consistent state nearest in the mass metric.
        violation: violation of the constraints by the given start.
        position: size of the correction of positions, √(Δqᵀ M Δq / total mass) [m].
        velocity: size of the correction of velocities, in the same way [m/s].
    """

    state: BodiesState
    violation: Violation
    position: Scalar
    velocity: Scalar


def project(scene: RedundantScene, state: BodiesState) -> BodiesState:
    """The state as the scene's method corrects it after each step; differentiable.

    Args:
        scene: a scene whose constraint method projects.
        state: redundant, leaves of any common shape, SI units.

    Returns:
        A state of the same kind and shape.

    Raises:
        ArgumentError: the scene's method does not project.
    """
    method = scene.method
    if not isinstance(method, AbstractProjectingMethod):
        raise ArgumentError(
            f"method = {type(method).__name__} is not allowed here: it does not project."
        )
    q, v = coordinates_of(scene, state)
    return with_coordinates(state, *correct_step(scene.linkage, method, q, v))


def consistent_state(
    scene: RedundantScene, state: CompliantState, *, max_violation: Violation = FURTHEST
) -> Consistent:
    """The consistent state nearest to a start in the mass metric.

    Args:
        scene: the redundant scene.
        state: start; a minimal state is converted and needs no correction.
        max_violation: a start that violates its constraints by more is refused.

    Returns:
        The state and the size of the correction, with leaves of the state's shape.

    Raises:
        ArgumentError: the state is not of the scene's kind, an entry is not finite, leaves have
            different shapes, or the start is too far off. Traced values are not checked.
    """
    if is_redundant(state):
        state = state_for(scene, state)
    else:
        state = redundant_state(scene, state_for(scene.scene, state))
    off = violation(scene, state)
    for name, unit in _UNITS.items():
        value, bound = getattr(off, name), getattr(max_violation, name)
        if holds_somewhere(by_numpy(lambda _, value, bound: value > bound, value, bound)):
            raise ArgumentError(
                f"state violates its constraints by {float(np.max(np.asarray(value))):.3g} {unit} "
                f"({name}), which is too far to correct: at most {float(bound):g} is allowed."
            )
    return _nearest_state(scene, in_64_bits(state), off)


@kept_alone
def _nearest_state(scene: RedundantScene, state: BodiesState, off: Violation) -> Consistent:
    """The nearest state that keeps the constraints."""
    q, v = coordinates_of(scene, state)
    masses = masses_of(scene.linkage)
    new_q, new_v = nearest_consistent(scene.linkage, q, v)

    def size(new: list[Scalar], old: list[Scalar]) -> Scalar:
        moved = [m * (a - b) ** 2 for m, a, b in zip(masses, new, old, strict=True)]
        return jnp.sqrt(sum(moved[1:], moved[0]) / scene.mechanism.total_mass)

    return Consistent(with_coordinates(state, new_q, new_v), off, size(new_q, q), size(new_v, v))
