"""Switches: surfaces where the vector field or a derivative of it jumps.

No step may straddle one: derivatives taken through it would be wrong.
"""

from typing import NamedTuple

from jaxbiped._types import Scalar
from jaxbiped.dynamics._contacts import feet, foot_force, legs_at, limits_of
from jaxbiped.dynamics._equivalent_states import CompliantState
from jaxbiped.dynamics._footfalls import FootMotion, touches
from jaxbiped.scene._scene import CompliantScene
from jaxbiped.scene.laws._abstract_laws import AbstractNormalLaw


class Switch(NamedTuple):
    """A surface in state space across which the vector field is not smooth.

    Attributes:
        value: a function of the state that is zero on the surface, positive on one side.
        live: whether the field jumps at the surface near this state (boolean): friction has no
            corner under a foot without load.
        force_jumps: whether the field itself jumps, and not only its Jacobian. Static.
        corner: whether a force acts on both sides and only its slope jumps, as at the peak of
            friction: touching the surface changes no derivative. Static.
        resets: whether the state itself jumps, and only when the value falls through zero. Static.
        first_only: whether only first derivatives of motions across the surface are computed,
            because the force jumps there or is infinitely steep; second derivatives are finite
            differences. Static, like all fields marked so: known before anything runs.
    """

    value: Scalar
    live: Scalar | bool
    force_jumps: bool = False
    corner: bool = False
    resets: bool = False
    first_only: bool = False


def switches(scene: CompliantScene, state: CompliantState) -> tuple[Switch, ...]:
    """All switches of a scene: those of its feet and those of its stops.

    A foot has switches at touchdown, where its reaction leaves zero, at slip speeds of ±v0 and 0,
    and for the clearance rule. A stop has switches at its limits, and where its torque leaves zero.
    Springs and latches are smooth.

    Source: the seed paper, section 2.2, whose laws have these corners.

    Args:
        scene: the walker, in minimal or redundant coordinates.
        state: scalar leaves, SI units.

    Returns:
        The switches of each foot, then those of each stop; their number depends only on the scene.
    """
    structure, legs = scene.mechanism.structure, legs_at(scene, state)
    found: list[Switch] = []
    for foot, leg in zip(feet(scene, state), structure.leg_of_foot, strict=True):
        found += _foot_switches(scene, foot, legs[leg].rate)
    for law, limit in limits_of(scene, state):
        depth, rate = limit.penetration, limit.rate
        found.append(_touchdown(law, depth, True))
        found += [Switch(value, depth > 0.0, corner=True) for value in law.switches(depth, rate)]
    return tuple(found)


def _touchdown(law: AbstractNormalLaw, depth: Scalar, live: Scalar | bool) -> Switch:
    jumps = law.jumps_at_touchdown
    return Switch(depth, live, force_jumps=jumps, first_only=jumps or law.steep_at_touchdown)


def _foot_switches(scene: CompliantScene, foot: FootMotion, rate: Scalar) -> list[Switch]:
    if foot.admitted is False:
        return []
    below, touching = foot.penetration > 0.0, touches(foot)
    admitted = True if foot.admitted is None else foot.admitted
    carries = foot_force(scene, foot).normal > 0.0
    found = [_touchdown(scene.normal, foot.penetration, admitted)]
    reaction = scene.normal.switches(foot.penetration, foot.penetration_rate)
    found += [Switch(value, touching, corner=True) for value in reaction]
    slips = scene.friction.switches(foot.slip_speed)
    found += [Switch(value, carries, corner=True) for value in slips]
    if foot.admitted is not None:
        pressed = below & (scene.normal.force(foot.penetration, foot.penetration_rate) > 0.0)
        found.append(Switch(rate, pressed, force_jumps=True))
    return found
