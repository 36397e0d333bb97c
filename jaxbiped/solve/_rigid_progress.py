"""Progress of a rigid walk: its inputs, and what is carried from step to step."""

from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxbiped._types import Scalar, select
from jaxbiped.dynamics._mode_changes import change_mode
from jaxbiped.dynamics._stance import Stance, of_stance
from jaxbiped.dynamics._stance_motion import ground_force, rolling_rates
from jaxbiped.scene._rigid_feet import rigid_modes
from jaxbiped.scene._scene import RigidScene
from jaxbiped.solve._mode_steps import SurfaceCourse, course_of

_FIRST_STEP = 0.03
"""First step, in units of √(l/g)."""
_STRETCH = 1.15
"""By how much a step may be longer than chosen to end where a strike is due."""


class RigidWalk(NamedTuple):
    """One walk's inputs; every leaf a floating-point number.

    Attributes:
        scene, state: what walks, and from where.
        duration: simulated time [s].
        footsteps: heel strikes after which to end, 0 for no limit.
        rtol: relative tolerance; the absolute one (SI) is a hundredth of it.
        max_attempts: cap on the attempted steps.
    """

    scene: RigidScene
    state: Any
    duration: Scalar
    footsteps: Scalar
    rtol: Scalar
    max_attempts: Scalar


class RigidProgress(NamedTuple):
    """What is carried from one attempted step to the next.

    Attributes:
        t, state: so far; the place is the standing foot's at its body's angle 0, which changes
            where another foot stands. `state_with_hip` gives the root point's own.
        rates: angular accelerations there [rad/s²].
        step: to attempt next [s]; negative while a heel strike or a fall is landed on from beyond.
        pace: the last free step, with which the next footstep begins.
        strike, period: time of the last heel strike, and since the one before it [s].
        due: when the next one is expected [s]; infinite while footsteps differ in their periods.
        landing: number of Newton steps onto a heel strike or a fall, 0 in free motion.
        falling: whether that is a fall.
        struck: whether the last attempt ended by a heel strike.
        footsteps: how many so far.
        grazes: steps so far of which the tolerance does not tell whether the foot came down.
        pulls: steps so far behind which the walker `is_pulled`, where they are counted.
        accepted, rejected: attempted steps so far, by what became of them.
        code: of the `Ending` that came, 0 for none.
        modes: what is known of mode changes; None where only one mode can occur.
    """

    t: Scalar
    state: Any
    rates: tuple[Scalar, ...]
    step: Scalar
    pace: Scalar
    strike: Scalar
    period: Scalar
    due: Scalar
    landing: Scalar
    falling: Scalar
    struck: Scalar
    footsteps: Scalar
    grazes: Scalar
    pulls: Scalar
    accepted: Scalar
    rejected: Scalar
    code: Scalar
    modes: "ModeProgress | None" = None


class ModeProgress(NamedTuple):
    """What is carried of mode changes.

    Attributes:
        course: the surfaces at the state.
        changing: number of the one that the next step leads onto, counted from one; 0 for none.
        changed: whether the last attempt ended by a change of mode.
        begin: the first mode.
        met: when each was last changed at [s].
        paces: first steps behind a heel strike, then behind each change [s]; 0 where unknown.
        behind: number of the one of these that the next step begins from, counted from one; 0 for
            none.
    """

    course: SurfaceCourse
    changing: Scalar
    changed: Scalar
    begin: Scalar
    met: Scalar
    paces: Scalar
    behind: Scalar


def initial_progress(walk: RigidWalk) -> RigidProgress:
    """Before the first step."""
    zero = jnp.zeros_like(walk.duration)
    none = jnp.zeros((), dtype=jnp.int64)
    step = _FIRST_STEP * jnp.sqrt(walk.scene.mechanism.height / walk.scene.ground.g)
    step = jnp.minimum(step, walk.duration)
    no = jnp.asarray(False)
    state, modes = walk.state, None
    if rigid_modes(walk.scene.mechanism).may_change:
        state = change_mode(walk.scene, state)
        course = course_of(walk.scene, state)
        paces = jnp.zeros(1 + len(course.values), zero.dtype)
        met = jnp.full_like(paces[1:], -jnp.inf)
        modes = ModeProgress(course, none, no, state.mode, met, paces, none)
    rates = rolling_rates(walk.scene, state) if modes is None else modes.course.turning
    never = jnp.full_like(zero, jnp.inf)
    return RigidProgress(
        t=zero,
        state=shifted(state, -root_place(walk, state)),
        rates=rates,
        step=step,
        pace=step,
        strike=zero,
        period=never,
        due=never,
        landing=none,
        falling=no,
        struck=no,
        footsteps=none,
        grazes=none,
        pulls=none,
        accepted=none,
        rejected=none,
        code=none,
        modes=modes,
    )


def with_next_step(walk: RigidWalk, after: RigidProgress) -> RigidProgress:
    """With its step, unless it lands: the pace, or what ends it where an event or the end is due.

    Where footsteps last alike a mode changes as long behind the strike as it did in the last one.
    """
    left, modes = after.due - after.t, after.modes
    changing, least = jnp.zeros_like(after.landing), 1e-6 * after.period
    if modes is not None:
        steady = after.due < jnp.inf
        for k, met in enumerate(modes.met, start=1):
            waits = met + after.period - after.t
            first = steady & (waits > least) & (waits < left)
            left, changing = select(first, (waits, jnp.full_like(changing, k)), (left, changing))
    hits = (left > least) & (left <= _STRETCH * after.pace)
    step = jnp.minimum(jnp.where(hits, left, after.pace), walk.duration - after.t)
    lands = after.landing > 0
    if modes is not None:
        changing = jnp.where(lands, modes.changing, jnp.where(hits, changing, 0))
        modes = modes._replace(changing=changing)
    return after._replace(step=jnp.where(lands, after.step, step), modes=modes)


def state_with_hip(walk: RigidWalk, now: RigidProgress) -> Any:
    """The state with the root point where it is."""
    return shifted(now.state, root_place(walk, now.state))


def root_place(walk: RigidWalk, state: Any) -> Scalar:
    """Where the root point is from the place of the standing foot at its body's angle 0 [m]."""
    return of_stance(walk.scene, state, lambda stance: stance.root.x)


def is_pulled(walk: RigidWalk, now: RigidProgress) -> Scalar:
    """Whether the ground has to pull on the leg that stands, where a real foot would fly."""

    def load(stance: Stance) -> Scalar:
        return ground_force(walk.scene, stance, now.rates).normal

    return (now.landing == 0) & (of_stance(walk.scene, now.state, load) < 0.0)


def shifted(state: Any, distance: Scalar) -> Any:
    """A state farther down the slope [m]."""
    return type(state)(state[0] + distance, *state[1:])
