"""Equations of motion in minimal coordinates: the root point's place and the free angles."""

from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxbiped._types import Scalar, Time
from jaxbiped.compiler import kept_alone
from jaxbiped.dynamics._actuation import Carriers, load_shares, with_driven_joints
from jaxbiped.dynamics._contacts import (
    bristles_of,
    feet,
    feet_at,
    foot_force,
    hip_motion,
    leg_loads,
    legs_in,
    normal_forces,
)
from jaxbiped.dynamics._equivalent_states import CompliantState, motion_in
from jaxbiped.dynamics._footfalls import FootMotion
from jaxbiped.dynamics._force_balance import force_balance, free_mass_entries
from jaxbiped.dynamics._joint_loads import with_constraint_torques
from jaxbiped.dynamics._tree import Loads, Pose, point_motion, pose_of
from jaxbiped.dynamics._tree_inertia import Composites, composites, eliminate, inertial_loads
from jaxbiped.linalg._sparse_lu import SparseMatrix, times
from jaxbiped.scene._ground import gravity_on
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._scene import CompliantScene, Scene
from jaxbiped.scene._state_types import CLOCK, STRIKE_LEG, check_scalars, state_type_of
from jaxbiped.scene._structure import Structure
from jaxbiped.scene.actuation._actuators import HipMotion
from jaxbiped.scene.laws._abstract_laws import AbstractBristleLaw


@kept_alone
def accelerations(scene: Scene, state: Any) -> Any:
    """Accelerations of a walker at a state.

    Args:
        scene: the walker on its ground.
        state: of the scene's kind, leaves of any common shape, SI units.

    Returns:
        Accelerations `ROOT_ax` and `ROOT_az` of the root point [m/s²] and `alpha_BODY` of the
        bodies [rad/s²]; an `Accelerations` for `Walker`.
    """
    at = _at(scene, state)
    structure, known, pose = at.mechanism.structure, at.known, at.pose
    loads = _with_applied_loads(inertial_loads(structure, known, pose), scene, at)
    factors = eliminate(structure, known, pose)
    moved = with_constraint_torques(structure, at.mechanism.joints, factors, loads)
    downhill, weight = gravity_on(scene.ground)
    turning = (moved[2 + body] for body in structure.free)
    kind = state_type_of(structure.accelerations)
    return kind(moved[0] + downhill, moved[1] - weight, *turning)


class _Known(NamedTuple):
    """A walker at a state."""

    mechanism: Mechanism
    known: Composites
    pose: Pose
    feet: tuple[FootMotion, ...]


def _at(scene: Scene, state: CompliantState) -> _Known:
    mechanism = scene.mechanism
    pose = pose_of(mechanism, motion_in(scene, state))
    found = feet_at(scene, (pose,) * len(mechanism.structure.bodies), bristles_of(scene, state))
    return _Known(mechanism, composites(mechanism), pose, found)


def _with_applied_loads(loads: Loads, scene: Scene, at: _Known) -> Loads:
    """With the forces of the ground, of joint parts and of actuators."""
    mechanism = at.mechanism
    structure = mechanism.structure
    for body, foot, found in zip(structure.feet, mechanism.feet, at.feet, strict=True):
        # Where it is known that a foot never touches, nothing of its contact is in the program.
        if found.admitted is not False:
            reaction = foot_force(scene, found)
            point = point_motion(structure, at.pose, body, foot.centre)
            loads = loads.with_force(point, reaction.tangential, reaction.normal)
            loads = loads.with_torques(((body, 1.0),), times(reaction.tangential, foot.radius))
    return with_torques(loads, scene, (at.pose,) * len(structure.bodies), at.feet)


def with_torques(
    loads: Loads, scene: CompliantScene, poses: tuple[Pose, ...], found: tuple[FootMotion, ...]
) -> Loads:
    """With the torques of joint parts and of actuators.

    Poses are as each body has them, with the same angles in all.
    """
    mechanism, motion = scene.mechanism, poses[0].motion

    def carriers() -> Carriers:
        shares = load_shares(scene, normal_forces(scene, found))
        return legs_in(mechanism, poses), leg_loads(mechanism.structure, shares)

    def hip() -> HipMotion:
        return hip_motion(scene, found, motion)

    return with_driven_joints(loads, scene, motion, carriers, hip)


def bristle_rates(scene: CompliantScene, state: CompliantState) -> dict[str, Scalar]:
    """Rates of all feet's bristles by their names in the state [1/s]; none without bristles."""
    rates: dict[str, Scalar] = {}
    law, names = scene.friction, scene.mechanism.structure.bristles
    if not isinstance(law, AbstractBristleLaw):
        return rates
    for name, foot in zip(names, feet(scene, state), strict=True):
        load = foot_force(scene, foot).normal  # refuses a foot without a bristle
        assert foot.bristle is not None
        rates[name] = law.bristle_rate(load, foot.slip_speed, foot.bristle)
    return rates


@kept_alone
def vector_field(t: Time, state: Any, scene: Scene) -> Any:
    """Time derivative of the state, in the form that `diffrax.ODETerm` takes.

    Args:
        t: time [s]; the field does not depend on it.
        state: leaves of any common shape, SI units.
        scene: the walker on its ground.

    Returns:
        The rates of change [SI units per second], a state of the same kind and shape.

    Raises:
        ArgumentError: the scene is of another kind, or the state is another scene's.
    """
    structure, accelerated = scene.mechanism.structure, accelerations(scene, state)
    check_scalars(state, scene.minimal.state_names)
    places = {
        place: getattr(state, rate)
        for place, rate in zip(structure.coordinates, structure.rates, strict=True)
    }
    second = dict(zip(structure.rates, accelerated, strict=True))
    others = bristle_rates(scene, state) | _clock_rates(state)
    return type(state)(**places, **second, **others)


def _clock_rates(state: CompliantState) -> dict[str, Scalar]:
    """Rates of the time since the last strike, and of the leg that struck, by their names."""
    rates = {CLOCK: jnp.ones_like(state[0]), STRIKE_LEG: jnp.zeros_like(state[0])}
    return rates if CLOCK in state._fields else {}


def mass_matrix(scene: Scene, state: CompliantState) -> SparseMatrix:
    """The mass matrix, by the positions of the coordinates' rates in the state."""
    at = _at(scene, state)
    places = _places(at.mechanism.structure, state)
    entries = free_mass_entries(at.mechanism.structure, at.known, at.pose)
    return {(places[i], places[j]): entry for (i, j), entry in entries.items()}


def force_residual(scene: Scene, state: CompliantState, rates: CompliantState) -> dict[int, Scalar]:
    """F − M ẏ at given rates, by the positions of the coordinates' rates and of the bristles."""
    at, (downhill, weight) = _at(scene, state), gravity_on(scene.ground)
    structure = at.mechanism.structure
    given = [getattr(rates, name) for name in structure.rates]
    given[0], given[1] = given[0] - downhill, given[1] + weight
    loads = _with_applied_loads(Loads.none(structure), scene, at)
    balance = force_balance(structure, at.known, at.pose, loads, given)
    residual = dict(zip(_places(structure, state), balance, strict=True))
    for name, rate in (bristle_rates(scene, state) | _clock_rates(state)).items():
        residual[state._fields.index(name)] = rate - getattr(rates, name)
    return residual


def _places(structure: Structure, state: CompliantState) -> list[int]:
    """Where the rates of the coordinates are in a state."""
    return [state._fields.index(name) for name in structure.rates]
