"""Constrained motion: a linkage under a constraint method, and redundant states made consistent.

They are so on their constraints after each step, and at the start.
"""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_type, holds_somewhere
from jaxbiped._types import RealScalarLike, Scalar, Time, by_numpy, in_64_bits
from jaxbiped.compiler import kept_alone
from jaxbiped.constraints._constraint_methods import (
    AbstractConstraintMethod,
    AbstractProjectingMethod,
    Constrained,
    correct_step,
    nearest_consistent,
)
from jaxbiped.constraints._linkage import Linkage, constraints_of, masses_of
from jaxbiped.dynamics._equivalent_states import BodiesState, CompliantState, redundant_state
from jaxbiped.dynamics._state import state_for
from jaxbiped.scene._linkage_scene import LinkageScene, LinkageState
from jaxbiped.scene._scene import RedundantScene
from jaxbiped.scene._state_types import is_redundant


class LinkageMotion(NamedTuple):
    """Motion of a linkage and the forces in its joints.

    Attributes:
        accelerations: second derivatives of the coordinates, n entries.
        joint_forces: force (x, z) of each joint on its body 1 [N]; that on body 2 is the opposite.
        violation: Φ, as in `Constraints`.
    """

    accelerations: list[Scalar]
    joint_forces: list[tuple[Scalar, Scalar]]
    violation: list[Scalar]


def motion_under(
    linkage: Linkage,
    method: AbstractConstraintMethod,
    q: Sequence[Scalar],
    v: Sequence[Scalar],
    applied: list[Scalar],
    circular: Sequence[tuple[Scalar, Scalar]] | None = None,
) -> LinkageMotion:
    """Motion under applied generalised forces Q: M q̈ = Q − Jᵀ λ with the method's λ.

    `circular` as of `constraints_of`.
    """
    masses, at = masses_of(linkage), constraints_of(linkage, q, v, circular)
    system = Constrained(masses, applied, at.rows, at.violation, at.rate, at.bias)
    multipliers = method.multipliers(system) if at.rows else []
    forces = list(applied)
    for row, value in zip(at.rows, multipliers, strict=True):
        for c, entry in row.items():
            forces[c] = forces[c] - entry * value
    joints = [(-multipliers[2 * k], -multipliers[2 * k + 1]) for k in range(len(linkage.joints))]
    accelerations = [force / mass for force, mass in zip(forces, masses, strict=True)]
    return LinkageMotion(accelerations, joints, at.violation)


@kept_alone
def linkage_motion(scene: LinkageScene, state: LinkageState) -> LinkageMotion:
    """Accelerations and joint forces of a linkage in gravity; leaves shaped as the state's.

    Args:
        scene: linkage, constraint method and gravity.
        state: coordinates and rates of the linkage, SI units.

    Returns:
        Accelerations [m/s², rad/s²] and joint forces [N].
    """
    linkage = scene.linkage
    applied: list[Scalar] = []
    for body in linkage.bodies:
        weight = [body.mass * g for g in scene.gravity]
        applied += [*weight, *[0.0 * body.mass] * (linkage.coordinates - 2)]
    return motion_under(linkage, scene.method, state.q, state.v, applied)


@kept_alone
def linkage_field(t: Time, state: LinkageState, scene: LinkageScene) -> LinkageState:
    """Time derivative of a linkage's state, in the form that `diffrax.ODETerm` takes.

    Args:
        t: time [s]; the field does not depend on it.
        state: coordinates and rates of the linkage, SI units.
        scene: linkage, constraint method and gravity.

    Returns:
        The rates of change, a `LinkageState` shaped as the state.
    """
    return LinkageState(state.v, tuple(linkage_motion(scene, state).accelerations))


class Violation(NamedTuple):
    """Violation of the constraints by a redundant state, leaves shaped as the state's.

    Attributes:
        position: largest distance between the positions of a hinge on its two bodies [m].
        rate: largest relative speed of these positions [m/s].
        normalisation: largest | cos² + sin² − 1 | of a body's Euler parameters; 0 without them.
        angle: largest violation of a coupling [rad]; 0 without couplings.
        angle_rate: largest rate of such a violation [rad/s].
    """

    position: RealScalarLike
    rate: RealScalarLike
    normalisation: RealScalarLike
    angle: RealScalarLike = 0.0
    angle_rate: RealScalarLike = 0.0


def coordinates_of(scene: RedundantScene, state: BodiesState) -> tuple[list[Scalar], list[Scalar]]:
    """Coordinates and rates of a redundant state as the linkage has them."""
    check_type("scene", scene, RedundantScene)
    if not is_redundant(state):
        raise ArgumentError(
            "state is minimal, which is not allowed here: give jb.dynamics.redundant_state(scene, "
            "state)."
        )
    count = len(scene.mechanism.structure.bodies) * scene.linkage.coordinates
    return list(state[:count]), list(state[count : 2 * count])


def with_coordinates(state: PyTree, q: list[Scalar], v: list[Scalar]) -> BodiesState:
    """The state with other coordinates and rates; bristles stay."""
    return type(state)(*q, *v, *state[len(q) + len(v) :])


@kept_alone
def violation(scene: RedundantScene, state: BodiesState) -> Violation:
    """Violations of hinges and couplings, and their rates of change.

    Args:
        scene: the walker and its constraint method.
        state: redundant, leaves of any common shape, SI units.

    Returns:
        Distance [m], relative speed [m/s], normalisation [–], angle [rad] and its rate [rad/s],
        leaves shaped as the state's.
    """
    q, v = coordinates_of(scene, state)
    linkage = scene.linkage
    at = constraints_of(linkage, q, v)
    points = 2 * len(linkage.joints)
    angles = points + len(linkage.angles)

    def most(values: Sequence[Scalar]) -> Scalar:
        return functools.reduce(jnp.maximum, map(jnp.abs, values), jnp.zeros_like(state[0]))

    def apart(values: Sequence[Scalar]) -> Scalar:
        return most([jnp.hypot(*values[i : i + 2]) for i in range(0, points, 2)])

    return Violation(
        position=apart(at.violation),
        rate=apart(at.rate),
        normalisation=most(at.violation[angles:]),
        angle=most(at.violation[points:angles]),
        angle_rate=most(at.rate[points:angles]),
    )


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
    q, v = coordinates_of(scene, state)
    method = scene.method
    if not isinstance(method, AbstractProjectingMethod):
        raise ArgumentError(
            f"method = {type(method).__name__} is not allowed here: it does not project."
        )
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
    check_type("scene", scene, RedundantScene)
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
