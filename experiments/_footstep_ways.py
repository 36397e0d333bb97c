"""Our way to differentiate a footstep, and the collocation that it is held against."""

import jax.numpy as jnp
import numpy as np
from _gradient_ways import Answer, Run, relative_error, with_estimate
from reference.footstep import MID_STANCE as START
from reference.footstep import PARAMETERS, Footstep, footstep

import jaxbiped as jb

OUTPUTS = ("time", "hip_x", "hip_z", "theta_2", "hip_vx", "hip_vz", "omega_1", "omega_2")
"""Of a footstep, at whose end leg 1 is upright."""
INPUTS = ("hip_z", "theta_1", "theta_2", "hip_vx", "hip_vz", "omega_1", "omega_2", *PARAMETERS)
"""What they are differentiated with respect to: the start, and logarithms of parameters."""
UPRIGHT = 2
"""θ1 among the state's numbers."""


def answer_of(found: Footstep) -> Answer:
    """Outputs and their derivatives."""
    rows = np.vstack([found.time_gradient, np.delete(found.gradient, UPRIGHT, 0)])[:, 1:]
    return Answer(np.append(found.time, np.delete(found.state, UPRIGHT)), rows)


def references() -> tuple[Answer, float, float]:
    """The truth, its change by coarser collocation, and its difference to our finest solve."""
    fine, coarse = (answer_of(footstep(stages=s, resolution=r)) for s, r in ((9, 1e-10), (7, 1e-9)))
    ours = _linearised(1e-11)
    apart = (relative_error(each.gradient, fine.gradient) for each in (coarse, ours))
    return fine, *apart


def ours(truth: Answer, rtol: float) -> Run:
    """Tolerances as named accuracies have them, witnesses as walks with a number for accuracy."""
    return with_estimate(_linearised, rtol)


def _linearised(rtol: float, *, solver: str = "rodas4") -> Answer:
    found = jb.gait.linearise_return_map(
        jb.seed_scene(),
        jb.State(*map(jnp.asarray, START)),
        rtol=rtol,
        tangent_rtol=10.0 * rtol,
        parameters=PARAMETERS,
        solver=solver,
        engine="lanes",
        max_solver_steps=1 << 20,
    )
    if int(found.code) != 0:
        raise RuntimeError(f"no footstep at rtol = {rtol:g}: code {int(found.code)}")
    # The legs are renamed at its end.
    state, rows = np.asarray(found.recurring), np.asarray(found.jacobian)
    own = [0, 1, 3, 4, 6, 5]
    return Answer(
        np.concatenate([[found.period], np.ravel(found.advance), state[own]]),
        np.vstack([found.period_row, np.ravel(found.advance_rows), rows[own]]),
    )
