"""Recordings of rigid walks: footstep by footstep, the names of bodies exchanged back."""

import functools
from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxbiped._types import Scalar
from jaxbiped.dynamics._energy import kinetic_and_moment
from jaxbiped.dynamics._mode_changes import foot_loads
from jaxbiped.dynamics._rolling import ground_force, turning_of
from jaxbiped.dynamics._stance import Stance, of_stance
from jaxbiped.dynamics._state import whole_state
from jaxbiped.measure._samples import places_of_standing
from jaxbiped.plot._rigid_motion import RigidMotion, rigid_motion
from jaxbiped.plot._skeleton import body_motion
from jaxbiped.plot.viewer._recording import Footprint, Recording, recording, time_unit
from jaxbiped.scene._scene import RigidScene
from jaxbiped.solve._trajectory import Trajectory

_EVEN, _MOST = 0.05, 200
"""Knots of a footstep are this far apart [√(height/g)], as far as there are not more of them."""


def record_rigid_walk(scene: RigidScene, walk: Trajectory[Any], name: str) -> Recording:
    """A recording of a rigid walk from its first heel strike.

    Where the mode changes rates jump: there are knots on both sides.
    """
    motion = rigid_motion(scene, walk)
    t = _knot_times(motion, _EVEN * time_unit(scene))
    channels = motion.along(_quantities, t)
    height = channels.pop("gravitational")
    channels["supplied"] = height[0] - height
    total = channels["kinetic"] - channels["supplied"]
    channels["lost"] = total[0] - total
    return recording(scene, name, walk.outcome, t, channels, _footprints(motion))


def _knot_times(motion: RigidMotion, apart: float) -> np.ndarray:
    """Even times within each footstep [s], and both sides of all jumps."""
    times = [motion.both_sides()]
    for first, last in zip(motion.began, [*motion.began[1:], motion.end], strict=True):
        count = min(max(int(np.ceil((last - first) / apart)), 8), _MOST)
        times.append(np.linspace(first, last, count + 1)[:-1])
    return np.unique(np.concatenate(times))


def _quantities(scene: RigidScene, state: Any) -> dict[str, Scalar]:
    whole = whole_state(scene, state)
    kinetic, moment = kinetic_and_moment(scene, whole)
    energies = {"kinetic": kinetic, "gravitational": scene.ground.g * moment}
    forces = of_stance(scene, state, functools.partial(_forces, scene))
    return body_motion(scene, whole) | forces | energies


def _forces(scene: RigidScene, stance: Stance) -> dict[str, Scalar]:
    """The ground's forces on all feet [N]: of two that stand the tangential one is the first's."""
    turning = turning_of(scene, stance)
    force = ground_force(scene, stance, turning.free)
    normal, tangential = force.normal, jnp.asarray(force.tangential)
    nothing = jnp.zeros_like(normal)
    names = range(1, len(scene.mechanism.feet) + 1)
    found = {f"{word}_{k}": nothing for word in ("normal", "tangential") for k in names}
    by_foot = [(normal, tangential)]
    if stance.stands:
        first, second = stance.stands
        loads = foot_loads(scene, stance, turning)
        by_foot = [
            (jnp.where(first & second, load, jnp.where(stands, normal, 0.0)), along)
            for load, stands, along in (
                (loads[0], first, jnp.where(first, tangential, 0.0)),
                (loads[1], second, jnp.where(first, 0.0, tangential)),
            )
        ]
    for k, (down, along) in zip(stance.feet, by_foot, strict=True):
        found |= {f"normal_{k + 1}": down, f"tangential_{k + 1}": along}
    return found


def _footprints(motion: RigidMotion) -> list[Footprint]:
    """Where each footstep's stance foot comes down."""
    place = places_of_standing(motion.scene, motion.starts)
    return [
        Footprint(float(time), 1 + int(leg), float(x), strike=bool(time > 0.0))
        for time, leg, x in zip(motion.began, motion.standing_legs(), place, strict=True)
    ]
