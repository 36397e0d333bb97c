"""Surfaces in state space: switches, where the field is not smooth, heel strikes, and sections.

No step may straddle a switch: derivatives taken through it would be wrong. Single support ends as
the swing foot comes down or the walker has fallen: where all legs are bodies on the root point,
their angles tell both, exactly; else places do, in units of the walker's height. At a Poincaré
section an orbit is observed, once per cycle.
"""

import abc
import functools
import math
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar, select
from jaxbiped.compiler import kept_alone
from jaxbiped.dynamics._contacts import feet, foot_force, legs_at, limits_of
from jaxbiped.dynamics._equivalent_states import CompliantState, exchange_legs, images
from jaxbiped.dynamics._footfalls import (
    FootMotion,
    any_of,
    carrier_place,
    leg_depth,
    leg_places,
    mean,
    touches,
    touching_legs,
)
from jaxbiped.dynamics._stance import Stance, of_stance
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._modes import next_leg, standing_legs
from jaxbiped.scene._scene import AbstractWalkerScene, CompliantScene, RigidScene, is_rigid
from jaxbiped.scene._state_types import SomeState
from jaxbiped.scene.laws._abstract_laws import AbstractNormalLaw

FALL_ANGLE = 1.0
"""A root point lower than a straight leg at this angle [rad] could carry it has fallen."""

_APART = 1e-3
"""How far ahead a foot strikes at least, in units of the walker's height: where two legs of one
length pass each other their feet are level as well, and none comes down."""


def rate_unit(scene: AbstractWalkerScene) -> Scalar:
    """√(g/l), by the root point's height l with all angles 0 [1/s]."""
    return jnp.sqrt(scene.ground.g / scene.mechanism.height)


def clearance(scene: RigidScene, state: Any) -> Scalar:
    """Height of the swing foot above the ground [m]; of a leg's lowest foot."""
    return of_stance(scene, state, _clearance)


def _clearance(stance: Stance) -> Scalar:
    swings, stands = (
        functools.reduce(jnp.minimum, [stance.height(k) for k in feet])
        for feet in (stance.next_feet, stance.feet)
    )
    # Whichever foot of its leg stands, the lowest one is on the ground.
    return swings if len(stance.feet) == 1 else swings - stands


def clearance_rate(scene: RigidScene, state: Any) -> Scalar:
    """Its rate [m/s], of the swing leg's feet on average."""

    def rate(stance: Stance) -> Scalar:
        return mean([stance.foot(k).vz for k in stance.next_feet])

    return of_stance(scene, state, rate)


def distance_ahead(scene: RigidScene, state: Any) -> Scalar:
    """How far the swing leg's feet are ahead of the standing one's, on average [m]."""
    return of_stance(scene, state, _distance_ahead)


def _distance_ahead(stance: Stance) -> Scalar:
    return mean([stance.foot(k).x for k in stance.next_feet]) - standing_place(stance)


def standing_place(stance: Stance) -> Scalar:
    """Where the centre of the standing foot is, or those of a leg's feet on average [m]."""
    if len(stance.feet) == 1:
        place: Scalar = stance.pose.motion.x
        return place
    return mean([stance.foot(k).x for k in stance.feet])


def straight_legs(mechanism: Mechanism) -> tuple[int, int] | None:
    """Numbers of swing leg and stance leg where these are alike bodies on the root point.

    Such a walker that has fallen leans to one side for good; with bent legs it may change.
    """
    structure, leg = mechanism.structure, mechanism.structure.stance_leg
    if len(standing_legs(structure)) > 1:
        return None
    feet = (*structure.feet_of_leg[next_leg(structure, leg)], *structure.feet_of_leg[leg])
    bodies = [structure.feet[k] for k in feet]
    bent = any(structure.parents[j] >= 0 for j in bodies) or len(feet) > 2
    if bent or any(mechanism.feet[k].centre.ahead is not None for k in feet):
        return None
    swings, stands = bodies
    return swings, stands


def _leg_angles(stance: Stance) -> tuple[Scalar, Scalar] | None:
    """Angles of the two, where there are."""
    legs = straight_legs(stance.mechanism)
    if legs is None:
        return None
    swings, stands = (stance.pose.motion.angles[j] for j in legs)
    return swings, stands


def opening(scene: RigidScene, state: Any) -> Scalar:
    """Above zero while the swing foot is off the ground, where it is ahead [rad]."""
    return of_stance(scene, state, _opening)


def _opening(stance: Stance) -> Scalar:
    angles = _leg_angles(stance)
    if angles is not None:
        return angles[0] + angles[1]
    return _clearance(stance) / stance.mechanism.height


def lead(scene: RigidScene, state: Any) -> Scalar:
    """How far the swing foot is ahead [rad], above zero where it may strike."""
    return of_stance(scene, state, _lead)


def _lead(stance: Stance) -> Scalar:
    angles = _leg_angles(stance)
    if angles is not None:
        return angles[0] - angles[1]
    return _distance_ahead(stance) / stance.mechanism.height - _APART


def lean(scene: RigidScene, state: Any) -> Scalar:
    """Above zero while the root point is behind the standing foot [rad]."""
    return of_stance(scene, state, _lean)


def _lean(stance: Stance) -> Scalar:
    angles = _leg_angles(stance)
    if angles is not None:
        return angles[1]
    return (standing_place(stance) - stance.root.x) / stance.mechanism.height


def uprightness(scene: RigidScene, state: Any, side: Scalar) -> Scalar:
    """What is left before the walker has fallen, below zero afterwards [rad].

    `side` is the sign of `lean`.
    """
    return of_stance(scene, state, lambda stance: _uprightness(stance, side))


def _uprightness(stance: Stance, side: Scalar) -> Scalar:
    mechanism, angles = stance.mechanism, _leg_angles(stance)
    if angles is not None:
        return FALL_ANGLE - side * angles[1]
    return (stance.root.z - mechanism.height_over_feet(math.cos(FALL_ANGLE))) / mechanism.height


class Surface(NamedTuple):
    """How far a state is from where something happens, and how fast that changes.

    Attributes:
        value: above zero before it [rad].
        rate, curvature: its first two derivatives with respect to time.
    """

    value: Scalar
    rate: Scalar
    curvature: Scalar


def surface_along(
    function: Callable[[Any], Scalar], state: Any, accelerations: tuple[Scalar, ...]
) -> Surface:
    """A function of the angles in a motion: its value and its first two derivatives.

    It depends on no other part of the state; `accelerations` are those of the angles [rad/s²].
    """
    count = len(accelerations)
    angles, rates = tuple(state[1 : 1 + count]), tuple(state[1 + count : 1 + 2 * count])

    def of(angles: Any) -> Scalar:
        return function(type(state)(state[0], *angles, *rates, *state[1 + 2 * count :]))

    def course(angles: Any, rates: Any) -> tuple[Scalar, Scalar]:
        return jax.jvp(of, (angles,), (rates,))

    along = jax.jvp(course, (angles, rates), (rates, accelerations))
    (value, rate), (_, curvature) = along
    return Surface(value, rate, jnp.asarray(curvature))


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


class AbstractSection(eqx.Module):
    """A surface that the orbit crosses: a function of the state rises through zero.

    For a mirrored mechanism, it is evaluated with the names as they are and exchanged, so no
    arrival depends on which side is called the first.

    Attributes:
        alternates: whether each arrival is of another leg than the arrival before, and the first
            arrival of another leg than the one that stands alone at the start.
        names_legs: whether the mechanism's stance leg stands after an arrival, which determines the
            names of the legs.
    """

    alternates: ClassVar[bool] = False
    names_legs: ClassVar[bool] = False

    @abc.abstractmethod
    def value(self, args: PyTree, y: PyTree) -> Scalar:
        """The function that rises through zero, of the state just *after* the arrival."""

    @abc.abstractmethod
    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        """Whether a crossing there is an arrival (boolean)."""


class MidStance(AbstractSection):
    """Mid-stance: the root point passes over the feet of the stance leg, which carries the load.

    It passes over the mean of their places. The stance leg of a mirrored mechanism is that of the
    second body of its pairs; for any other mechanism, it is the last leg.

    Attributes:
        body: a body, such as "thigh_2", whose passage of the slope's normal on its way back counts
            instead; its leg carries the load, or the stance leg if the body has none.
    """

    names_legs: ClassVar[bool] = True
    body: str | None = eqx.field(static=True, default=None)

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        if self.body is not None:
            return -getattr(y, f"theta_{self.body}")
        if is_rigid(args):
            return -lean(args, y)
        return -legs_at(args, y)[args.mechanism.structure.stance_leg].x

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        if is_rigid(args):
            return jnp.asarray(True)
        structure = args.mechanism.structure
        legs = [structure.stance_leg]
        if self.body is not None:
            body = structure.bodies.index(self.body)
            own = range(len(structure.legs))
            legs = [i for i in own if body in structure.bodies_of_leg(i)] or legs
        touching = touching_legs(structure, feet(args, y))
        return any_of([touching[i] for i in legs])


class HeelStrike(AbstractSection):
    """Heel strike: the leg ahead comes down, and is then called the stance leg. A single leg just
    lands.
    """

    alternates: ClassVar[bool] = True
    names_legs: ClassVar[bool] = True

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        if is_rigid(args):
            return -opening(args, exchange_legs(args, y, -1))
        structure = args.mechanism.structure
        return leg_depth(structure, feet(args, y), structure.stance_leg)

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        if is_rigid(args):
            return lead(args, exchange_legs(args, y, -1)) > 0.0
        structure, found = args.mechanism.structure, feet(args, y)
        leg, places = structure.stance_leg, leg_places(structure, found)
        carrier = carrier_place(structure, found, places, leg)
        lands = touching_legs(structure, found)[leg]
        return lands if carrier is None else lands & (places[leg] > carrier)


@kept_alone
def foot_ahead(scene: Any, state: PyTree) -> Scalar:
    """Computes how far ahead of the root point the stance leg's foot stands on a section [m]."""
    if is_rigid(scene):
        return of_stance(scene, state, lambda stance: standing_place(stance) - stance.root.x)
    return legs_at(scene, state)[scene.mechanism.structure.stance_leg].x


class Section(AbstractSection):
    """A section given by any scalar function of the state, `function(args, state)`.

    Attributes:
        function: the function, which rises through zero at an arrival.
        condition: `condition(args, state)`, whether a crossing counts; None if every crossing
            counts.
    """

    function: Callable[[PyTree, PyTree], Scalar] = eqx.field(static=True)
    condition: Callable[[PyTree, PyTree], Scalar] | None = eqx.field(static=True, default=None)

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        return self.function(args, y)

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        if self.condition is None:
            return jnp.asarray(True)
        return self.condition(args, y)


def in_nearest_names(
    section: AbstractSection, scene: AbstractWalkerScene, near: SomeState, y: SomeState
) -> SomeState:
    """A state in those names, of all that its symmetry allows, that bring another to a section."""
    *others, (_, own) = images(scene, near)
    *renamed, (_, found) = images(scene, y)
    nearest = jnp.abs(section.value(scene, own))
    for (_, other), (_, image) in zip(others[::-1], renamed[::-1], strict=True):
        off = jnp.abs(section.value(scene, other))
        found = select(off < nearest, image, found)
        nearest = jnp.minimum(off, nearest)
    return found
