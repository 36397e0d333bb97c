"""Gaits of driven walkers, against difference quotients and the balance of energy."""

import dataclasses

import numpy as np
import pytest

import jaxbiped as jb

pytestmark = pytest.mark.slow

A = jb.actuation
SEED = jb.seed_scene()
RIGID = jb.RigidScene(
    SEED.walker,
    SEED.ground,
    (
        A.HipSpring(k=0.05, b=0.002, theta_0=0.1),
        A.HipSpline([0.01, 0.02, 0.005], first=-0.2, last=0.2),
        A.HipPulse(0.01, phase=0.1, width=0.1, reaction="trunk"),
        A.PushOff(0.05),
    ),
)
COMPLIANT = dataclasses.replace(
    SEED, actuation=(A.HipSpring(k=0.03, b=0.001), A.HipTorque(0.01), A.FootPreload(extension=5e-4))
)


def _own(scene):
    passive = jb.parameter_names(dataclasses.replace(scene, actuation=None))
    return tuple(name for name in jb.parameter_names(scene) if name not in passive)


def _moved(scene, state, name, step):
    """Period, length, spectral radius and state of the gait with a parameter moved."""
    value = float(jb.parameter_values(scene)[name])
    other = jb.with_parameters(scene, {name: value + step})
    gait = jb.find_gait(other, state, accuracy="tight", parameters=(), engine="lanes")
    assert str(gait.outcome) == "found"
    return _measured(gait.measures)


def _measured(measures):
    chosen = (measures.period, measures.step_length, measures.spectral_radius)
    return np.array([*chosen, *measures.state[1:]])


@pytest.mark.parametrize(
    ("scene", "share", "rtol"),
    [(RIGID, 1e-3, 1e-5), pytest.param(COMPLIANT, 0.02, 5e-3, marks=pytest.mark.nightly)],
    ids=["rigid", "soft"],
)
def test_sensitivities_to_the_actuators_are_difference_quotients(scene, share, rtol):
    names = _own(scene)
    gait = jb.find_gait(scene, accuracy="tight", parameters=names, engine="lanes")
    assert str(gait.outcome) == "found"
    slopes = gait.sensitivities
    columns = np.array([slopes.period, slopes.step_length, slopes.spectral_radius])
    columns = np.vstack([columns, [np.asarray(row) for row in slopes.state[1:]]])
    sizes = np.abs(_measured(gait.measures))
    for k, name in enumerate(names):
        value = float(jb.parameter_values(scene)[name])
        step = share * abs(value)
        ahead, behind = (_moved(scene, gait.measures.state, name, s) for s in (step, -step))
        difference = (ahead - behind) / (2.0 * step)
        # In units of what the parameter's whole value does, or of the measure itself.
        floor = 1e-7 * sizes / step
        allowed = rtol * (np.abs(difference) + np.abs(difference).max() * 1e-2) + floor
        off = np.abs(columns[:, k] - difference)
        assert (off <= allowed).all(), (name, columns[:, k], difference)


@pytest.mark.parametrize(
    ("actuation", "rigid"),
    [
        (A.PushOff(0.1), True),
        pytest.param(A.FootPreload(extension=3e-3), False, marks=pytest.mark.nightly),
        pytest.param(A.HipTorque(0.1), False, marks=pytest.mark.nightly),
    ],
    ids=["push-off", "preload", "torque"],
)
def test_level_ground_is_walked_from_nothing(actuation, rigid):
    level = jb.seed_scene(slope=0.0)
    if rigid:
        scene = jb.RigidScene(level.walker, level.ground, actuation)
    else:
        scene = dataclasses.replace(level, actuation=actuation)
    gait = jb.find_gait(scene, parameters=(), engine="lanes")
    assert bool(gait.stable)
    assert bool(gait.sound)
    assert float(gait.measures.step_length) > 0.1
    state = gait.measures.state
    if rigid:
        walk = jb.rigid_walk(scene, state, footsteps=2, max_arrivals=2, accuracy="tight")
    else:
        walk = jb.simulate(scene, state, footsteps=2, engine="lanes")
    found = jb.measure.cost_of_transport(scene, walk)
    # A cycle on level ground ends as high as it began.
    assert abs(found.gravity_work[0]) < 2e-4 * found.motor_work[0]
    assert found.distance[0] == pytest.approx(float(gait.measures.step_length), rel=1e-4)
    assert 0.001 < found.cost[0] < 0.1
