"""Fits of mechanisms by the angles of any body, against gaits of known parameters."""

import dataclasses

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.identify import FitEnding, MeasuredAngles, MeasuredGait, read_measured
from tests.mechanisms import WALKERS, scene_of

SEED = jb.seed_scene(slope=0.03)
TORSO = dataclasses.replace(SEED, walker=WALKERS["torso"], clearance=jb.laws.StanceRotation())
NEAR = TORSO.state(
    theta_leg_1=0.1516, theta_torso=0.0787, hip_z=0.39927, hip_vx=0.3244, hip_vz=-0.0004,
    omega_leg_1=2.5587, omega_leg_2=-0.811, omega_torso=0.9314,
)  # fmt: skip


@pytest.mark.slow
def test_a_torsos_spring_is_found_by_its_angle_from_a_guess(torso_gait):
    gait = torso_gait
    times, states = gait.orbit
    chosen = np.flatnonzero(np.isfinite(np.asarray(times[0])))[2:-1:4]
    clock, leg, torso = (
        np.asarray(each[0])[chosen] for each in (times, states.theta_leg_1, states.theta_torso)
    )
    angles = MeasuredAngles(clock, 1e-4, since="mid-stance", theta_leg_1=leg, theta_torso=torso)
    seen = MeasuredGait({"period": (float(gait.measures.period), 1e-4)}, angles=angles)
    name = "torso.spring.stiffness"
    start = jb.with_parameters(TORSO, {name: 15.0})
    fit = jb.fit_gait(start, (name,), seen, guess=NEAR)
    assert fit.ending is FitEnding.CONVERGED
    assert fit.estimates[name] == pytest.approx(16.0, rel=1e-4)
    assert fit.standard_errors[name] < 0.1


def test_angles_that_a_walker_does_not_have_are_refused(tmp_path):
    seen = MeasuredGait({}, angles=MeasuredAngles([0.1], 1e-3, theta_torso=[0.1]))
    coupled, name = scene_of("coupled"), "leg.mass"
    with pytest.raises(jb.ArgumentError, match="'theta_torso' is not known"):
        jb.fit_gait(coupled, (name,), seen)
    with pytest.raises(jb.ArgumentError, match="omega_leg_1 is not allowed"):
        MeasuredAngles([0.1], 1e-3, omega_leg_1=[0.1])
    uneven = MeasuredGait({"period": (1.0, 0.1)}, footsteps=3)
    with pytest.raises(jb.ArgumentError, match="give a multiple of 2"):
        jb.fit_gait(scene_of("unequal"), ("leg_1.mass",), uneven)
    with pytest.raises(jb.ArgumentError, match="guess has the scalars"):
        jb.fit_gait(coupled, (name,), MeasuredGait({"period": (1.0, 0.1)}), guess=jb.seed_state())
    held = '{"times_s": [0.1], "theta_torso_rad": [0.2], "deviation_rad": 0.01}'
    (tmp_path / "seen.json").write_text(f'{{"gaits": [{{"angles": {held}}}]}}')
    (read,) = read_measured(tmp_path / "seen.json")
    assert read.angles.known == {"theta_torso": [0.2]}
