"""Endings of a compliant walk: failure events, and surfaces of the state on which endings lie."""

import functools
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Scalar, Time, any_of
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.compiler import fusion_barrier
from jaxbiped.dynamics._contacts import feet, legs_at
from jaxbiped.dynamics._energy import energies
from jaxbiped.dynamics._equivalent_states import minimal_state
from jaxbiped.dynamics._footfalls import (
    FootMotion,
    LegMotion,
    leg_depth,
    leg_places,
    touches,
    touching_legs,
)
from jaxbiped.dynamics._minimal_motion import vector_field
from jaxbiped.dynamics._surfaces import FALL_ANGLE, rate_unit
from jaxbiped.scene._clearance import AbstractClearance, StanceRotation
from jaxbiped.scene._scene import Scene
from jaxbiped.scene._state_types import State
from jaxbiped.scene._structure import Structure

REST_RATE = 1e-4
"""Rate of a leg at rest, in units of √(g/l)."""
_LOST_RATE = 0.1
"""Rate, in the same units, up to which a leg that turned back has just lost its ground."""
_HAIR = 1e-3
"""Height, in units of the walker's, under which a foot is about to touch."""
REST_ENERGY = 1e-10
"""Kinetic energy of a walker at rest, in units of its weight times l."""
STUMBLE_SPEED = 1e-3
"""Speed at which a rear foot comes down, in units of √(g l), from which it counts as a stumble."""


def root_height(scene: Scene, state: State) -> Scalar:
    """Height of the root point in a state [m]."""
    return getattr(state, f"{scene.mechanism.structure.root}_z")


def fall_height(scene: Scene) -> Scalar:
    """How high a straight leg at 1 rad could carry the root point [m]."""
    return scene.mechanism.height_over_feet(math.cos(FALL_ANGLE))


def has_fallen(scene: Scene, state: State) -> Scalar:
    """Whether the root point is lower than a leg at 1 rad could carry it (boolean)."""
    return root_height(scene, state) < fall_height(scene)


def speed_unit(scene: Scene) -> Scalar:
    """√(g l) [m/s]."""
    return jnp.sqrt(scene.ground.g * scene.mechanism.height)


def energy_unit(scene: Scene) -> Scalar:
    """The walker's weight times that height [J]."""
    mechanism = scene.mechanism
    return mechanism.total_mass * scene.ground.g * mechanism.height


class _Admitted(AbstractClearance):
    """A rule by which one leg always touches, the others by another rule."""

    rule: AbstractClearance
    leg: str = eqx.field(static=True)

    def admits(self, leg: str, leg_rate: Scalar) -> Scalar | bool | None:
        return None if leg == self.leg else self.rule.admits(leg, leg_rate)


def _turning_rate(scene: Scene, state: State, leg: int) -> Scalar:
    """Rate of a leg's rate [rad/s²]."""
    rates = vector_field(0.0, state, scene)
    return jax.jvp(lambda y: legs_at(scene, y)[leg].rate, (state,), (rates,))[1]


def _at_turn(scene: Scene, state: State, leg: int) -> State:
    """A state but for the rate of a leg, which is 0: its uppermost body turns otherwise."""
    structure = scene.mechanism.structure
    chain = structure.chains[structure.feet[structure.feet_of_leg[leg][0]]]
    free = [body for body in chain if body in structure.free]
    if not free:
        return state
    name = f"omega_{structure.bodies[free[0]]}"
    zero = jnp.zeros_like(state[0])
    along = type(state)(*[zero] * len(state))._replace(**{name: jnp.ones_like(zero)})
    rate, share = jax.jvp(lambda y: legs_at(scene, y)[leg].rate, (state,), (along,))
    return state._replace(**{name: getattr(state, name) - rate / share})


@cached_jit  # for its trace cache
def is_barred(scene: Scene, state: State) -> tuple[Scalar, Scalar]:
    """Whether the motion has no continuation at the surface where a leg turns back (two booleans).

    Under the paper's clearance rule contact comes on when a swing leg turns back (θ̇ falls to
    zero). Where its foot is under the ground by then, the reaction is there at once, and may push
    the leg forward again, into the side where there is none: neither side lets it go on. The
    first boolean: the leg is ahead of all others; the second: it is not.
    """
    never = jnp.zeros_like(state[0], dtype=bool)
    modelled = scene.minimal
    if not isinstance(scene.clearance, StanceRotation):
        return never, never
    structure, found = scene.mechanism.structure, feet(scene, state)
    slow, legs = REST_RATE * rate_unit(scene), legs_at(scene, state)
    turning = [
        _is_under(structure, found, i) & (leg.rate >= 0.0) & (leg.rate < slow)
        for i, leg in enumerate(legs)
    ]

    def attracted() -> tuple[Scalar, ...]:
        barred = []
        for i, name in enumerate(structure.legs):
            rule = _Admitted(modelled.clearance, name)
            touching = eqx.tree_at(lambda own: own.clearance, modelled, rule)
            barred.append(
                (_turning_rate(modelled, state, i) < 0.0)
                & (_turning_rate(touching, _at_turn(scene, state, i), i) > 0.0)
            )
        return tuple(barred)

    pushed = fusion_barrier(any_of(turning), attracted)
    barred = [a & b for a, b in zip(turning, pushed, strict=True)]
    places = leg_places(structure, found)
    ahead = any_of([each & _is_first(places, i) for i, each in enumerate(barred)])
    return ahead, any_of(barred) & ~ahead


def _is_first(places: Sequence[Scalar], leg: int) -> Scalar:
    """Whether a leg is ahead of all others (boolean)."""
    first = jnp.ones_like(places[leg], dtype=bool)
    for i, place in enumerate(places):
        if i != leg:
            # Of two that stand in one place the later one counts as ahead.
            first = first & (places[leg] > place if i > leg else places[leg] >= place)
    return first


def _is_under(structure: Structure, found: Sequence[FootMotion], leg: int) -> Scalar:
    return any_of([found[k].penetration > 0.0 for k in structure.feet_of_leg[leg]])


@cached_jit  # for its trace cache
def has_stopped(scene: Scene, state: State) -> Scalar:
    """Whether the leg that stands alone is at rest, or all the walker is (boolean)."""
    structure, found = scene.mechanism.structure, feet(scene, state)
    touching = touching_legs(structure, found)
    if not isinstance(scene.clearance, StanceRotation):
        at_rest = energies(scene, state).kinetic < REST_ENERGY * energy_unit(scene)
        return any_of(touching) & at_rest
    # A foot that is put on the ground does not touch yet, but is about to.
    hair = _HAIR * scene.mechanism.height
    nearer = [foot._replace(penetration=foot.penetration + hair) for foot in found]
    near = touching_legs(structure, nearer)
    unit, stopped = rate_unit(scene), []
    for i, leg in enumerate(legs_at(scene, state)):
        alone = touching[i]
        for k, other in enumerate(near):
            alone = alone if k == i else alone & ~other
        lost = _is_under(structure, found, i) & (leg.rate >= 0.0) & (leg.rate < _LOST_RATE * unit)
        stopped += [alone & (leg.rate > -REST_RATE * unit), ~any_of(near) & lost]
    return any_of(stopped)


def foot_pairs(structure: Structure) -> Iterator[tuple[int, int]]:
    """Numbers of two feet of different legs."""
    for i, j in itertools.permutations(range(len(structure.feet)), 2):
        if structure.leg_of_foot[i] != structure.leg_of_foot[j]:
            yield i, j


@cached_jit  # for its trace cache
def has_stumbled(scene: Scene, state: State) -> Scalar:
    """Whether a rear foot comes down, moving forward, while another leg carries (boolean)."""
    structure, found = scene.mechanism.structure, feet(scene, state)
    least = STUMBLE_SPEED * speed_unit(scene)

    def trips(rear: FootMotion, front: FootMotion) -> Scalar:
        entering = rear.penetration_rate > jnp.maximum(front.penetration_rate, 0.0)
        fast = (rear.penetration_rate > least) & (rear.slip_speed > least)
        both = touches(rear) & touches(front)
        return both & (rear.x < front.x) & entering & fast

    tripped = [trips(found[i], found[j]) for i, j in foot_pairs(structure)]
    return any_of([jnp.zeros_like(state[0], dtype=bool), *tripped])


def _failed(t: Time, y: PyTree, args: PyTree, **kwargs: object) -> Scalar:
    return ~jnp.isfinite(sum(jtu.tree_leaves(y)))


def _event(condition: Callable[[Scene, Any], Scalar]) -> Callable[..., Scalar]:
    """A condition of scene and minimal state as diffrax asks it."""

    def happens(t: Time, y: PyTree, args: PyTree, **kwargs: object) -> Scalar:
        return condition(args, minimal_state(args, y))

    return happens


def _speed(scene: Scene, state: State) -> Scalar:
    """Speed of the root point along the slope [m/s]."""
    return getattr(state, f"{scene.mechanism.structure.root}_vx")


def _fell_forward(scene: Scene, y: State) -> Scalar:
    too_late, _ = is_barred(scene, y)
    return too_late | (has_fallen(scene, y) & (_speed(scene, y) >= 0.0))


def _fell_back(scene: Scene, y: State) -> Scalar:
    return has_fallen(scene, y) & (_speed(scene, y) < 0.0)


def _stumbled(scene: Scene, y: State) -> Scalar:
    _, too_short = is_barred(scene, y)
    return too_short | has_stumbled(scene, y)


_EVENTS: dict[str, dict[Ending, Callable[..., Scalar]]] = {
    "fall": {Ending.FELL_FORWARD: _event(_fell_forward), Ending.FELL_BACK: _event(_fell_back)},
    "stop": {Ending.STOPPED: _event(has_stopped)},
    "stumble": {Ending.STUMBLED: _event(_stumbled)},
}
WATCHES = tuple(_EVENTS)


def ending_events(watch: tuple[str, ...]) -> dict[Ending, Callable[..., Scalar]]:
    """The conditions, for `diffrax.Event`, that end a solve whose `args` is the scene.

    The same functions each time: JAX's caches know what they have traced by the functions.
    """
    events = {Ending.SOLVER_FAILED: _failed}
    for name, conditions in _EVENTS.items():
        if name in watch:
            events |= conditions
    return events


def ending_code(
    events: Mapping[Ending, Scalar],
    *,
    done: Scalar,
    out_of_steps: Scalar,
    timed_out: Scalar,
    reached: Ending = Ending.WALKING,
) -> Scalar:
    """The code of how a solve ended, from conditions (booleans).

    `events` tells for each failure whether it happened, `done` whether the solve came to the end
    that was asked for, which is `reached`, and `timed_out` whether it waited too long for a
    footstep.
    """
    code = jnp.asarray(int(Ending.SOLVER_FAILED))
    code = jnp.where(out_of_steps, int(Ending.OUT_OF_STEPS), code)
    code = jnp.where(timed_out, int(Ending.TIMED_OUT), code)
    code = jnp.where(done, int(reached), code)
    for name, happened in events.items():
        code = jnp.where(happened, int(name), code)
    return code


def ending_surface(code: Scalar, scene: PyTree, end: PyTree, y: PyTree) -> Scalar:
    """Rises through zero where a compliant walk comes to the ending of a `code`.

    Of "walking" it is the last heel strike. Where several conditions make an ending, it is the one
    that is met last. NaN for endings that no state decides.

    Args:
        code: of an `Ending`.
        scene: what walks, in minimal or redundant coordinates.
        end: a state just past the ending, which decides between causes of the same code.
        y: the state of which the value is wanted.
    """
    minimal: PyTree = minimal_state(scene, y)
    past: PyTree = minimal_state(scene, end)
    structure, found = scene.mechanism.structure, feet(scene, y)
    legs = legs_at(scene, y)
    held = [
        _contact(scene, foot, legs[leg].rate)
        for foot, leg in zip(found, structure.leg_of_foot, strict=True)
    ]
    of_legs = [_most(*(held[k] for k in each)) for each in structure.feet_of_leg]
    fallen = fall_height(scene) - root_height(scene, minimal)
    barred = _turning(scene, found, legs)
    stumbled = _stumble(scene, found, held)
    values = {
        Ending.WALKING: _of_first_leg(structure, feet(scene, end), of_legs),
        Ending.FELL_FORWARD: jnp.where(has_fallen(scene, past), fallen, barred),
        Ending.FELL_BACK: fallen,
        Ending.STOPPED: _rest(scene, found, legs, of_legs, minimal),
        Ending.STUMBLED: jnp.where(has_stumbled(scene, past), stumbled, barred),
    }
    value = jnp.full_like(fallen, jnp.nan)
    for name, each in values.items():
        value = jnp.where(code == int(name), each, value)
    return value


def _least(*values: Scalar) -> Scalar:
    return functools.reduce(jnp.minimum, values)


def _most(*values: Scalar) -> Scalar:
    return functools.reduce(jnp.maximum, values)


def _of_first_leg(
    structure: Structure, feet_then: Sequence[FootMotion], values: Sequence[Scalar]
) -> Scalar:
    """The value of the leg that stands ahead of the others that touch."""
    places, value = leg_places(structure, feet_then), values[0]
    touching = touching_legs(structure, feet_then)
    first = jnp.where(touching[0], places[0], -jnp.inf)
    for place, touched, each in zip(places[1:], touching[1:], values[1:], strict=True):
        ahead = touched & (place >= first)
        first, value = jnp.where(ahead, place, first), jnp.where(ahead, each, value)
    return value


def _contact(scene: Scene, foot: FootMotion, rate: Scalar) -> Scalar:
    """Above zero where a foot touches."""
    if not isinstance(scene.clearance, StanceRotation):
        return foot.penetration
    return jnp.minimum(foot.penetration, -rate)


def _turning(scene: Scene, found: Sequence[FootMotion], legs: Sequence[LegMotion]) -> Scalar:
    """Above zero where a leg with a foot under the ground turns back; see `is_barred`."""
    if not isinstance(scene.clearance, StanceRotation):
        return jnp.full_like(legs[0].rate, -jnp.inf)
    slow = REST_RATE * rate_unit(scene)
    depths = [leg_depth(scene.mechanism.structure, found, i) for i in range(len(legs))]
    return _most(
        *(
            jnp.where(leg.rate < 0.0, -jnp.inf, _least(depth, slow - leg.rate))
            for depth, leg in zip(depths, legs, strict=True)
        )
    )


def _rest(
    scene: Scene,
    found: Sequence[FootMotion],
    legs: Sequence[LegMotion],
    held: Sequence[Scalar],
    state: PyTree,
) -> Scalar:
    """Above zero where the leg that stands alone is at rest, or all the walker is."""
    if not isinstance(scene.clearance, StanceRotation):
        still = REST_ENERGY * energy_unit(scene) - energies(scene, state).kinetic
        return jnp.minimum(_most(*held), still)
    slow = REST_RATE * rate_unit(scene)
    at_rest = []
    for i, leg in enumerate(legs):
        others = (-each for k, each in enumerate(held) if k != i)
        depth = leg_depth(scene.mechanism.structure, found, i)
        at_rest.append(_least(depth, leg.rate + slow, *others))
    return _most(*at_rest)


def _stumble(scene: Scene, found: Sequence[FootMotion], held: Sequence[Scalar]) -> Scalar:
    """Above zero where a rear foot comes down, moving forward, while another leg carries."""
    least = STUMBLE_SPEED * speed_unit(scene)

    def trips(i: int, j: int) -> Scalar:
        rear, front = found[i], found[j]
        entering = rear.penetration_rate - jnp.maximum(front.penetration_rate, 0.0)
        fast = _least(rear.penetration_rate - least, rear.slip_speed - least)
        return _least(held[i], held[j], front.x - rear.x, entering, fast)

    pairs = foot_pairs(scene.mechanism.structure)
    return _most(jnp.full_like(held[0], -jnp.inf), *(trips(i, j) for i, j in pairs))
