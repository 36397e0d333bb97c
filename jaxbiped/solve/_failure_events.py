"""Failure events, which end a simulation, and the surfaces of the state on which endings lie."""

from collections.abc import Callable, Mapping

import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Scalar, Time
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._contacts import Foot, feet, touches
from jaxbiped.dynamics._energy import energies
from jaxbiped.dynamics._minimal_motion import accelerations
from jaxbiped.dynamics._redundant_state import minimal_state
from jaxbiped.dynamics._state import RigidState, State
from jaxbiped.scene._ground import StanceRotation
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._fusion_barrier import fusion_barrier

FALL_ANGLE = 1.0
"""A hip lower than a leg at this angle [rad] could carry it has fallen."""
REST_RATE = 1e-4
"""Rate of a leg at rest, in units of √(g/l)."""
_LOST_RATE = 0.1
"""Rate, in the same units, up to which a leg that turned back has just lost its ground."""
REST_ENERGY = 1e-10
"""Kinetic energy of a walker at rest, in units of its weight times l."""
STUMBLE_SPEED = 1e-3
"""Speed at which a rear foot comes down, in units of √(g l), from which it counts as a stumble."""


def fall_height(scene: Scene) -> Scalar:
    """How high a leg at 1 rad could carry the hip [m]."""
    return scene.walker.r + scene.walker.hip_to_foot * jnp.cos(FALL_ANGLE)


def has_fallen(scene: Scene, state: State) -> Scalar:
    """Whether the hip is lower than a leg at 1 rad could carry it (boolean)."""
    return state.hip_z < fall_height(scene)


def _energy_unit(scene: Scene) -> Scalar:
    """The walker's weight times its leg's length [J]."""
    return scene.walker.total_mass * scene.ground.g * scene.walker.l


@cached_jit  # for its trace cache
def is_barred(scene: Scene, state: State) -> tuple[Scalar, Scalar]:
    """Whether the motion has no continuation at the surface where a leg turns back (two booleans).

    Under the paper's clearance rule contact comes on when a swing leg turns back (θ̇ falls to
    zero). Where its foot is under the ground by then, the reaction is there at once, and may push
    the leg forward again, into the side where there is none: neither side lets it go on. The
    first boolean: the foot is ahead of the other; the second: behind.
    """
    never = jnp.zeros_like(state.hip_z, dtype=bool)
    if not isinstance(scene.clearance, StanceRotation):
        return never, never
    foot_1, foot_2 = feet(scene, state)
    unit = jnp.sqrt(scene.ground.g / scene.walker.l)

    def turning(foot: Foot, rate: Scalar) -> Scalar:
        return (foot.penetration > 0.0) & (rate >= 0.0) & (rate < REST_RATE * unit)

    turning_1 = turning(foot_1, state.omega_1)
    turning_2 = turning(foot_2, state.omega_2)

    def attracted() -> tuple[Scalar, Scalar]:
        # Small enough for no force to feel it. Processors take very long over still smaller
        # numbers' products, which have no leading digits.
        barely_back = jnp.full_like(state.hip_z, -(jnp.finfo(state.hip_z.dtype).tiny ** 0.25))
        off = accelerations(scene, state)
        on_1 = accelerations(scene, state._replace(omega_1=barely_back))
        on_2 = accelerations(scene, state._replace(omega_2=barely_back))
        barred_1 = (off.alpha_1 < 0.0) & (on_1.alpha_1 > 0.0)
        barred_2 = (off.alpha_2 < 0.0) & (on_2.alpha_2 > 0.0)
        return barred_1, barred_2

    attracted_1, attracted_2 = fusion_barrier(turning_1 | turning_2, attracted)
    barred_1, barred_2 = turning_1 & attracted_1, turning_2 & attracted_2
    first_ahead = foot_1.x > foot_2.x
    ahead = (barred_1 & first_ahead) | (barred_2 & ~first_ahead)
    return ahead, (barred_1 | barred_2) & ~ahead


@cached_jit  # for its trace cache
def has_stopped(scene: Scene, state: State) -> Scalar:
    """Whether the stance leg is at rest in single support, or all the walker is (boolean)."""
    foot_1, foot_2 = feet(scene, state)
    touch_1, touch_2 = touches(foot_1), touches(foot_2)
    if not isinstance(scene.clearance, StanceRotation):
        unit = _energy_unit(scene)
        at_rest = energies(scene, state).kinetic < REST_ENERGY * unit
        return (touch_1 | touch_2) & at_rest
    unit = jnp.sqrt(scene.ground.g / scene.walker.l)

    def at_rest_on(carries: Scalar, other: Scalar, rate: Scalar) -> Scalar:
        return carries & ~other & (rate > -REST_RATE * unit)

    def lost(foot: Foot, rate: Scalar) -> Scalar:
        return (foot.penetration > 0.0) & (rate >= 0.0) & (rate < _LOST_RATE * unit)

    slow = at_rest_on(touch_1, touch_2, state.omega_1) | at_rest_on(touch_2, touch_1, state.omega_2)
    sinking = lost(foot_1, state.omega_1) | lost(foot_2, state.omega_2)
    return slow | (~touch_1 & ~touch_2 & sinking)


@cached_jit  # for its trace cache
def has_stumbled(scene: Scene, state: State) -> Scalar:
    """Whether the rear foot comes down, moving forward, while the other carries (boolean)."""
    foot_1, foot_2 = feet(scene, state)
    unit = jnp.sqrt(scene.ground.g * scene.walker.l)

    def trips(rear: Foot, front: Foot) -> Scalar:
        entering = rear.penetration_rate > jnp.maximum(front.penetration_rate, 0.0)
        fast = rear.penetration_rate > STUMBLE_SPEED * unit
        return (rear.x < front.x) & entering & fast & (rear.slip_speed > STUMBLE_SPEED * unit)

    both = touches(foot_1) & touches(foot_2)
    return both & (trips(foot_1, foot_2) | trips(foot_2, foot_1))


def rigid_ending(state: RigidState) -> Scalar:
    """Code of the `Ending` that has come to a rigid walker, 0 where it goes on.

    Its hip comes down as a compliant one's does: when the stance leg is 1 rad from upright.
    """
    code = jnp.where(state.theta_2 < -FALL_ANGLE, int(Ending.FELL_FORWARD), 0)
    code = jnp.where(state.theta_2 > FALL_ANGLE, int(Ending.FELL_BACK), code)
    return jnp.where(jnp.isfinite(sum(state)), code, int(Ending.SOLVER_FAILED))


def _failed(t: Time, y: PyTree, args: PyTree, **kwargs: object) -> Scalar:
    return ~jnp.isfinite(sum(jtu.tree_leaves(y)))


def _event(condition: Callable[[Scene, State], Scalar]) -> Callable[..., Scalar]:
    """A condition of scene and minimal state as diffrax asks it."""

    def happens(t: Time, y: PyTree, args: PyTree, **kwargs: object) -> Scalar:
        return condition(args, minimal_state(args, y))

    return happens


def _fell_forward(scene: Scene, y: State) -> Scalar:
    too_late, _ = is_barred(scene, y)
    return too_late | (has_fallen(scene, y) & (y.hip_vx >= 0.0))


def _fell_back(scene: Scene, y: State) -> Scalar:
    return has_fallen(scene, y) & (y.hip_vx < 0.0)


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
    events: Mapping[Ending, Scalar], *, done: Scalar, out_of_steps: Scalar, timed_out: Scalar
) -> Scalar:
    """The code of how a solve ended.

    Args:
        events: for each failure, whether it happened (boolean).
        done: whether the solve came to the end that was asked for.
        out_of_steps: whether it came to its cap on steps.
        timed_out: whether it waited too long for a footstep.
    """
    code = jnp.asarray(int(Ending.SOLVER_FAILED))
    code = jnp.where(out_of_steps, int(Ending.OUT_OF_STEPS), code)
    code = jnp.where(timed_out, int(Ending.TIMED_OUT), code)
    code = jnp.where(done, int(Ending.WALKING), code)
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
    both = feet(scene, y)
    held = [_contact(scene, foot, rate) for foot, rate in zip(both, _rates(minimal), strict=True)]
    feet_then = feet(scene, end)
    fallen = fall_height(scene) - minimal.hip_z
    barred = _turning(scene, both, minimal)
    stumbled = _stumble(scene, both, held)
    values = {
        Ending.WALKING: jnp.where(feet_then.foot_1.x > feet_then.foot_2.x, held[0], held[1]),
        Ending.FELL_FORWARD: jnp.where(has_fallen(scene, past), fallen, barred),
        Ending.FELL_BACK: fallen,
        Ending.STOPPED: _rest(scene, both, minimal, held),
        Ending.STUMBLED: jnp.where(has_stumbled(scene, past), stumbled, barred),
    }
    found = jnp.full_like(fallen, jnp.nan)
    for name, value in values.items():
        found = jnp.where(code == int(name), value, found)
    return found


def _rates(state: PyTree) -> tuple[Scalar, Scalar]:
    return state.omega_1, state.omega_2


def _least(*values: Scalar) -> Scalar:
    least = values[0]
    for value in values[1:]:
        least = jnp.minimum(least, value)
    return least


def _contact(scene: Scene, foot: Foot, rate: Scalar) -> Scalar:
    """Above zero where a foot touches."""
    if not isinstance(scene.clearance, StanceRotation):
        return foot.penetration
    return jnp.minimum(foot.penetration, -rate)


def _turning(scene: Scene, both: tuple[Foot, Foot], state: PyTree) -> Scalar:
    """Above zero where a leg whose foot is under the ground turns back; see `is_barred`."""
    if not isinstance(scene.clearance, StanceRotation):
        return jnp.full_like(state.hip_z, -jnp.inf)
    slow = REST_RATE * jnp.sqrt(scene.ground.g / scene.walker.l)
    legs = zip(both, _rates(state), strict=True)
    first, second = (
        jnp.where(rate < 0.0, -jnp.inf, _least(foot.penetration, slow - rate))
        for foot, rate in legs
    )
    return jnp.maximum(first, second)


def _rest(scene: Scene, both: tuple[Foot, Foot], state: PyTree, held: list[Scalar]) -> Scalar:
    """Above zero where the leg that stands alone is at rest, or all the walker is."""
    if not isinstance(scene.clearance, StanceRotation):
        unit = _energy_unit(scene)
        still = REST_ENERGY * unit - energies(scene, state).kinetic
        return jnp.minimum(jnp.maximum(*held), still)
    slow = REST_RATE * jnp.sqrt(scene.ground.g / scene.walker.l)
    first, second = (
        _least(foot.penetration, rate + slow, -held[1 - i])
        for i, (foot, rate) in enumerate(zip(both, _rates(state), strict=True))
    )
    return jnp.maximum(first, second)


def _stumble(scene: Scene, both: tuple[Foot, Foot], held: list[Scalar]) -> Scalar:
    """Above zero where the rear foot comes down, moving forward, while the other carries."""
    least = STUMBLE_SPEED * jnp.sqrt(scene.ground.g * scene.walker.l)

    def trips(rear: Foot, front: Foot) -> Scalar:
        entering = rear.penetration_rate - jnp.maximum(front.penetration_rate, 0.0)
        fast = _least(rear.penetration_rate - least, rear.slip_speed - least)
        return _least(*held, front.x - rear.x, entering, fast)

    return jnp.maximum(trips(*both), trips(both[1], both[0]))
