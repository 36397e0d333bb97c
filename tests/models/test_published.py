"""Published walkers, against what was printed of them and against equations written by hand."""

import itertools
import math

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.models import MODELS, hsu_chen, rimless_wheel
from tests.models.by_hand import Knees, StraightLegs, same_multipliers, straight_legs

PLAIN = dict(parameters=(), radius_sensitivities=False)
POINT_MASSES = straight_legs(1e-13, 0.0, 1.0)
COMPASS = straight_legs(5.0, 0.0, 0.5)
TORSO = (3.0, 0.0, -0.3, np.array([0.5, 0.5]))
THREE, TWO = math.radians(3.0), math.radians(2.0)
BY_HAND = {
    "garcia": StraightLegs(POINT_MASSES, hip_mass=1.0, l=1.0, slope=0.009, g=1.0),
    "goswami": StraightLegs(COMPASS, hip_mass=10.0, l=1.0, slope=THREE, g=9.8),
    "mcgeer": StraightLegs(
        straight_legs(1.0, 0.1024, 0.37), hip_mass=0.0, l=0.7, r=0.3, slope=0.03, g=1.0
    ),
    "wisse": StraightLegs([*COMPASS, TORSO], hip_mass=7.0, l=1.0, slope=TWO, g=9.8),
    "kuo": StraightLegs(POINT_MASSES, hip_mass=1.0, l=1.0, slope=0.0, g=1.0, impulse=0.04),
    "bhounsule": StraightLegs(
        straight_legs(1.0, 0.0, 1.0), hip_mass=1000.0, l=1.0, slope=0.009, g=1.0
    ),
    "bhounsule-round": StraightLegs(
        straight_legs(0.5, 0.02, 0.5), hip_mass=1.0, l=1.0, r=0.2, slope=0.01, g=1.0
    ),
}  # fmt: skip
CHENS_KNEES = Knees((0.5, 0.5, 0.325), (0.05, 0.5, 0.125), hip_mass=0.5, slope=0.0504, g=9.81)
RIGID = {(name, gait) for name in BY_HAND for gait in MODELS[name].starts}
PUBLISHED = {
    "garcia": dict(m=1e-13, J=0.0, l=1.0, d=1.0, r=0.0, hip_mass=1.0, slope=0.009, g=1.0),
    "goswami": dict(m=5.0, J=0.0, l=1.0, d=0.5, r=0.0, hip_mass=10.0, slope=THREE, g=9.8),
    "mcgeer": dict(m=1.0, J=0.1024, l=1.0, d=0.37, r=0.3, hip_mass=0.0, slope=0.03, g=1.0),
    "mcgeer-kneed": dict(
        m_thigh=0.2, J_thigh=5.8e-4, l_thigh=0.184, d_thigh=0.08,
        m_shank=0.124, J_shank=6.9e-4, l_shank=0.216, d_shank=0.096, w_shank=-0.004,
        r=0.08, hip_mass=1.352, epsilon=0.2, slope=0.0456, g=9.8,
        K=1e6, c=1e7, n=1.5, mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1000.0,
    ) | {"stop.K": 300.0, "stop.c": 3000.0, "stop.n": 1.0},
    "hsu-chen": dict(
        m_thigh=0.5, J_thigh=0.0, l_thigh=0.5, d_thigh=0.325,
        m_shank=0.05, J_shank=0.0, l_shank=0.5, d_shank=0.125, w_shank=0.0,
        r=0.0, hip_mass=0.5, epsilon=0.0, slope=0.0504, g=9.81,
    ),
    "rimless-wheel": {
        "wheel.mass": 1.0, "wheel.inertia": 0.5, "wheel.foot.centre": 1.0,
        "wheel.foot.centre_ahead": 0.0, "slope": 0.08, "g": 1.0,
    },
    "wisse": {f"walker.{name}": value for name, value in dict(
        m=5.0, J=0.0, l=1.0, d=0.5, r=0.0, hip_mass=7.0).items()
    } | dict(m_torso=3.0, J_torso=0.0, h=0.3, slope=TWO, g=9.8),
    "kuo": dict(
        m=1e-13, J=0.0, l=1.0, d=1.0, r=0.0, hip_mass=1.0, impulse=0.04, slope=0.0, g=1.0
    ),
    "bhounsule": dict(m=1.0, J=0.0, l=1.0, d=1.0, r=0.0, hip_mass=1000.0, slope=0.009, g=1.0),
    "bhounsule-round": dict(m=0.5, J=0.02, l=1.2, d=0.5, r=0.2, hip_mass=1.0, slope=0.01, g=1.0),
}  # fmt: skip
"""Every number of each walker, as its page and its source have them."""
DIGITS = {"garcia": 1e-11, "bhounsule": 1e-11, "bhounsule-round": 3e-3}
"""To which starts repeat themselves that are not printed in four digits."""


def found(name, gait):
    """A model's gait by its name, from the start that the catalogue has."""
    model = MODELS[name]
    scene = model.make()
    result = jb.find_gait(scene, scene.state(**model.starts[gait]), accuracy="tight", **PLAIN)
    assert result.outcome is jb.gait.Search.FOUND
    return result


ALPHA = math.pi / 8.0
"""Half the angle between the spokes of the wheel."""


def wheel_rate(inertia):
    """The wheel's rate behind an impact, which takes what falling from spoke to spoke gains."""
    eta = (inertia + math.cos(2.0 * ALPHA)) / (inertia + 1.0)
    gain = 4.0 * math.sin(ALPHA) * math.sin(0.08) / (1.0 + inertia)
    return eta * math.sqrt(gain / (1.0 - eta**2))


def point_of(gait):
    """Angle of the stance leg and both rates."""
    state = gait.measures.state
    return np.array([state.theta_2, state.omega_1, state.omega_2], dtype=float)


@pytest.mark.parametrize("name", MODELS)
def test_every_number_of_a_walker_is_its_source_s(name):
    model = MODELS[name]
    values = jb.parameter_values(model.make())
    assert {key: float(value) for key, value in values.items()} == pytest.approx(PUBLISHED[name])
    assert isinstance(model.make(), jb.RigidScene if model.rigid else jb.Scene)


@pytest.mark.parametrize(("name", "gait"), sorted(RIGID))
def test_a_start_repeats_itself_by_equations_by_hand(name, gait):
    """To its printed digits; passivewalker.m has another heel strike with round feet."""
    start = MODELS[name].starts[gait]
    point = np.array([start["theta_2"], start["omega_1"], start["omega_2"]])
    behind = BY_HAND[name].footstep(point)[0]
    assert start["theta_1"] == -start["theta_2"]
    np.testing.assert_allclose(behind, point, rtol=0.0, atol=DIGITS.get(name, 2e-4))


def test_the_starts_of_knees_and_of_the_wheel_repeat_themselves():
    start = MODELS["hsu-chen"].starts["gait"]
    for kind, leg in itertools.product(("theta", "omega"), (1, 2)):
        assert start[f"{kind}_thigh_{leg}"] == start[f"{kind}_shank_{leg}"]
    assert start["theta_thigh_1"] == -start["theta_thigh_2"]
    assert start["held"] == "shank_2"
    point = [start[name] for name in ("theta_thigh_2", "omega_thigh_1", "omega_thigh_2")]
    np.testing.assert_allclose(CHENS_KNEES.footstep(point)[0], point, rtol=0.0, atol=2e-4)
    start = MODELS["rimless-wheel"].starts["gait"]
    assert start["theta_wheel"] == pytest.approx(math.pi / 2.0 - math.pi / 8.0)
    assert start["omega_wheel"] == pytest.approx(-wheel_rate(0.5), abs=0.02)


def test_the_compliant_knee_that_stands_presses_on_its_stop_and_turns_with_its_thigh():
    start = MODELS["mcgeer-kneed"].starts["gait"]
    pressed = start["theta_shank_2"] - start["theta_thigh_2"] - 0.2
    assert 0.0 < pressed < 0.01
    assert start["omega_shank_2"] == start["omega_thigh_2"]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "gait"), sorted(RIGID))
def test_gaits_are_those_of_equations_by_hand(name, gait):
    ours = found(name, gait)
    point, period, multipliers = BY_HAND[name].gait(point_of(ours))
    np.testing.assert_allclose(point_of(ours), point, rtol=0.0, atol=1e-10)
    assert float(ours.measures.period) == pytest.approx(period, abs=1e-10)
    assert same_multipliers(np.asarray(ours.multipliers), multipliers) < 1e-8
    advance = 2.0 * (BY_HAND[name].l * np.sin(point[0]) + BY_HAND[name].r * point[0])
    assert float(ours.measures.step_length) == pytest.approx(advance, abs=1e-10)


def test_the_simplest_walkers_two_gaits():
    """Bhounsule 2014 has twelve digits of both; the paper has them to the first orders of γ."""
    long, short = (found("garcia", gait) for gait in ("long", "short"))
    theta, rate = point_of(long)[[0, 2]]
    assert theta == pytest.approx(0.200310900544287, abs=1e-12)
    assert rate == pytest.approx(-0.199832473004977, abs=1e-12)
    assert point_of(short)[0] == pytest.approx(0.193937369810184, abs=1e-12)
    leading = -0.190099841069 + 0.557598776679j
    pair = np.array([leading, leading.conjugate(), 0.0])
    assert same_multipliers(np.asarray(long.multipliers), pair) < 1e-9
    assert (long.stable, short.stable) == (True, False)
    # The coefficients of the paper's appendix; what is left is of the order of γ^(5/3).
    orders = 0.009 ** np.array([1.0 / 3.0, 1.0])
    for gait, coefficients, alpha, c in (
        (long, (0.970956, -0.270837), -1.045203, 1.062895),
        (short, (0.943976, -0.264561), -1.090331, 0.866610),
    ):
        theta, rate = point_of(gait)[[0, 2]]
        first = coefficients @ orders
        assert abs(theta - first) < 3.0 * 0.009 ** (5.0 / 3.0)
        assert abs(rate - (alpha * first + c * 0.009)) < 3.0 * 0.009 ** (5.0 / 3.0)


def test_the_compass_gait_on_three_degrees():
    """Four digits of the state behind a strike, its angles from the vertical."""
    ours = found("goswami", "gait")
    theta, swing, stance = point_of(ours)
    printed = (-0.3234, 0.2187, -0.3772, -1.0918)
    np.testing.assert_allclose((-theta - THREE, theta - THREE, swing, stance), printed, atol=5e-5)
    # The report's moduli are those of two footsteps.
    moduli = np.sort(np.abs(np.asarray(ours.multipliers)))[::-1] ** 2
    np.testing.assert_allclose(moduli, (0.332, 0.332, 0.014), atol=5e-3)


def test_passivewalker_s_point_feet_to_its_last_digits():
    theta, swing, stance = point_of(found("bhounsule", "gait"))
    program = (0.200161072169750, -0.199906060087682, 0.400322144339512, -0.015805473227965)
    np.testing.assert_allclose((theta, stance, 2.0 * theta, stance - swing), program, atol=1e-12)


class ItsHeelStrike(StraightLegs):
    """The heel strike of passivewalker.m, which gives the trailing leg the other leg's spin.

    In the balance about the hip its inertia stands with the rate of the leg that swings; the
    balance of the whole walker about the new contact is right.
    """

    def struck(self, y):
        inertia = self.bodies[0][1]
        more = inertia * (y[2] - y[3]) * np.array([-1.0, 1.0])
        other = [(length, weights[::-1]) for length, weights in self.leg]
        matrix = self.mass_matrix(self.motions(y[:2], y[2:], other))
        return super().struck(y) + np.concatenate(
            [np.zeros(2), np.linalg.solve(matrix, more)[::-1]]
        )


@pytest.mark.slow
def test_passivewalker_s_round_feet_differ_by_their_heel_strike():
    program = (0.189472782205104, -0.239124222551699, -0.053691703909393)
    ours = point_of(found("bhounsule-round", "gait"))
    assert 1e-5 < abs(ours[0] - program[0]) < 1e-4
    with_fault = ItsHeelStrike(
        straight_legs(0.5, 0.02, 0.5), hip_mass=1.0, l=1.0, r=0.2, slope=0.01, g=1.0
    )
    theta, swing, stance = with_fault.gait(ours)[0]
    np.testing.assert_allclose((theta, stance, stance - swing), program, atol=1e-10)


@pytest.mark.slow
def test_a_push_off_keeps_a_level_gait():
    """The paper's balance: a push-off of the rate times the tangent of half the legs' angle."""
    theta, _, stance = point_of(found("kuo", "gait"))
    assert -stance * math.tan(theta) == pytest.approx(0.04, abs=1e-12)


def test_a_walker_s_masses_are_the_paper_s_ratios():
    values = jb.parameter_values(jb.models.goswami(mu=3.0, beta=0.5).walker)
    assert values["hip_mass"] / values["m"] == pytest.approx(3.0)
    assert values["hip_mass"] + 2.0 * values["m"] == pytest.approx(20.0)
    assert values["d"] / (1.0 - values["d"]) == pytest.approx(0.5)


def test_a_torso_takes_its_mass_from_the_hip():
    values = jb.parameter_values(jb.models.wisse(torso_mass=4.0, torso_height=0.2).walker)
    assert values["walker.hip_mass"] == pytest.approx(6.0)
    assert (float(values["m_torso"]), float(values["h"])) == (4.0, 0.2)


def test_the_kneed_walkers_start_leads_to_the_gait_of_a_search_without_it():
    """Its feet are compliant: the gait was found without a guess, its period is 0.536145 s."""
    model = MODELS["mcgeer-kneed"]
    scene = model.make()
    result = jb.find_gait(scene, scene.state(**model.starts["gait"]), **PLAIN)
    assert result.outcome is jb.gait.Search.FOUND
    assert float(result.measures.period) == pytest.approx(0.5361452, abs=1e-6)


def test_slopes_are_given_and_refused():
    for name, model in MODELS.items():
        assert float(model.make(slope=0.02).ground.slope) == 0.02, name
        with pytest.raises(jb.ArgumentError, match="slope"):
            model.make(slope=math.nan)


@pytest.mark.parametrize(
    ("make", "name", "value"),
    [
        (jb.models.goswami, "mu", -1.0),
        (jb.models.goswami, "mu", 0.0),
        (jb.models.goswami, "beta", 0.0),
        (jb.models.wisse, "torso_mass", 11.0),
        (jb.models.wisse, "torso_height", math.inf),
        (jb.models.kuo, "impulse", math.nan),
        (rimless_wheel, "spokes", 2),
        (rimless_wheel, "inertia", 0.0),
    ],
)
def test_what_a_walker_cannot_have_is_refused_by_its_name(make, name, value):
    with pytest.raises(jb.ArgumentError, match=f"^{name} = "):
        make(**{name: value})


@pytest.mark.slow
def test_hsu_chen_s_gait():
    """The thesis: q1, q2 = q3 and their rates behind a strike by steps of 1 ms; read 0.559 s."""
    scene = hsu_chen()
    slope = float(scene.ground.slope)
    swing = dict.fromkeys(("theta_thigh_1", "theta_shank_1"), -0.2884 + slope)
    swing |= dict.fromkeys(("omega_thigh_1", "omega_shank_1"), -0.0399)
    stance = dict.fromkeys(("theta_thigh_2", "theta_shank_2"), 0.1877 + slope)
    stance |= dict.fromkeys(("omega_thigh_2", "omega_shank_2"), -1.1014)
    gait = jb.find_gait(
        scene, scene.state(**swing, **stance, held="shank_2"), accuracy="tight", **PLAIN
    )
    assert gait.outcome is jb.gait.Search.FOUND
    assert bool(gait.stable)
    state = gait.measures.state
    ours = [float(state.theta_thigh_2), float(state.omega_thigh_1), float(state.omega_thigh_2)]
    np.testing.assert_allclose(ours, (0.1877 + slope, -0.0399, -1.1014), rtol=0.0, atol=0.02)
    assert float(gait.measures.period) == pytest.approx(0.559, rel=0.02)
    point, period, multipliers = CHENS_KNEES.gait(ours)
    # What holds begins on its limit, not a picosecond behind it.
    np.testing.assert_allclose(ours, point, rtol=0.0, atol=2e-12)
    assert float(gait.measures.period) == pytest.approx(period, abs=1e-12)
    leading = np.asarray(gait.multipliers)[:3]
    assert same_multipliers(leading, multipliers) < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("inertia", [0.1, 0.5])
def test_a_rimless_wheel_s_multiplier_in_closed_form(inertia):
    scene = rimless_wheel(inertia=inertia)
    names = ("wheel.mass", "wheel.inertia", "wheel.foot.centre")
    gait = jb.find_gait(scene, accuracy="tight", parameters=names)
    cosine, whole = math.cos(2.0 * ALPHA), inertia + 1.0
    eta = (inertia + cosine) / whole
    assert gait.outcome is jb.gait.Search.FOUND
    np.testing.assert_allclose(np.abs(gait.multipliers).max(), eta**2, rtol=0.0, atol=1e-10)
    rate = abs(float(gait.measures.state.omega_wheel))
    assert rate == pytest.approx(wheel_rate(inertia), abs=1e-10)
    # All spokes are one length: the multiplier depends on inertia/(mass · length²) alone.
    falls = 2.0 * eta * (cosine - 1.0) * inertia / whole**2
    expected = falls, -falls / inertia, 2.0 * falls
    np.testing.assert_allclose(gait.sensitivities.spectral_radius, expected, rtol=0.0, atol=1e-8)
    expected = 0.0, 0.0, 2.0 * math.sin(ALPHA)
    np.testing.assert_allclose(gait.sensitivities.step_length, expected, rtol=0.0, atol=1e-9)


@pytest.mark.slow
def test_the_compass_gait_doubles_its_period_where_equations_by_hand_say():
    model = MODELS["goswami"]
    scene = model.make()
    guess = scene.state(**model.starts["gait"])
    bounds = (THREE, math.radians(4.5))
    branch = jb.continue_gait(scene, "slope", bounds=bounds, guess=guess, accuracy="tight")
    (event,) = branch.bifurcations
    assert str(event.kind) == "period-doubling"
    assert math.degrees(event.value) == pytest.approx(4.37, abs=0.03)
    there = StraightLegs(COMPASS, hip_mass=10.0, l=1.0, slope=event.value, g=9.8)
    multipliers = there.gait([0.3086, -0.35, -1.2])[2]
    assert np.min(np.abs(multipliers + 1.0)) < 1e-7
