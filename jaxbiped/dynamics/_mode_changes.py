"""Changes of a rigid walker's mode: a stop that is hit or let go, a foot that comes down or lifts.

A mode goes on until one of its surfaces is reached. What holds by being pressed is let go as soon
as it would have to pull.
"""

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp

from jaxbiped._types import Scalar, select
from jaxbiped.compiler import kept_alone
from jaxbiped.dynamics._holds import ROUNDING, gap_of
from jaxbiped.dynamics._stance import Stance, of_stance, stance_on
from jaxbiped.dynamics._stance_motion import (
    Grip,
    Struck,
    Turning,
    ground_force,
    plastic_impact,
    turning_of,
)
from jaxbiped.dynamics._surfaces import rate_unit
from jaxbiped.scene._modes import THROUGH_STRIKE, Mode, Modes, leg_after_strike, rigid_modes
from jaxbiped.scene._scene import RigidScene
from jaxbiped.scene._state_types import CLOCK

SLACK = 1e-9
"""Distance from a limit [rad], and of a foot from the ground in units of the walker's height, at
which a mode may change."""
_FLIES = 1e-6
"""Rate, in the unit of rates, above which what an impact throws off leaves though it is pressed."""


def held_reactions(stance: Stance, turning: Turning) -> list[Scalar]:
    """Of limits that are held."""
    return turning.reactions[1:] if len(stance.feet) > 1 else turning.reactions


def loose_limits(modes: Modes, mode: Mode) -> list[Any]:
    """Of each limit, whether it is held only while it is pressed on."""
    by_lock = dict(zip(modes.locks, mode.loose, strict=True))
    return [by_lock.get(i, True) for i in range(len(modes.limits))]


def foot_loads(scene: RigidScene, stance: Stance, turning: Turning) -> tuple[Scalar, Scalar]:
    """Normal forces on both feet of a leg that lies flat [N].

    Where couplings keep them level, the weights are not determined and taken as equal.
    """
    first, second = stance.feet
    total = ground_force(scene, stance, turning.free).normal
    assert turning.holds is not None
    if not turning.holds.rows[0]:
        return 0.5 * total, 0.5 * total
    front = turning.reactions[0] / (stance.foot(second).x - stance.foot(first).x)
    return total - front, front


def with_mode(scene: RigidScene, state: Any, mode: Mode) -> Any:
    """A state in another mode."""
    modes = rigid_modes(scene.mechanism)
    return state._replace(mode=modes.encoded(jnp, mode, state.mode))


def with_rates(state: Any, stance: Stance) -> Any:
    """A state with the rates of a stance."""
    structure, count = stance.mechanism.structure, len(stance.mechanism.structure.free)
    turning = (stance.pose.motion.rates[j] for j in structure.free)
    return type(state)(*state[: 1 + count], *turning, *state[1 + 2 * count :])


def with_clock_restarted(state: Any) -> Any:
    """A state just behind a strike: its clock, if it has one, begins again."""
    clock = getattr(state, CLOCK, None)
    return state if clock is None else state._replace(**{CLOCK: jnp.zeros_like(clock)})


def grip_at_strike(scene: RigidScene, old: Stance) -> Grip:
    """What takes part in a heel strike.

    Locked limits of the leg that lands do whatever the impulse; those of the leg that stood do
    where their stops hold through heel strike, else while they are pressed on.
    """
    modes, mode = rigid_modes(old.mechanism), old.mode
    stood = old.leg
    loose = [
        each if limit.leg != stood or limit.holds == THROUGH_STRIKE else True
        for limit, each in zip(modes.limits, loose_limits(modes, mode), strict=True)
    ]
    hits = _hits(scene, old, modes, mode, SLACK)
    return Grip([held | hit for held, hit in zip(mode.held, hits, strict=True)], loose)


def _hits(
    scene: RigidScene, old: Stance, modes: Modes, mode: Mode, slack: Scalar | float
) -> list[Scalar]:
    """Limits that are reached, or that an angle rests at."""
    return [
        ~held & (gap_of(scene, limit, old) <= slack) & (rate <= _still(scene))
        for limit, held, rate in zip(modes.limits, mode.held, _gap_rates(old, modes), strict=True)
    ]


def _gap_rates(stance: Stance, modes: Modes) -> list[Any]:
    return [limit.gap.of(stance.pose.motion.rates) for limit in modes.limits]


def _still(scene: RigidScene) -> Scalar:
    """Rate below which an angle rests [rad/s]."""
    return SLACK * rate_unit(scene)


def mode_after_strike(scene: RigidScene, old: Stance, found: Struck) -> Mode:
    """The mode after a heel strike, sides exchanged: the leg that stood locks nothing any more."""
    modes, mode = rigid_modes(old.mechanism), old.mode
    stood = old.leg
    held = [found.held[i] for i in modes.twins]
    loose = dict(zip(modes.locks, mode.loose, strict=True))
    loose = {
        i: jnp.ones_like(each) if modes.limits[i].leg == stood else each & mode.held[i]
        for i, each in loose.items()
    }
    leg = leg_after_strike(old.mechanism.structure, stood)
    stands = modes.standing(leg, found.stands, old.pose.motion.x)
    return Mode(stands, tuple(held), tuple(loose[modes.twins[i]] for i in modes.locks))


@kept_alone
def change_mode(
    scene: RigidScene, state: Any, slack: Scalar | float = SLACK, least: Scalar | float = 0.0
) -> Any:
    """The state behind a surface of its mode, just there.

    Limits that are reached and a foot that comes down are hit at once, with all that is held; what
    would have to pull afterwards is let go.

    Args:
        scene: the rigid walker.
        state: on a surface, or not: it then stays as it is.
        slack: distance from a limit [rad], and of a foot from the ground in units of the walker's
            height, that counts as there.
        least: load below which a foot lifts, in units of the weight; likewise of stops.
    """
    return of_stance(scene, state, lambda old: _changed(scene, state, old, slack, least))


def change_mode_on_surface(scene: RigidScene, state: Any) -> Any:
    """The same of a state that lies on a surface of its mode, on whose side rounding alone decides.

    A load that has fallen to zero may be a little above it there, or 0 to the last bit.
    """
    return change_mode(scene, state, SLACK, SLACK)


def _changed(
    scene: RigidScene, state: Any, old: Stance, slack: Scalar | float, least: Scalar | float
) -> Any:
    mechanism, modes, mode = old.mechanism, rigid_modes(old.mechanism), old.mode
    if not old.may_hold:
        return state
    hits = _hits(scene, old, modes, mode, slack)
    comes = [
        ~stands & (old.height(k) <= slack * mechanism.height) & (old.foot(k).vz < 0.0)
        for k, stands in zip(old.feet, old.stands, strict=False)
    ]
    held = [a | b for a, b in zip(mode.held, hits, strict=True)]
    stands = tuple(a | b for a, b in zip(old.stands, comes, strict=True))
    grip = Grip(held, loose_limits(modes, mode))
    found = plastic_impact(old, old.feet, stands, None, modes, grip)
    # What rests at a limit has not hit it: it locks nothing.
    rests = [jnp.abs(rate) <= _still(scene) for rate in _gap_rates(old, modes)]
    loose = [
        jnp.where(hits[i], rests[i], each & mode.held[i])
        for i, each in zip(modes.locks, mode.loose, strict=True)
    ]
    stays, lies = _staying(scene, found, grip.held, stands)
    stands = modes.standing(old.leg, lies, state.mode)
    then = Mode(stands, tuple(stays), tuple(loose))
    struck = with_mode(scene, with_rates(state, found.stance), then)
    happens = jnp.zeros_like(state.mode, dtype=bool)
    for each in (*hits, *comes):
        happens = happens | each
    return settled(scene, select(happens, struck, state), old.leg, least)


def _staying(
    scene: RigidScene, found: Struck, held: Sequence[Scalar], stands: tuple[Scalar, ...]
) -> tuple[list[Scalar], tuple[Scalar, ...]]:
    """Which limits, and which feet of a leg, stay after an impact.

    Those that leave very slowly stay, too: two that throw each other off come down ever sooner,
    infinitely often in a finite time. Behind that time both are at rest.
    """
    slow, modes = _FLIES * rate_unit(scene), rigid_modes(scene.mechanism)
    rates = _gap_rates(found.stance, modes)
    stay = [now | (was & (v <= slow)) for now, was, v in zip(found.held, held, rates, strict=True)]
    feet, fast = zip(found.stance.feet, stands, strict=False), slow * scene.mechanism.height
    lie = [was & (found.stance.foot(k).vz <= fast) for k, was in feet]
    return stay, tuple(now | low for now, low in zip(found.stands, lie, strict=True))


def settled(scene: RigidScene, state: Any, leg: int, least: Scalar | float = 0.0) -> Any:
    """The state without what would have to pull: limits of stops, and one foot of two.

    `leg`: the one that stands; `least`: as of `change_mode`.
    """
    found, stance = _pressed(scene, state, leg, least), stance_on(scene, state, leg)
    if not stance.stands:
        return found
    first, second = stance.stands
    loads = foot_loads(scene, *_turned(scene, found, leg))
    bearing = least * (scene.mechanism.total_mass * scene.ground.g)
    lifts = first & second & (jnp.minimum(*loads) < bearing)
    less = loads[0] < loads[1]
    stays = first & ~(lifts & less), second & ~(lifts & ~less)
    stands = rigid_modes(scene.mechanism).standing(leg, stays, state.mode)
    tipped = with_mode(scene, state, stance.mode._replace(stands=stands))
    return select(lifts, _pressed(scene, tipped, leg, least), found)


def _turned(scene: RigidScene, state: Any, leg: int) -> tuple[Stance, Turning]:
    stance = stance_on(scene, state, leg)
    return stance, turning_of(scene, stance)


def _pressed(scene: RigidScene, state: Any, leg: int, least: Scalar | float) -> Any:
    """The state without limits that would have to pull on feet that stay; the others at rest."""
    mechanism, modes = scene.mechanism, rigid_modes(scene.mechanism)
    stance, turning = _turned(scene, state, leg)
    mode, holds, held = stance.mode, turning.holds, stance.held
    if holds is None:
        return state
    count = len(held) - len(modes.limits)
    if modes.limits:
        loose = [*[False] * count, *loose_limits(modes, mode)]
        pressed = least * (scene.ground.g / mechanism.height) - ROUNDING
        held = holds.pressed(turning.unheld, held, loose, pressed)
    tree, rates = stance.tree, stance.pose.motion.rates
    free = {row: rates[j] for row, j in zip(tree.rows, tree.structure.free, strict=True)}
    rest = tree.free_values(holds.under(free, holds.reactions(free, held)))
    first = 1 + len(rest)
    state = type(state)(*state[:first], *rest, *state[first + len(rest) :])
    return with_mode(scene, state, mode._replace(held=tuple(held[count:])))
