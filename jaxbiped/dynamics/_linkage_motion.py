"""Equations of motion of a linkage, by any of the constraint methods."""

from collections.abc import Sequence
from typing import NamedTuple

from jaxbiped._types import Scalar, StateLeaf, Time
from jaxbiped.compiler import kept_alone
from jaxbiped.constraints._constraint_method import AbstractConstraintMethod, Constrained
from jaxbiped.constraints._linkage import Linkage
from jaxbiped.constraints._linkage_constraints import Heading, constraints_of, masses_of
from jaxbiped.scene._linkages import LinkageScene


class LinkageState(NamedTuple):
    """Coordinates of a linkage and their rates: tuples of n scalar leaves of any batch shape.

    Each body has x, z [m] and θ [rad], or x, z and the Euler parameters cos θ/2, sin θ/2 [–].

    Attributes:
        q: the n coordinates.
        v: rates of the coordinates.
    """

    q: tuple[StateLeaf, ...]
    v: tuple[StateLeaf, ...]


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
    headings: Sequence[Heading] | None = None,
) -> LinkageMotion:
    """Motion under applied generalised forces Q: M q̈ = Q − Jᵀ λ with the method's λ."""
    masses, at = masses_of(linkage), constraints_of(linkage, q, v, headings)
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
