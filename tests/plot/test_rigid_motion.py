"""Motions of rigid walks as they are drawn, against feet that stay where they stand."""

import dataclasses

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped._types import rows_of
from jaxbiped.plot._samples import DrawnMotion, rigid_motion
from jaxbiped.plot._skeleton import poses

pytestmark = pytest.mark.slow


def walked(name, footsteps):
    model = jb.models.MODELS[name]
    scene = model.make()
    start = scene.state(**next(iter(model.starts.values())))
    return scene, jb.simulate(scene, start, footsteps=footsteps, save=jb.HeelStrike())


@pytest.fixture(scope="module")
def wheel():
    return walked("rimless-wheel", 4)


def test_a_wheel_rolls_over_its_spokes_in_order(wheel):
    scene, walk = wheel
    motion = rigid_motion(scene, walk)
    t = np.linspace(motion.began[0], motion.end, 60)
    found = motion.motion(t)
    assert (np.diff(found["theta_wheel"]) < 0.0).all()
    feet, place = poses(scene, found).feet, jb.measure.cost_of_transport(scene, walk).distance
    legs, rows = motion.standing_legs(), motion.rows(t)
    np.testing.assert_array_equal(np.diff(legs) % len(feet), 1)
    for row, leg in enumerate(legs):
        stands = feet[leg][rows == row]
        assert np.ptp(stands, axis=0).max() < 1e-9
    steps = np.diff([feet[leg][rows == row][0] for row, leg in enumerate(legs)], axis=0)
    np.testing.assert_allclose(np.hypot(*steps.T), place[: len(steps)], atol=1e-9)


def test_rates_jump_at_changes_of_mode_and_angles_do_not():
    scene, walk = walked("hsu-chen", 2)
    motion = rigid_motion(scene, walk)
    (change,) = motion.changes
    began, count = motion.began[0], len(motion.began)
    assert (began < change < motion.end, count) == (True, 1)
    t = motion.both_sides()
    assert len(t) == 4
    found = motion.motion(t)
    assert found["omega_shank_1"][1] - found["omega_shank_1"][2] > 5.0
    assert found["theta_shank_1"][1] == pytest.approx(found["theta_shank_1"][2], abs=1e-5)
    assert found["theta_thigh_1"][2] == pytest.approx(found["theta_shank_1"][2], abs=1e-9)


def test_figures_draw_rigid_walks(wheel):
    scene, walk = wheel
    (ax,) = jb.plot.leg_angles(scene, walk).axes
    assert ax.get_title(loc="left") == "Body angles on rigid feet"
    assert len(jb.plot.phase_portrait(scene, walk).axes[0].lines) > 1
    jb.plot.gait_strobe(scene, walk, count=5)
    jb.plot.time_series(scene, walk, "omega_wheel")
    frames = list(jb.plot.animate(scene, walk, frames_per_second=2.0).new_frame_seq())
    assert len(frames) == int(2.0 * (float(walk.t[-1]) - float(walk.arrivals.t[0]))) + 1
    recorded = jb.plot.view(scene, walk).recordings[0]
    assert [each.leg for each in recorded.footprints] == [8, 1, 2]
    normal = recorded.channels["normal_8"]
    assert normal[0] > 0.0
    assert normal[-1] == 0.0
    for refused in (
        jb.plot.contact_forces,
        jb.plot.penetrations,
        jb.footsteps,
        jb.measure.energy_ledger,
    ):
        with pytest.raises(jb.ArgumentError, match="RigidScene is not allowed"):
            refused(scene, walk)
    kept = walk.arrivals._replace(
        t=walk.arrivals.t[:1], state=rows_of(walk.arrivals.state, slice(1)), total=np.asarray(1)
    )
    one = dataclasses.replace(walk, arrivals=kept)
    assert rigid_motion(scene, one).began.tolist() == [float(kept.t[0])]
    with pytest.raises(jb.ArgumentError, match="no heel strikes"):
        rigid_motion(scene, dataclasses.replace(one, t=kept.t))
    none = jb.simulate(scene, walk.final, duration=0.1)
    with pytest.raises(jb.ArgumentError, match="no heel strikes"):
        jb.plot.leg_angles(scene, none)


def test_no_turn_of_a_long_rigid_walk_is_passed_over():
    """Each footstep's largest rate, against that of the gait's first footsteps drawn finely."""
    scene = jb.ladder()["rigid"]
    gait = jb.find_gait(scene, parameters=(), radius_sensitivities=False)
    walk = jb.simulate(scene, gait.measures.state, footsteps=300, save=jb.HeelStrike())
    drawn = DrawnMotion(scene, walk)
    t, motion = drawn.sampled()
    began = rigid_motion(scene, walk).began
    rows = np.searchsorted(began, t, side="right") - 1
    finely = drawn.at(np.linspace(began[0], began[2], 4001)[:-1])
    truth = max(np.max(finely[name]) for name in ("omega_1", "omega_2"))
    rates = np.maximum(motion["omega_1"], motion["omega_2"])
    largest = [rates[rows == row].max() for row in range(len(began) - 1)]
    np.testing.assert_allclose(largest, truth, rtol=1e-4)
    for name in ("theta_1", "theta_2"):  # legs go on where they were, at every strike
        assert np.abs(np.diff(motion[name])).max() < 0.05
