"""Impact of the rigid walker, the push-off before it, and checks of what the rigid limit assumes.

The heel strike is plastic.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import check_not_negative, check_type
from jaxbiped._types import Scalar
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.compiler import kept_alone
from jaxbiped.dynamics._actuation import actuators_of
from jaxbiped.dynamics._equivalent_states import exchange_legs
from jaxbiped.dynamics._footfalls import mean
from jaxbiped.dynamics._joint_loads import with_constraint_torques
from jaxbiped.dynamics._mode_changes import (
    SLACK,
    grip_at_strike,
    mode_after_strike,
    settled,
    with_clock_restarted,
    with_mode,
    with_rates,
)
from jaxbiped.dynamics._stance import Stance, of_stance
from jaxbiped.dynamics._stance_motion import Impulse, plastic_impact, rolling
from jaxbiped.dynamics._surfaces import clearance
from jaxbiped.dynamics._tree import Loads, rehung
from jaxbiped.dynamics._tree_inertia import composites, eliminate
from jaxbiped.scene._modes import leg_after_strike, rigid_modes
from jaxbiped.scene._scene import RigidScene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.scene._structure import Indices
from jaxbiped.scene.actuation._actuators import PushOff


class Impact(NamedTuple):
    """Result of an impact.

    Attributes:
        state: state after the impact, with the names of each mirrored pair exchanged: the second
            one stands again.
        impulse_x, impulse_z: impulse of the ground on the foot that came down [N·s].
        lifting: speed at which the foot that stood leaves the ground afterwards [m/s]. If it is
            below zero, the ground would have held this foot, which would have shared the impact.
    """

    state: Any
    impulse_x: Scalar
    impulse_z: Scalar
    lifting: Scalar


@kept_alone
def impact(scene: RigidScene, state: Any) -> Impact:
    """The plastic impact of the swing leg; the standing leg is released at the same moment.

    The impulse acts at the point where the new foot touches. It does not affect motions that roll
    about that point, so the momenta of their rates are conserved; the velocity of the foot at its
    lowest point is lost. A push-off occurs just before, and its impulse on the root point adds to
    these momenta. Stops that are held take part. Of those that are not locked, the ones that would
    have to pull are released, the worst first.

    Args:
        scene: the rigid walker.
        state: of the scene's kind, just before the impact, SI units.

    Returns:
        The state just after the impact, with sides exchanged, the impulse [N·s] and the lifting
        speed [m/s], leaves shaped as the state's.
    """
    return of_stance(scene, state, lambda old: _impact(scene, state, old))


def _impact(scene: RigidScene, state: Any, old: Stance) -> Impact:
    mechanism, feet = old.mechanism, old.next_feet
    lands = _lands(old, feet) if len(feet) > 1 else ()
    modes, pushed = rigid_modes(mechanism), push_off_impulse(scene, old)
    found = plastic_impact(old, feet, lands, pushed, modes, grip_at_strike(scene, old))
    lifting = mean([found.stance.foot(k).vz for k in old.feet])
    after = with_clock_restarted(with_rates(state, found.stance))
    if not modes.any:
        return Impact(exchange_legs(scene, after), *found.impulse, lifting)
    then = with_mode(scene, exchange_legs(scene, after), mode_after_strike(scene, old, found))
    leg = leg_after_strike(mechanism.structure, old.leg)
    return Impact(settled(scene, then, leg), *found.impulse, lifting)


def _lands(old: Stance, feet: Indices) -> tuple[Scalar, ...]:
    """Which of two feet come down: the lower one, or both at once."""
    first, second = (old.height(k) for k in feet)
    near = SLACK * old.mechanism.height
    return first <= second + near, second <= first + near


def push_off_impulse(scene: RigidScene, stance: Stance) -> Impulse | None:
    """The impulse just before the impact; None where the scene has no push-off.

    From the standing foot to the root point: along a leg of one body, which it does not turn.
    """
    parts = actuators_of(scene, PushOff)
    if not parts:
        return None
    size = parts[0].impulse
    for part in parts[1:]:
        size = size + part.impulse
    root, foot = stance.root, stance.pose.motion
    x, z = root.x - foot.x, root.z - foot.z
    size = size / jnp.sqrt(x * x + z * z)
    return Impulse(size * x, size * z)


@kept_alone
def push_off_work(scene: RigidScene, state: Any) -> Scalar:
    """Work of the push-off at a state just before the impact [J]; zero without one.

    It is the impulse times the mean of the root point's velocities along it before and after. In
    between, neither foot is held and the walker is free.

    Args:
        scene: the rigid walker.
        state: of the scene's kind, leaves of any common shape, SI units.

    Returns:
        The work [J], shaped as the state's leaves.
    """
    return of_stance(scene, state, lambda stance: _push_off_work(scene, stance))


def _push_off_work(scene: RigidScene, stance: Stance) -> Scalar:
    impulse = push_off_impulse(scene, stance)
    if impulse is None:
        return jnp.zeros_like(stance.pose.motion.x)
    mechanism, before = stance.mechanism, stance.root
    structure, known = mechanism.structure, composites(mechanism)
    factors = eliminate(structure, known, rehung(mechanism, stance.pose))
    loads = Loads.none(structure)._replace(x=impulse.x, z=impulse.z)
    gain_x, gain_z, *_ = with_constraint_torques(structure, mechanism.joints, factors, loads)
    work: Scalar = impulse.x * (before.vx + 0.5 * gain_x)
    return work + impulse.z * (before.vz + 0.5 * gain_z)


class RigidChecks(NamedTuple):
    """Requirements of a footstep on the ground, at n states in order of time.

    Attributes:
        normal: normal force on the stance foot [N], shape (n,); if it is below zero, the foot
            flies.
        needed_friction: smallest coefficient of friction that prevents slip [–], shape (n,);
            infinite if the foot flies.
        clearance: height of the swing foot above the ground [m], shape (n,); if it is below zero,
            the foot scuffs.
        impact_friction: the same coefficient for the impact that ends the footstep.
        lifting: speed at which the trailing foot leaves the ground after the impact [m/s]; if it is
            below zero, the ground would have held the foot.
    """

    normal: Scalar
    needed_friction: Scalar
    clearance: Scalar
    impact_friction: Scalar
    lifting: Scalar

    @property
    def flies(self) -> Scalar:
        """Whether the stance foot would leave the ground (booleans, shape (n,))."""
        return self.normal <= 0.0

    @property
    def scuffs(self) -> Scalar:
        """Whether the swing foot is below the ground (booleans, shape (n,))."""
        return self.clearance < 0.0

    def slips(self, mu: float) -> Scalar:
        """Whether a foot with this coefficient of friction would slip (booleans, shape (n,)).

        Raises:
            ArgumentError: mu below 0.
        """
        check_not_negative("mu", mu)
        return self.needed_friction > mu


def rigid_checks(scene: RigidScene, states: Any) -> RigidChecks:
    """Checks a footstep from a series of its states, such as `gait.orbit[1]`.

    Args:
        scene: the walker.
        states: n states in order, with leaves of any shape that has n entries; states that are not
            finite are left out. The last one counts as the moment of the impact.

    Returns:
        The requirements of the footstep, with leaves of shape (n,), and those of its impact,
            scalars.

    Raises:
        ArgumentError: an argument has the wrong type.
    """
    scene = check_scene(scene, RigidScene)
    check_type("states", states, scene.state_type)
    states = jtu.tree_map(lambda leaf: np.ravel(np.asarray(leaf)), states)
    known = np.isfinite(states[1])
    last = np.max(np.flatnonzero(known), initial=0)
    # Of all states: one program then serves for any number of those that are known.
    found = _checks(scene, jtu.tree_map(jnp.asarray, states), jnp.asarray(last))

    def of_known(leaf: Scalar) -> Scalar:
        return jnp.asarray(np.asarray(leaf)[known])

    return found._replace(
        normal=of_known(found.normal),
        needed_friction=of_known(found.needed_friction),
        clearance=of_known(found.clearance),
    )


@cached_jit
def _checks(scene: RigidScene, states: Any, last: Scalar) -> RigidChecks:
    """The checks of n states, shape (n,), the impact's at the last of them."""
    force = rolling(scene, states).force
    normal, tangential = force.normal, jnp.abs(jnp.asarray(force.tangential))
    needed = jnp.where(normal > 0.0, tangential / jnp.where(normal > 0.0, normal, 1.0), jnp.inf)
    struck = impact(scene, jtu.tree_map(lambda leaf: leaf[last], states))
    return RigidChecks(
        normal=normal,
        needed_friction=needed,
        clearance=clearance(scene, states),
        impact_friction=jnp.abs(struck.impulse_x) / struck.impulse_z,
        lifting=struck.lifting,
    )
