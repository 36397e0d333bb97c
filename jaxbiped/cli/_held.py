"""Constraint report of `jaxbiped walk`: violations of the hip's constraints."""

from typing import cast

import numpy as np

from jaxbiped._types import JsonObject
from jaxbiped.constraints._constraint_methods import name_of
from jaxbiped.dynamics._redundant_motion import hip_force, violation
from jaxbiped.dynamics._redundant_state import LegsState
from jaxbiped.scene._scene import RedundantScene
from jaxbiped.solve._trajectory import Trajectory


def constraint_numbers(scene: RedundantScene, trajectory: Trajectory) -> JsonObject:
    """Largest violations at the ends of the steps and what was corrected at the start (SI)."""
    off = violation(scene, cast("LegsState", trajectory.state))
    force = hip_force(scene, trajectory.state)
    correction = trajectory.correction
    return {
        "formulation": "redundant",
        "method": name_of(scene.method),
        "orientation": scene.orientation,
        "max_violation_m": float(np.max(off.position)),
        "max_violation_rate": float(np.max(off.rate)),
        "max_hip_force_N": float(np.max(np.hypot(force.x, force.z))),
        "start_correction_m": float(correction.position),
        "start_correction_m_s": float(correction.velocity),
    }


def constraint_sentence(numbers: JsonObject) -> str:
    """The same for people."""
    return (
        f"{numbers['method']}: the hip opens by at most {numbers['max_violation_m']:.1e} m and "
        f"{numbers['max_violation_rate']:.1e} m/s, and carries at most "
        f"{numbers['max_hip_force_N']:.0f} N; the start was corrected by "
        f"{numbers['start_correction_m']:.1e} m and {numbers['start_correction_m_s']:.1e} m/s"
    )
