"""Costs of a gait's motion, against those of its walk: integrals, extremes, bounds along it."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import simpson

import jaxbiped as jb
from tests.optimise.evaluations import evaluated, evaluated_costs

KP, KD, TARGET = 40.6634, 2.18539, 0.738931


def compass(law, **scene):
    """Legs of 5 kg with their mass at the middle, 10 kg at the hip, on level ground."""
    legs = ("leg_1", "leg_2")
    mechanism = jb.Mechanism(
        root="hip",
        root_mass=10.0,
        bodies=tuple(jb.Body(leg, mass=5.0, inertia=0.0, centre=0.5) for leg in legs),
        feet=tuple(jb.Foot(leg, centre=1.0) for leg in legs),
        mirror=(legs,),
        joints=(jb.Motor({"leg_1": 1.0, "leg_2": -1.0}, law, name="hip"),),
    )
    return jb.RigidScene(mechanism, jb.Ground(slope=0.0, g=9.81), **scene)


DRIVEN = compass(jb.actuation.PD(KP, KD, TARGET))
START = DRIVEN.state(theta_leg_1=-0.2, theta_leg_2=0.2, omega_leg_1=-0.5, omega_leg_2=-1.2)
SQUARE_AT_STRIKE = jb.optimise.Integral(
    lambda motion: motion.rate("leg_2") ** 2,
    jb.laws.Quantity("turning and landing"),
    at_strike=lambda motion: motion.angle("leg_1") ** 2,
)
LOWEST = jb.optimise.Extreme(
    lambda motion: motion.angle("leg_2"), jb.laws.Quantity("lowest"), smallest=True
)


@pytest.fixture(scope="module")
def gait():
    return jb.find_gait(DRIVEN, START, radius_sensitivities=False)


@pytest.fixture(scope="module")
def walk(gait):
    """Times of a footstep, angles between the legs and of the second, rates, and torques."""
    times = np.linspace(0.0, float(gait.measures.period), 4001)
    saved = jb.simulate(
        DRIVEN, gait.measures.state, duration=times[-1], save=times[:-1], rtol=1e-12
    )
    # The state at the strike itself is the one behind it: that before continues the others.
    theta_1, theta_2, omega_1, omega_2 = (
        np.append(row, 4.0 * row[-1] - 6.0 * row[-2] + 4.0 * row[-3] - row[-4])
        for row in map(np.asarray, saved.state[1:])
    )
    rate = omega_1 - omega_2
    torque = -KP * (theta_1 - theta_2 - TARGET) - KD * rate
    return times, theta_1, theta_2, omega_2, torque, torque * rate


def test_integrals_are_those_of_the_walk(gait, walk):
    times, theta_1, _, omega_2, torque, power = walk
    expected = {
        "torque_squared": simpson(torque**2, x=times),
        "torque_squared[hip]": simpson(torque**2, x=times),
        "absolute_work": simpson(np.abs(power), x=times),
        "torque_squared_per_length": simpson(torque**2, x=times) / gait.measures.step_length,
        "absolute_work_per_time": simpson(np.abs(power), x=times) / times[-1],
    }
    known = evaluated(DRIVEN, gait, expected)
    for name, value in expected.items():
        # Simpson's rule does not see where the power changes its sign.
        assert known.values[name] == pytest.approx(float(value), rel=1e-6), name
    (own,) = evaluated_costs(DRIVEN, gait, SQUARE_AT_STRIKE)[0]
    assert own == pytest.approx(simpson(omega_2**2, x=times) + theta_1[-1] ** 2, rel=1e-8)


def test_extremes_are_those_of_the_walk_and_of_its_ends(gait, walk):
    """The leg that swings turns back before the strike, the one that stands never does."""
    _, theta_1, theta_2, _, torque, _ = walk
    known = evaluated(
        DRIVEN, gait, ("joint_range[leg_1]", "joint_range[leg_2]", "peak_torque")
    ).values
    assert theta_1.argmax() not in (0, len(theta_1) - 1)
    assert known["joint_range[leg_1]"] == pytest.approx(np.ptp(theta_1), rel=1e-6)
    assert known["joint_range[leg_2]"] == pytest.approx(2.0 * theta_2[0], rel=1e-9)
    assert known["peak_torque"] == pytest.approx(np.abs(torque).max(), rel=1e-8)


@pytest.mark.parametrize("parameter", ["leg.hip.kp", "slope"])
def test_derivatives_of_costs_are_differences(gait, parameter):
    costs = (SQUARE_AT_STRIKE, LOWEST)
    _, slopes, bars = evaluated_costs(DRIVEN, gait, *costs)
    value, place = float(jb.parameter_values(DRIVEN)[parameter]), 1e-5
    differences = []
    for side in (1.0, -1.0):
        changed = jb.with_parameters(DRIVEN, {parameter: value + side * place})
        near = jb.find_gait(changed, gait, accuracy="tight", parameters=())
        differences.append(np.array(evaluated_costs(changed, near, *costs, accuracy="tight")[0]))
    expected = (differences[0] - differences[1]) / (2.0 * place)
    k = jb.parameter_names(DRIVEN).index(parameter)
    np.testing.assert_allclose(slopes[:, k], expected, rtol=1e-6)
    assert np.all(bars[:, k] < 1e-6 * np.abs(expected))


def test_half_of_a_push_offs_square_is_known():
    scene = jb.models.kuo()
    gait = jb.find_gait(scene, radius_sensitivities=False)
    known = evaluated(scene, gait, ("push_off_squared",))
    (impulse,) = (float(part.impulse) for part in scene.actuation if hasattr(part, "impulse"))
    slopes = np.where(np.array(jb.parameter_names(scene)) == "impulse", impulse, 0.0)
    assert known.values["push_off_squared"] == pytest.approx(0.5 * impulse**2, rel=1e-12)
    # By the inertia of legs that weigh almost nothing measures change 1e13 times as fast.
    np.testing.assert_allclose(known.slopes["push_off_squared"], slopes, atol=1e-6)


def test_the_landing_speed_is_the_foots_towards_the_ground(gait):
    """By angles just before the strike, which are those behind it with the legs exchanged."""
    known = evaluated(DRIVEN, gait, ("landing_speed",))
    last = jb.simulate(
        DRIVEN, gait.measures.state, duration=float(gait.measures.period) - 1e-7, rtol=1e-12
    ).state
    theta_1, theta_2, omega_1, omega_2 = (float(leaf[-1]) for leaf in last[1:])
    speed = np.sin(theta_2) * omega_2 - np.sin(theta_1) * omega_1
    assert known.values["landing_speed"] == pytest.approx(speed, abs=1e-5)
    assert speed > 0.1
    with pytest.raises(jb.ArgumentError, match="its feet are compliant"):
        jb.optimise_gait(jb.seed_scene(), vary={"slope": (0.02, 0.04)}, minimise="landing_speed")


@pytest.mark.slow
def test_a_motor_of_compliant_feet_drives_and_brakes():
    """Absolute work is twice the positive one less what the motor gives in all."""
    motor = jb.actuation.HipSpring(k=0.5, theta_0=0.1)
    scene = dataclasses.replace(jb.seed_scene(), actuation=motor)
    gait = jb.find_gait(scene, radius_sensitivities=False)
    known = evaluated(scene, gait, ("absolute_work", "motor_work", "torque_squared")).values
    net = jb.optimise.Integral(
        lambda motion: motion.power("hip-spring"), jb.laws.Quantity("net work")
    )
    (given,) = evaluated_costs(scene, gait, net)[0]
    assert known["absolute_work"] == pytest.approx(2.0 * known["motor_work"] - given, rel=1e-6)
    assert known["torque_squared"] > 0.0


def test_a_path_that_is_bounded_holds_the_optimum_back():
    box = ("leg.hip.kp", (20.0, 80.0)), ("leg.hip.kd", (0.5, 5.0)), ("leg.hip.target", (0.5, 1.0))
    how = dict(vary=dict(box), minimise="torque_squared", guess=START)
    free = jb.optimise_gait(DRIVEN, subject_to="step_length==0.4", **how)
    swing = jb.optimise.Extreme(lambda motion: motion.angle("leg_1"), jb.laws.Quantity("most"))
    most = evaluated_costs(free.scene, free.gait, swing)[0][0] - 0.02
    along = jb.optimise.Along(swing.value, high=most, name="swing", unit="rad")
    held = jb.optimise_gait(DRIVEN, subject_to=["step_length==0.4", along], **how)
    assert held.outcome is free.outcome is jb.optimise.Outcome.CONVERGED
    assert held.objective > free.objective
    assert held.measures["swing_highest"] == pytest.approx(most, rel=1e-6)
    _, bound = held.optimality.requirements
    assert bound.name == "swing_highest"
    assert bound.active
    assert bound.multiplier < 0.0


@pytest.mark.parametrize(
    ("how", "words"),
    [
        (dict(minimise="torque_squard"), "torque_squard"),
        (dict(minimise="torque_squared[knee]"), "motor = 'knee' is not known"),
        (dict(minimise="joint_range"), r"name an angle, joint_range\[BODY\]"),
        (dict(minimise="joint_range[knee]"), "knee"),
        (dict(minimise="push_off_squared"), "it has no push-off"),
        (dict(minimise="jerk[hip]"), "jerk"),
        (dict(minimise=LOWEST.value), "minimise = <function"),
        (dict(minimise="speed", subject_to=jb.optimise.Along(LOWEST.value)), "has no bound"),
        (
            dict(minimise="speed", subject_to=jb.optimise.Along(LOWEST.value, 1.0, 0.0)),
            "contradict each other",
        ),
        (
            dict(minimise=jb.optimise.Integral(lambda motion: (1.0, 2.0), jb.laws.Quantity("two"))),
            "rate of two returns",
        ),
        (
            dict(minimise=jb.optimise.Integral(lambda motion: 1.0, jb.laws.Quantity("speed"))),
            "two measures are called 'speed'",
        ),
    ],
)
def test_costs_that_are_none_are_refused(how, words):
    with pytest.raises(jb.ArgumentError, match=words):
        jb.optimise_gait(DRIVEN, vary={"leg.hip.kp": (20.0, 80.0)}, **how)


def test_terms_at_strikes_are_those_of_rigid_feet():
    with pytest.raises(jb.ArgumentError, match="at_strike of turning_and_landing is not allowed"):
        jb.optimise_gait(jb.seed_scene(), vary={"d": (0.1, 0.2)}, minimise=SQUARE_AT_STRIKE)


def test_a_rate_that_compares_numbers_is_told_how():
    rate = lambda motion: 1.0 if motion.rate("leg_1") > 0.0 else 0.0
    cost = jb.optimise.Integral(rate, jb.laws.Quantity("time forward"))
    with pytest.raises(jb.ArgumentError, match=r"rate of time_forward .* jax.numpy.where"):
        jb.optimise_gait(DRIVEN, vary={"leg.hip.kp": (20.0, 80.0)}, minimise=cost)


def test_the_ground_carries_the_weight_of_one_that_stands():
    state = DRIVEN.state(theta_leg_1=0.0, theta_leg_2=0.0)
    force = jb.dynamics.WalkerMotion(DRIVEN, state).ground_force()
    held = jb.dynamics.rolling(DRIVEN, state).force
    assert float(force.normal) == float(held.normal)
    assert jnp.isfinite(force.tangential)


def test_parameters_may_be_tied_and_measures_combined():
    """The optimum under a tie is that of the tied parameter alone."""
    vary = {"leg.hip.kp": (20.0, 80.0), "leg.hip.kd": (0.5, 5.0), "leg.hip.target": (0.5, 1.0)}
    tied = jb.optimise.Linear({"leg.hip.kp": 1.0, "leg.hip.kd": -20.0}, equals=0.0, name="tie")
    rate = jb.optimise.FunctionOf(
        lambda effort, period: effort / period,
        ("torque_squared", "period"),
        jb.laws.Quantity("effort rate", unit="N^2 m^2"),
    )
    how = dict(vary=vary, guess=START)
    best = jb.optimise_gait(DRIVEN, minimise=rate, subject_to=["step_length==0.4", tied], **how)
    own = best.measures
    assert best.variables["leg.hip.kp"] == pytest.approx(20.0 * best.variables["leg.hip.kd"])
    assert own["effort_rate"] == pytest.approx(own["torque_squared"] / own["period"], rel=1e-12)
    named = evaluated(best.scene, best.gait, ("torque_squared_per_time",))
    assert own["effort_rate"] == pytest.approx(named.values["torque_squared_per_time"], rel=1e-9)
    np.testing.assert_allclose(
        best.known.slopes["effort_rate"], named.slopes["torque_squared_per_time"], rtol=1e-6
    )


@pytest.mark.parametrize("how", [dict(), dict(engine="xla"), dict(dt=2e-4)])
def test_a_walk_sums_what_its_cycles_cost(gait, how):
    """Also with terms at strikes, from a start and to an end within a footstep."""
    period = float(gait.measures.period)
    asked = {"effort": "torque_squared", "own": SQUARE_AT_STRIKE}
    walk = jb.simulate(
        DRIVEN, gait.measures.state, duration=2.0 * period + 1e-9, integrals=asked,
        **({"accuracy": "tight"} if "dt" not in how else {}), **how,
    )  # fmt: skip
    effort = evaluated(DRIVEN, gait, ("torque_squared",)).values["torque_squared"]
    (own,) = evaluated_costs(DRIVEN, gait, SQUARE_AT_STRIKE)[0]
    assert float(walk.integrals["effort"]) == pytest.approx(2.0 * effort, rel=2e-6)
    assert float(walk.integrals["own"]) == pytest.approx(2.0 * own, rel=2e-6)


def test_a_number_as_accuracy_gives_integrals_their_bars(gait):
    names = ("torque_squared", "torque_squared[hip]")
    how = dict(footsteps=1, accuracy=1e-7, integrals=names)
    walk = jb.simulate(DRIVEN, gait.measures.state, **how)
    effort = evaluated(DRIVEN, gait, ("torque_squared",), "tight").values["torque_squared"]
    bars = walk.error.bars["integrals"]
    for name in names:
        assert abs(float(walk.integrals[name]) - effort) < bars[name] < 1e-5 * effort


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (3.0, "integrals = 3.0 is not allowed: it must be a"),
        (["speed"], "integrals = 'speed' is not known"),
        (["peak_torque"], "must be an Integral"),
        (["push_off_squared"], "it has no push-off"),
        ([3.0], "must be an Integral"),
    ],
)
def test_what_is_no_integral_of_a_walk_is_refused(asked, words):
    with pytest.raises(jb.ArgumentError, match=words):
        jb.simulate(DRIVEN, START, footsteps=1, integrals=asked)


def test_a_store_belongs_to_the_functions_of_its_costs(tmp_path):
    """Also where these have no names of their own."""
    vary, store = {"leg.hip.kp": (20.0, 80.0)}, tmp_path / "designs"
    how = dict(vary=vary, guess=START, iterations=1, store=store)
    costs = [
        jb.optimise.Integral(rate, jb.laws.Quantity("turning"))
        for rate in (
            lambda motion: motion.rate("leg_1") ** 2,
            lambda motion: motion.rate("leg_2") ** 2,
        )
    ]
    first = jb.optimise_gait(DRIVEN, minimise=costs[0], **how)
    again = jb.optimise_gait(DRIVEN, minimise=costs[0], **how)
    assert first.objective == again.objective
    with pytest.raises(jb.ArgumentError, match="belongs to another problem"):
        jb.optimise_gait(DRIVEN, minimise=costs[1], **how)


def test_losses_along_a_walk_are_those_of_the_ledger():
    """Of a walker whose knees strike their stops, over two footsteps of its gait."""
    scene = jb.models.hsu_chen()
    gait = jb.find_gait(scene, parameters=(), accuracy="tight")
    start = gait.measures.state
    walk = jb.simulate(scene, start, footsteps=2, integrals="impact_loss", accuracy="tight")
    once = jb.rigid_walk(scene, start, footsteps=2, max_arrivals=2, accuracy="tight")
    books = jb.measure.rigid_ledger(scene, once)
    (strike,), (stops,) = books.impact_loss, books.stop_loss
    assert stops > 0.01
    assert float(walk.integrals["impact_loss"]) == pytest.approx(2.0 * (strike + stops), rel=1e-8)
