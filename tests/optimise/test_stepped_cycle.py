"""The response to a step in the ground, against walks on ground that really has one."""

import jax.numpy as jnp
import numpy as np
import pytest
from reference.compliant import numbers
from reference.rigid import rigid_walker
from reference.scipy_solves import solution

import jaxbiped as jb
from jaxbiped.optimise._jacobian_functionals import jacobian_functionals

pytestmark = pytest.mark.slow
FOOTSTEPS = 40


def norm_of_response(scene, gait, first, drop):
    """Of a step, from the first footstep by `first(state, drop)` and the return map after it.

    `first` tells the state on the section above the lower ground, the hip's advance and the time.
    """
    told = []
    for sign in (1.0, -1.0):
        state, *row = first(gait.measures.state, sign * drop * float(scene.walker.l))
        rows = [row]
        for _ in range(FOOTSTEPS):
            came = jb.return_map(scene, state._replace(hip_x=jnp.zeros(())), accuracy="tight")
            rows.append([float(came.state.hip_x), float(came.time)])
            state = came.state
        told.append(np.asarray(rows))
    size = np.asarray([float(gait.measures.step_length), float(gait.measures.period)])
    return np.sqrt(np.sum(((told[0] - told[1]) / (2.0 * drop) / size) ** 2))


def norm(scene, gait):
    names = ("floor_sensitivity",)
    return float(
        jacobian_functionals(scene, gait.measures.state, names, accuracy="tight").values[0]
    )


def tight_gait(scene):
    return jb.find_gait(scene, accuracy="tight", parameters=(), radius_sensitivities=False)


def test_a_rigid_walker_steps_down():
    """Against the walker written a second time, whose foot comes down where the ground is."""
    scene = jb.ladder()["rigid"]
    gait = tight_gait(scene)
    reach, r = float(scene.walker.hip_to_foot), float(scene.walker.r)

    def rolled(angle):
        return r * angle + reach * np.sin(angle)

    def first(state, drop):
        after, time = rigid_walker(scene).footstep(state[1:], drop)
        theta_1, theta_2, omega_1, omega_2 = map(jnp.asarray, after)
        came = type(state)(jnp.zeros(()), theta_1, theta_2, omega_1, omega_2)
        return came, rolled(float(state.theta_2)) - rolled(float(theta_1)), time

    assert norm(scene, gait) == pytest.approx(norm_of_response(scene, gait, first, 2e-5), rel=1e-5)


def test_a_compliant_walker_steps_down():
    """Against SciPy's solve of the seed's equations, the ground lower under leg 1 alone."""
    scene = jb.seed_scene()
    gait = tight_gait(scene)

    def first(state, drop):
        def stands(t, y, p):
            return y[2] if t > 0.1 else 1.0

        stands.terminal, stands.direction = True, -1.0
        start = np.asarray([float(leaf) for leaf in state])
        solved = solution(2.0, 1e-11, start=start, p=numbers(drop=drop), events=stands)
        y, time = solved.y_events[0][0], float(solved.t_events[0][0])
        x, z, theta_1, theta_2, vx, vz, omega_1, omega_2 = map(jnp.asarray, y)
        came = type(state)(x, z + drop, theta_2, theta_1, vx, vz, omega_2, omega_1)
        return came, float(x - state.hip_x), time

    assert norm(scene, gait) == pytest.approx(norm_of_response(scene, gait, first, 1e-4), rel=1e-4)
