"""Starts of a search: the fitted guess, and scattered ones."""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_positive
from jaxbiped._types import Scalar, as_float, in_64_bits
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.caching._caches import bounded_cache
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._contacts import legs_in
from jaxbiped.dynamics._joint_loads import motion_of
from jaxbiped.dynamics._state import seed_state, state_for
from jaxbiped.dynamics._surfaces import rate_unit
from jaxbiped.dynamics._tree import pose_of
from jaxbiped.gait._gait import Gait
from jaxbiped.hybrid._sections import AbstractSection, with_leg_names_of
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene._joint_parts import Stop
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._modes import Mode, rigid_modes
from jaxbiped.scene._placement import root_on_feet
from jaxbiped.scene._ready_scenes import seed_scene
from jaxbiped.scene._scene import (
    WALKER_SCENES,
    AbstractScene,
    AbstractWalkerScene,
    WalkerScene,
)
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.scene._state_types import State, WalkerState
from jaxbiped.scene._structure import Angle

_BEND = 1.5
"""Largest bend of a joint with a stop in a scattered swing leg, in units of the spread [rad]."""


@functools.singledispatch
def default_guess(scene: Any) -> Any:
    """The start of a search without a guess; None where a guess has to be given."""
    return None


@default_guess.register
def _(scene: AbstractWalkerScene) -> Any:
    """The seed's start, fitted to the scene's legs and gravity; bristles, where any, straight.

    The stance leg's line from the root point to its feet has the angle and the rate of the seed's,
    those of other legs the swing leg's. Joints with a stop are at its limit, so that legs carry;
    bodies with several feet lie flat; all others are at rest at 0.
    """
    scene = scene.minimal
    dtype = jnp.result_type(jtu.tree_leaves(scene.walker)[0], float)
    return _fitted(scene, *jax.tree.map(dtype.type, _seed()))


def state_of_guess(scene: AbstractScene, guess: Gait | WalkerState | PyTree | None) -> Any:
    """The checked state from which a search begins: a gait's, or the one given; None for None.

    None stands for the default guess.

    Raises:
        ArgumentError: no state of this scene.
    """
    near = guess.measures.state if isinstance(guess, Gait) else guess
    if near is None and default_guess(scene) is None:
        raise ArgumentError(
            f"guess = None is not allowed for a {type(scene).__name__}: give a state."
        )
    return None if near is None else state_for(scene, near, "guess")


def start_of_search(scene: Any, section: AbstractSection, guess: PyTree) -> Any:
    """The checked state from which a gait is searched, the default where there is no guess."""
    start = default_guess(scene) if guess is None else guess
    if not isinstance(guess, Gait):  # whose state is minimal
        start = system_of(scene).minimal_start(scene, start)
    start = in_64_bits(state_of_guess(scene.minimal, start))
    return with_leg_names_of(section, scene.minimal, start)


class Lines(NamedTuple):
    """Angles [rad] of the legs' lines from the slope's normal, and rates [rad/s].

    Attributes:
        swing, stance: angles of the legs that swing, and of the one that stands.
        swing_rate, stance_rate: of all their bodies.
        bend: how far the joints with stops are off their limits in legs that swing [rad].
    """

    swing: Scalar
    stance: Scalar
    swing_rate: Scalar
    stance_rate: Scalar
    bend: Scalar | float = 0.0


@host_jit()  # many small operations
def _fitted(scene: AbstractWalkerScene, seed: State, own: AbstractWalkerScene) -> WalkerState:
    """`own` is the seed's scene. As constants XLA would divide by its numbers by reciprocals."""
    start = _posed(scene, _lines(scene, seed, own))
    if _places_root(scene):
        of_seed, rolling = _root(own, seed), _root(scene, start)
        depth = (of_seed.z - seed.hip_z) * (scene.mechanism.height / own.mechanism.height)
        forward, up = rolling.vx / of_seed.vx, rolling.vz / of_seed.vz
        fitted = _Root(rolling.z - depth, seed.hip_vx * forward, seed.hip_vz * up)
        start = _with_root(scene, start, fitted)
    return jax.tree.map(as_float, start)


def _lines(scene: AbstractWalkerScene, seed: State, own: AbstractWalkerScene) -> Lines:
    """The seed's, at the pace of the scene."""
    size = scene.mechanism.height / own.mechanism.height
    pace = jnp.sqrt(scene.ground.g / own.ground.g / size)
    return Lines(seed.theta_1, seed.theta_2, seed.omega_1 * pace, seed.omega_2 * pace)


def _posed(scene: AbstractWalkerScene, lines: Lines) -> WalkerState:
    """Legs that turn as a whole about a root point at 0; all other bodies at rest."""
    mechanism, kind = scene.mechanism, scene.state_type
    structure, limits = mechanism.structure, _limits(mechanism)
    zero = jnp.zeros_like(lines.swing)
    angles: dict[int, Scalar] = {}
    legs = [structure.leg_of_body(j) for j in range(len(structure.bodies))]
    for j, (parent, leg) in enumerate(zip(structure.parents, legs, strict=True)):
        angles[j] = angles[parent] if parent >= 0 and legs[parent] is not None else zero
        if j in limits:
            limit, inwards = limits[j]
            bend = 0.0 if leg in (structure.stance_leg, None) else inwards * lines.bend
            angles[j] = angles[j] + limit + bend
    rates = {
        j: lines.stance_rate if leg == structure.stance_leg else lines.swing_rate
        for j, leg in enumerate(legs)
        if leg is not None
    }

    def state() -> WalkerState:
        known = {f"theta_{structure.bodies[j]}": each for j, each in angles.items()}
        known |= {f"omega_{structure.bodies[j]}": each for j, each in rates.items()}
        if "mode" in kind._fields:
            known["mode"] = _starting_mode(scene, zero)
        return kind(**{name: known.get(name, zero) for name in kind._fields})

    own = None
    if _places_root(scene) or structure.turn is not None:
        own = _leg_angles(scene, state())
    for j, leg in enumerate(legs):
        if leg is not None:
            wanted = lines.stance if leg == structure.stance_leg else lines.swing
            angles[j] = angles[j] + (wanted if own is None else wanted - own[leg])
            if structure.parents[j] >= 0 and structure.feet.count(j) > 1:
                angles[j], rates[j] = zero, zero
    return state()


def _leg_angles(scene: AbstractWalkerScene, state: WalkerState) -> list[Scalar]:
    """Angles of the legs' lines about a root point at 0, of a state of either kind."""
    mechanism, zero = scene.mechanism, jnp.zeros_like(state[0])
    structure = mechanism.structure
    places, rates = (
        [zero, zero, *(getattr(state, name) for name in names[2:])]
        for names in (structure.coordinates, structure.rates)
    )
    pose = pose_of(mechanism, motion_of(mechanism, scene.ground, places, rates))
    return [line.angle for line in legs_in(mechanism, (pose,) * len(structure.bodies))]


def _starting_mode(scene: AbstractWalkerScene, zero: Scalar) -> Scalar:
    """The stance leg on all its feet, its stops held."""
    modes, stance = rigid_modes(scene.mechanism), scene.mechanism.structure.stance_leg
    yes, no = zero == 0.0, zero != 0.0
    held = tuple(yes if limit.leg == stance else no for limit in modes.limits)
    own = scene.mechanism.structure.feet_of_leg[stance]
    stands = modes.standing(stance, (yes,) * len(own), zero) if modes.feet else ()
    mode = Mode(stands, held, (no,) * len(modes.locks))
    return modes.encoded(jnp, mode, zero)


def _limits(mechanism: Mechanism) -> dict[int, tuple[Any, Any]]:
    """By bodies: the stop's limit nearer to 0 on the angle to its parent, and the sign inwards."""
    found: dict[int, tuple[Any, Any]] = {}
    structure = mechanism.structure
    for part, angle in zip(mechanism.joints, structure.joints, strict=True):
        for j, parent in enumerate(structure.parents):
            if isinstance(part, Stop) and angle.is_like(Angle(((j, 1.0), (parent, -1.0)))):
                lower, upper = part.lower, part.upper
                if upper is None or lower is None:
                    found[j] = (lower, 1.0) if upper is None else (upper, -1.0)
                else:
                    is_upper = jnp.abs(upper) <= jnp.abs(lower)
                    found[j] = jnp.where(is_upper, upper, lower), jnp.where(is_upper, -1.0, 1.0)
    return found


class _Root(NamedTuple):
    """Height of the root point [m] and its velocity [m/s]."""

    z: Scalar
    vx: Scalar
    vz: Scalar


def _places_root(scene: AbstractWalkerScene) -> bool:
    """Whether the root point's height is a coordinate, which else follows from the angles."""
    return f"{scene.mechanism.structure.root}_z" in scene.state_type._fields


def _root(scene: AbstractWalkerScene, state: WalkerState) -> _Root:
    """The root point on the stance leg, whose lowest foot just touches and rolls."""
    mechanism = scene.mechanism
    structure = mechanism.structure
    feet, values = structure.feet_of_leg[structure.stance_leg], state._asdict()
    found = root_on_feet(jnp, mechanism, scene.ground.slope, values, feet, rolls=True)
    return _Root(*(found[f"{structure.root}_{name}"] for name in _Root._fields))


def _with_root(scene: AbstractWalkerScene, state: WalkerState, point: _Root) -> WalkerState:
    root = scene.mechanism.structure.root
    named = {f"{root}_{name}": each for name, each in point._asdict().items()}
    return state._replace(**named)


@bounded_cache(1)
def _seed() -> tuple[State, AbstractWalkerScene]:
    """The seed's start and its scene, of plain numbers, which take no time to make."""
    with jax.ensure_compile_time_eval():
        return jax.tree.map(float, (seed_state(), seed_scene()))


def rolling_starts(
    scene: WalkerScene, count: int, *, spread: float = 0.3, seed: int = 0
) -> WalkerState:
    """Starts around the seed's: angles and leg rates are scattered, and the stance foot rolls.

    Args:
        scene: the walker, compliant or rigid.
        count: n, the number of starts; the first is the seed's own, fitted to the scene.
        spread: maximum relative change of an angle or rate.
        seed: random seed.

    Returns:
        States with leaves of shape (n,): the stance leg stands as deep as in the seed's start,
        and does not slip.

    Raises:
        ArgumentError: count below 1, or spread not above 0.
    """
    scene = check_scene(scene, *WALKER_SCENES)
    check_positive("count", count)
    check_positive("spread", spread)
    return _scatter(scene, int(count), float(spread), int(seed))


@cached_jit  # many small operations
def _scatter(scene: WalkerScene, count: int, spread: float, seed: int) -> WalkerState:
    shape = scattered_start_count(scene), count
    scatter = jax.random.uniform(jax.random.key(seed), shape, minval=-1.0, maxval=1.0)
    return starts_scattered_by(scene, spread * scatter.at[:, 0].set(0.0))


def scattered_start_count(scene: WalkerScene) -> int:
    """How many numbers scatter a start: of the legs' lines, and of each body that is on no leg."""
    return len(Lines._fields) - 1 + bool(_limits(scene.mechanism)) + 2 * len(_alone(scene))


def _alone(scene: AbstractWalkerScene) -> list[str]:
    """Names of the bodies of a state that are no part of a leg."""
    structure, fields = scene.mechanism.structure, scene.state_type._fields
    return [
        name
        for j, name in enumerate(structure.bodies)
        if structure.leg_of_body(j) is None and f"theta_{name}" in fields
    ]


@cached_jit  # many small operations
def starts_scattered_by(scene: WalkerScene, scatter: Scalar) -> WalkerState:
    """Starts like `rolling_starts`, off the seed's by these relative changes.

    Args:
        scene: the walker, compliant or rigid.
        scatter: shape (k, n), k as `scattered_start_count` tells.
    """
    middle = default_guess(scene)
    lines, structure = _lines(scene, *_seed()), scene.mechanism.structure
    bends = bool(_limits(scene.mechanism))
    moved = Lines(*(each * (1.0 + scatter[i]) for i, each in enumerate(lines[:4])))
    if bends:
        moved = moved._replace(bend=_BEND * jnp.abs(scatter[4]))
    started = _posed(scene, moved)
    rate = rate_unit(scene)
    for i, name in enumerate(_alone(scene)):
        angle, turning = scatter[4 + bends + 2 * i], rate * scatter[5 + bends + 2 * i]
        started = started._replace(**{f"theta_{name}": angle, f"omega_{name}": turning})
    if _places_root(scene):
        height = f"{structure.root}_z"
        depth = _root(scene, middle).z - getattr(middle, height)
        rolling = _root(scene, started)
        started = _with_root(scene, started, rolling._replace(z=rolling.z - depth))
    return jtu.tree_map(lambda leaf: jnp.broadcast_to(leaf, scatter.shape[1:]), started)
