"""The response of foot clearance, against walks that are pushed or meet a step."""

import jax.numpy as jnp
import numpy as np
import pytest
from reference.compliant import numbers
from reference.rigid import rigid_walker
from reference.scipy_solves import solution

import jaxbiped as jb
from jaxbiped.gait._poincare_map import linearised_return, recurring_components, seed_directions
from jaxbiped.optimise._augmented_cycles import MotionSection
from jaxbiped.optimise._cycle_functionals import cycle_spec
from jaxbiped.optimise._cycle_integrals import integrals_of
from jaxbiped.optimise._jacobian_functionals import jacobian_functionals
from jaxbiped.optimise._jacobian_weights import CLEARANCE_NORMS
from jaxbiped.scene._parameter_access import select_parameters
from jaxbiped.solve._accuracy import precision_of
from jaxbiped.variational._hybrid_system import section_of

pytestmark = pytest.mark.slow
FOOTSTEPS = 40


def tight_gait(scene):
    return jb.find_gait(scene, accuracy="tight", parameters=(), radius_sensitivities=False)


def told(scene, gait):
    found = jacobian_functionals(scene, gait.measures.state, CLEARANCE_NORMS, accuracy="tight")
    return dict(zip(CLEARANCE_NORMS, np.asarray(found.values), strict=True))


def cycle(scene, state):
    """The state after a cycle, and how high the swinging foot passed: the largest depth seen."""
    system, section = integrals_of(scene), MotionSection(section_of(scene, None))
    y = system.begin(state._replace(hip_x=jnp.zeros(())))
    _, active = select_parameters(scene, None)
    seeds, _ = seed_directions(scene, active, len(recurring_components(system, y)))
    spec = cycle_spec(scene, system, section, 1, "lanes")
    once = linearised_return(spec, seeds, y, precision_of("tight", scene), jnp.asarray(False))
    return type(state)(jnp.zeros(()), *once.recurring), -float(once.peak)


def norm_of_response(scene, gait, first, size):
    """Of clearances in leg lengths, from a first cycle by `first(state, size)`, which tells the
    state after it and its clearance."""
    rows = []
    for sign in (1.0, -1.0):
        state, clearance = first(gait.measures.state, sign * size)
        row = [clearance]
        for _ in range(FOOTSTEPS):
            state, clearance = cycle(scene, state)
            row.append(clearance)
        rows.append(row)
    response = np.subtract(*rows) / (2.0 * size * float(scene.walker.l))
    return np.sqrt(np.sum(response**2))


def leaning(scene):
    def first(state, push):
        slope = float(scene.ground.slope) + push
        return cycle(jb.with_parameters(scene, {"slope": slope}), state)

    return first


@pytest.mark.nightly
def test_a_rigid_walker_is_pushed_and_steps_down():
    scene = jb.ladder()["rigid"]
    gait = tight_gait(scene)
    found, (_, even) = told(scene, gait), cycle(scene, gait.measures.state)
    pushed = norm_of_response(scene, gait, leaning(scene), 1e-4)
    assert found["clearance_sensitivity"] == pytest.approx(pushed, rel=1e-5)

    def first(state, drop):
        # The step comes after the swing, whose foot passes as ever.
        after, _ = rigid_walker(scene).footstep(state[1:], drop * float(scene.walker.l))
        return type(state)(jnp.zeros(()), *map(jnp.asarray, after)), even

    stepped = norm_of_response(scene, gait, first, 2e-5)
    assert found["floor_clearance_sensitivity"] == pytest.approx(stepped, rel=1e-5)


@pytest.mark.nightly
def test_a_compliant_walker_is_pushed_and_steps_down():
    """The step against SciPy's solve of the seed's equations."""
    scene = jb.seed_scene()
    gait = tight_gait(scene)
    found = told(scene, gait)
    pushed = norm_of_response(scene, gait, leaning(scene), 1e-4)
    assert found["clearance_sensitivity"] == pytest.approx(pushed, rel=1e-4)
    reach, r = float(scene.walker.hip_to_foot), float(scene.walker.r)

    def first(state, drop):
        drop = drop * float(scene.walker.l)

        def stands(t, y, p):
            return y[2] if t > 0.1 else 1.0

        def passes(t, y, p):
            return y[5] + reach * np.sin(y[3]) * y[7] if t > 0.3 else -1.0

        stands.terminal, stands.direction, passes.direction = True, -1.0, 1.0
        start = np.asarray([float(leaf) for leaf in state])
        events = (stands, passes)
        solved = solution(2.0, 1e-11, start=start, p=numbers(drop=drop), events=events)
        lowest = solved.y_events[1][0]
        x, z, theta_1, theta_2, vx, vz, omega_1, omega_2 = map(jnp.asarray, solved.y_events[0][0])
        came = type(state)(x, z + drop, theta_2, theta_1, vx, vz, omega_2, omega_1)
        return came, lowest[1] - reach * np.cos(lowest[3]) - r + drop

    stepped = norm_of_response(scene, gait, first, 1e-4)
    assert found["floor_clearance_sensitivity"] == pytest.approx(stepped, rel=1e-4)
