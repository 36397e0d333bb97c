"""Rigid walkers whose legs differ, against equations by hand and against their mirrored twins."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

import jaxbiped as jb
from jaxbiped.models import hsu_chen
from tests.models.by_hand import DEPARTING, HOW, StraightLegs, same_multipliers

SLOPE, G, HIP = 0.02, 9.81, 5.0
LEGS = dict(
    mass=(1.0, 1.2), inertia=(0.02, 0.03), centre=(0.5, 0.45), l=(0.9, 0.882), r=(0.1, 0.12)
)
"""Leg 1, then leg 2."""


def scene_of(legs):
    bodies = tuple(
        jb.Body(f"leg_{k + 1}", **{name: legs[name][k] for name in ("mass", "inertia", "centre")})
        for k in (0, 1)
    )
    feet = tuple(jb.Foot(f"leg_{k + 1}", centre=legs["l"][k], radius=legs["r"][k]) for k in (0, 1))
    walker = jb.Mechanism(root_mass=HIP, bodies=bodies, feet=feet)
    return jb.RigidScene(walker, jb.Ground(slope=SLOPE, g=G))


class ByHand:
    """Both single supports by turns; states are (swing angle, stance angle, their rates)."""

    def __init__(self, legs):
        self.height = [l + r for l, r in zip(legs["l"], legs["r"], strict=True)]
        self.legs, self.on = legs, []
        for stands in (0, 1):
            bodies = [
                (legs["mass"][k], legs["inertia"][k], legs["centre"][k], weights)
                for k, weights in zip((1 - stands, stands), np.eye(2), strict=True)
            ]
            own = dict(l=legs["l"][stands], r=legs["r"][stands])
            self.on.append(StraightLegs(bodies, hip_mass=HIP, slope=SLOPE, g=G, **own))

    def footstep(self, y, stands):
        """From behind a strike to behind the next, on this leg; the time."""
        (l, other), (r, others) = (
            [self.legs[name][k] for k in (stands, 1 - stands)] for name in ("l", "r")
        )
        old, new = self.on[stands], self.on[1 - stands]
        y, first = old.solve(old.free, y, lambda _, y: y[1] - y[0], 0.0)
        y = solve_ivp(old.field(old.free), (0.0, DEPARTING), y, **HOW).y[:, -1]

        def height(_, y):
            return l * np.cos(y[1]) + r - other * np.cos(y[0]) - others

        y, last = old.solve(old.free, y, height, -1.0)
        q, rates = y[1::-1], y[:1:-1]
        before = list(old.motions(y[:2], y[2:], old.leg))
        after = list(new.motions(q, rates, new.leg))
        pairs = zip(after, [before[1], before[0], before[2]], strict=True)
        momentum = sum(
            m * now.T @ (was @ y[2:]) + turning @ rates
            for (m, turning, now, _), (_, _, was, _) in pairs
        )
        rates = np.linalg.solve(new.mass_matrix(after), momentum)
        return np.concatenate([q, rates]), first + DEPARTING + last

    def stride(self, point):
        """Of leg 2's angle and both rates behind its strike; the time."""
        angle = point[0]
        lift = self.legs["l"][1] * np.cos(angle) + self.legs["r"][1] - self.legs["r"][0]
        y = np.array([-np.arccos(lift / self.legs["l"][0]), *point])
        y, first = self.footstep(y, 1)
        y, second = self.footstep(y, 0)
        return y[1:], first + second

    def gait(self, near):
        point = root(lambda point: self.stride(point)[0] - point, near, tol=1e-12).x
        return point, self.stride(point)[1]

    def multipliers(self, point):
        h, slopes = 1e-4, []
        for each in np.eye(3):
            moved = {k: self.stride(point + k * h * each)[0] for k in (-2, -1, 1, 2)}
            slopes.append((8.0 * (moved[1] - moved[-1]) - moved[2] + moved[-2]) / (12.0 * h))
        return np.linalg.eigvals(np.stack(slopes, axis=1))


@pytest.mark.slow
def test_a_stride_is_that_of_equations_by_hand():
    scene = scene_of(LEGS)
    gait = jb.find_gait(scene, accuracy="tight")
    assert gait.outcome is jb.gait.Search.FOUND
    assert (gait.cycle, int(gait.cycle_footsteps)) == ("stride", 2)
    state = gait.measures.state
    ours = [float(each) for each in (state.theta_leg_2, state.omega_leg_1, state.omega_leg_2)]
    theirs = ByHand(LEGS)
    point, period = theirs.gait(ours)
    np.testing.assert_allclose(ours, point, atol=1e-10)
    assert float(gait.measures.period) == pytest.approx(period, abs=1e-10)
    assert same_multipliers(gait.multipliers, theirs.multipliers(point)) < 1e-7
    periods = []
    for mass in (1.2 - 1e-3, 1.2 + 1e-3):
        periods.append(ByHand(LEGS | dict(mass=(1.0, mass))).gait(ours)[1])
    expected = (periods[1] - periods[0]) / 2e-3
    told = float(gait.sensitivities.period[gait.parameters.index("leg_2.mass")])
    assert told == pytest.approx(expected, rel=1e-5)


@pytest.mark.slow
def test_walks_tell_which_leg_stands_and_close_the_books():
    scene = scene_of(LEGS)
    state = jb.find_gait(scene, parameters=(), radius_sensitivities=False).measures.state
    walk = jb.simulate(scene, state, footsteps=3, accuracy="tight", save=jb.HeelStrike())
    assert walk.modes == (("leg_2",), ("leg_1",), ("leg_2",), ("leg_1",))
    books = jb.measure.rigid_ledger(scene, walk)
    np.testing.assert_allclose(books.residual, 0.0, atol=1e-10)
    seen = jb.plot.view(scene, walk, start=state).recordings[0]
    assert [each.leg for each in seen.footprints] == [2, 1, 2]
    other = scene.state(theta_leg_1=0.2, theta_leg_2=-0.2, standing="leg_1")
    assert float(other.mode) == 1.0


@pytest.mark.nightly
def test_both_engines_walk_alike():
    scene = scene_of(LEGS)
    state = scene.state(theta_leg_1=-0.2, theta_leg_2=0.2, omega_leg_1=-0.6, omega_leg_2=-0.8)
    ends = [
        jb.simulate(scene, state, footsteps=2, engine=engine, accuracy="tight").final
        for engine in ("lanes", "xla")
    ]
    np.testing.assert_allclose(*np.array(ends), atol=1e-9)


@pytest.mark.nightly
def test_knees_without_their_mirror_walk_as_with_it():
    alike = hsu_chen()
    apart = jb.RigidScene(alike.mechanism.untied(), alike.ground)
    gait = jb.find_gait(alike, accuracy="tight", parameters=(), radius_sensitivities=False)
    start = {name: each for name, each in gait.measures.state._asdict().items() if name != "mode"}
    twice = jb.find_gait(
        apart, apart.state(**start), accuracy="tight", parameters=(), radius_sensitivities=False
    )
    assert float(twice.measures.period) == pytest.approx(2.0 * float(gait.measures.period), 1e-10)
    assert same_multipliers(twice.multipliers, np.asarray(gait.multipliers) ** 2) < 1e-8
    walks = [
        jb.simulate(scene, state, footsteps=2)
        for scene, state in ((alike, gait.measures.state), (apart, twice.measures.state))
    ]
    np.testing.assert_allclose(walks[0].mode_durations, walks[1].mode_durations, atol=1e-7)
    assert walks[1].modes[2] == ("shank_1", "shank_1 held")
