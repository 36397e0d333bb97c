"""Responses to a push and to a step in the ground, against walks that are pushed or step down."""

import itertools

import jax.numpy as jnp
import numpy as np
import pytest
from reference.compliant import numbers
from reference.rigid import rigid_walker
from reference.scipy_solves import solution

import jaxbiped as jb
from jaxbiped.compiler import host_jit
from jaxbiped.gait._poincare_map import linearised_return, recurring_components, seed_directions
from jaxbiped.hybrid._sections import section_of
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.optimise._augmented_system import MotionSection
from jaxbiped.optimise._cycle_costs import CostedCycle
from jaxbiped.optimise._cycle_functionals import cycle_spec
from jaxbiped.optimise._jacobian_functionals import jacobian_functionals
from jaxbiped.solve._accuracy import precision_of
from tests.mechanisms import SEED_WITH_TORSO

pytestmark = pytest.mark.slow
FOOTSTEPS = 24
SCENES = {"rigid": jb.ladder()["rigid"], "compliant": jb.seed_scene(), "torso": SEED_WITH_TORSO}
NEAR = {"rigid": 1e-5, "compliant": 1e-4, "torso": 1e-4}
SIZES = {("rigid", "drop"): 2e-5}
"""Of a disturbance, where it is not 1e-4."""
NORMS = {
    "sensitivity_norm": ("push", slice(2)),
    "floor_sensitivity": ("drop", slice(2)),
    "clearance_sensitivity": ("push", slice(2, 3)),
    "floor_clearance_sensitivity": ("drop", slice(2, 3)),
}
"""Which disturbance a norm is of, and which of a footstep's length, time and clearance."""


@host_jit()
def cycle(scene, state):
    """The state after a cycle; its length, its time, and how high the swinging foot passed."""
    ((_, clearance),) = jb.optimise.NAMED_COSTS["foot_clearance"].costs(None)
    system = CostedCycle.of(system_of(scene), (), clearance)
    section = MotionSection(section_of(scene, None))
    y = system.begin(state._replace(hip_x=jnp.zeros(())))
    seeds, _ = seed_directions(scene, (), len(recurring_components(system, y)))
    spec = cycle_spec(scene, system, section, 1, "lanes")
    once = linearised_return(spec, seeds, y, precision_of("tight", scene), jnp.asarray(False))
    return type(state)(jnp.zeros(()), *once.recurring), [once.advance[0], once.period, -once.peak]


def pushed(scene, state, push):
    """The ground leans by as much for one cycle."""
    slope = float(scene.ground.slope) + push
    return cycle(jb.with_parameters(scene, {"slope": slope}), state)


def stepped(scene, state, drop):
    """The first cycle before ground that lies lower, by equations written a second time."""
    drop = drop * float(scene.walker.l)
    return (stepped_rigid if isinstance(scene, jb.RigidScene) else stepped_compliant)(
        scene, state, drop
    )


def stepped_rigid(scene, state, drop):
    """The foot comes down where the ground is, after a swing in which it passes as ever."""
    reach, r = float(scene.walker.hip_to_foot), float(scene.walker.r)
    after, time = rigid_walker(scene).footstep(state[1:], drop)
    ends = np.array([float(state.theta_2), float(after[0])])
    rolled = r * ends + reach * np.sin(ends)
    _, (_, _, even) = cycle(scene, state)
    return type(state)(jnp.zeros(()), *map(jnp.asarray, after)), [rolled[0] - rolled[1], time, even]


def stepped_compliant(scene, state, drop):
    """SciPy's solve of the seed's equations, the ground lower under leg 1 alone."""
    reach, r = float(scene.walker.hip_to_foot), float(scene.walker.r)

    def stands(t, y, p):
        return y[2] if t > 0.1 else 1.0

    def passes(t, y, p):
        return y[5] + reach * np.sin(y[3]) * y[7] if t > 0.3 else -1.0

    stands.terminal, stands.direction, passes.direction = True, -1.0, 1.0
    start = np.asarray([float(leaf) for leaf in state])
    events = (stands, passes)
    solved = solution(2.0, 1e-11, start=start, p=numbers(drop=drop), events=events)
    lowest, time = solved.y_events[1][0], float(solved.t_events[0][0])
    x, z, theta_1, theta_2, vx, vz, omega_1, omega_2 = map(jnp.asarray, solved.y_events[0][0])
    came = type(state)(x, z + drop, theta_2, theta_1, vx, vz, omega_2, omega_1)
    clearance = lowest[1] - reach * np.cos(lowest[3]) - r + drop
    return came, [float(x - state.hip_x), time, clearance]


def norm_of_response(scene, measures, first, size, columns):
    """Of footsteps' relative lengths and times, and clearances in leg lengths."""
    walks = []
    for sign in (1.0, -1.0):
        state, row = first(scene, measures.state, sign * size)
        rows = [row]
        for _ in range(FOOTSTEPS):
            state, row = cycle(scene, state)
            rows.append(row)
        walks.append(rows)
    units = [float(measures.step_length), float(measures.period), float(scene.mechanism.height)]
    response = np.subtract(*walks) / (2.0 * size) / units
    return np.sqrt(np.sum(response[:, columns] ** 2))


OFTEN = (("rigid", "sensitivity_norm"), ("rigid", "floor_sensitivity"))


@pytest.mark.parametrize(
    ("which", "name"),
    [
        pytest.param(*case, marks=() if case in OFTEN else pytest.mark.nightly)
        for case in itertools.product(SCENES, NORMS)
        if case[0] != "torso" or NORMS[case[1]][0] == "push"
    ],
)
def test_a_norm_is_that_of_the_footsteps_after_a_disturbance(which, name):
    scene, (disturbance, columns) = SCENES[which], NORMS[name]
    gait = jb.find_gait(scene, accuracy="tight", parameters=(), radius_sensitivities=False)
    told = jacobian_functionals(scene, gait.measures.state, (name,), accuracy="tight")
    first, size = (
        {"push": pushed, "drop": stepped}[disturbance],
        SIZES.get((which, disturbance), 1e-4),
    )
    expected = norm_of_response(scene, gait.measures, first, size, columns)
    assert float(told.values[0]) == pytest.approx(expected, rel=NEAR[which])
