"""Switches: surfaces where the vector field or a derivative of it jumps.

No step may straddle one: derivatives taken through it would be wrong.
"""

from typing import NamedTuple

from jaxbiped._types import Scalar
from jaxbiped.dynamics._contacts import feet, foot_force, legs_at
from jaxbiped.dynamics._footfalls import FootMotion, touches
from jaxbiped.dynamics._gaps import limits_of
from jaxbiped.dynamics._redundant_state import CompliantState
from jaxbiped.scene._scene import CompliantScene
from jaxbiped.scene.laws._abstract_laws import AbstractNormalLaw


class Switch(NamedTuple):
    """A surface in state space across which the vector field is not smooth.

    Attributes:
        value: a function of the state that is zero on the surface, positive on one side.
        live: whether the field jumps there at all near this state (boolean): friction has no
            corner under a foot that carries nothing.
        force_jumps: whether the field itself jumps, not its Jacobian alone. Known before
            anything runs.
        corner: whether the force is there on both sides and only its slope jumps, as where
            friction peaks: a touch of it changes no derivative. Known before anything runs.
        resets: whether the state itself jumps, and only where the value falls through zero. Known
            before anything runs.
        first_only: whether of motions across it first derivatives alone are followed: the force
            jumps there, or is infinitely steep. Second ones are differences. Known before
            anything runs.
    """

    value: Scalar
    live: Scalar | bool
    force_jumps: bool = False
    corner: bool = False
    resets: bool = False
    first_only: bool = False


def switches(scene: CompliantScene, state: CompliantState) -> tuple[Switch, ...]:
    """Every switch of a scene: those of its feet and those of its stops.

    Of a foot: touchdown, reaction leaving zero, slip at ±v0 and 0, clearance rule. Of a stop: its
    limits, and its torque leaving zero. Springs and latches are smooth.

    Source: the seed paper, section 2.2, whose laws have these corners.

    Args:
        scene: the walker, in minimal or redundant coordinates.
        state: scalar leaves, SI units.

    Returns:
        The switches of each foot, then those of each stop; as many at every state of a scene.
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
