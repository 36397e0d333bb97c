"""State, period and design as unknowns of one problem, against known optima and differences."""

import numpy as np
import pytest

import jaxbiped as jb
from tests.optimise.evaluations import simultaneous_problem
from tests.optimise.test_costs_of_motion import START, compass

A = jb.actuation
STEP = ("step_length==0.4", "period==0.7")
CUBIC = compass(A.TimePolynomial((0.0,) * 4, 0.7))
PD = compass(A.PD(20.0, 1.0, 0.4))
NEAR = jb.with_parameters(
    PD, {"leg.hip.kp": 40.6634, "leg.hip.kd": 2.18539, "leg.hip.target": 0.738931}
)
"""Near the best gains."""
COST_OF_SIX = 35.4354149
GAINS = {"leg.hip.kp": (1.0, 200.0), "leg.hip.kd": (0.01, 20.0), "leg.hip.target": (0.05, 1.0)}
FREE = 203.6052460122
"""The least ∫u² of any torque in a step of .4 m in .7 s, by collocation [N²·m²·s]."""


def coefficients(count, name="leg.hip", most=400.0):
    return {f"{name}.torque_{k}": (-most, most) for k in range(1, count + 1)}


def together(scene, vary, subject_to=STEP, minimise="torque_squared", **options):
    return jb.optimise_gait(
        scene,
        vary=vary,
        minimise=minimise,
        subject_to=list(subject_to),
        formulation="together",
        **options,
    )


def spline(count, span=0.7):
    return compass(A.TimeSpline((0.0,) * count, span))


@pytest.mark.parametrize(
    ("scene", "count", "least"),
    [
        (CUBIC, 4, 203.8089592361),
        pytest.param(spline(6), 6, 203.6108822849, marks=pytest.mark.slow),
        pytest.param(spline(24), 24, FREE, marks=pytest.mark.nightly),
    ],
)
def test_laws_of_time_are_optimal_from_zero_torque(scene, count, least):
    best = together(scene, coefficients(count))
    assert best.outcome is jb.optimise.Outcome.CONVERGED
    assert best.objective == pytest.approx(least, rel=1e-8)
    assert abs(best.objective - least) < best.error + 1e-8 < 1e-5
    assert best.objective > FREE - 1e-5
    assert best.measures["step_length"] == pytest.approx(0.4, rel=1e-8)
    assert best.measures["period"] == pytest.approx(0.7, rel=1e-8)
    assert best.optimality.residual < 1e-6
    walk = jb.rigid_walk(best.scene, best.gait.measures.state, footsteps=1, max_arrivals=1)
    assert float(walk.arrivals.t[0]) == pytest.approx(0.7, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("kp", [5.0, 120.0])
def test_gains_are_those_that_are_found_gait_by_gait(kp):
    """From gains that walk nowhere near the step that is asked for."""
    found = together(jb.with_parameters(PD, {"leg.hip.kp": kp}), GAINS)
    single = jb.optimise_gait(
        NEAR,
        vary=GAINS,
        minimise="torque_squared",
        subject_to=list(STEP),
        guess=START,
        formulation="gait by gait",
    )
    assert (found.formulation, single.formulation) == ("together", "gait by gait")
    assert found.outcome is jb.optimise.Outcome.CONVERGED
    assert found.objective == pytest.approx(single.objective, rel=1e-7)
    for name in GAINS:
        assert found.variables[name] == pytest.approx(single.variables[name], rel=1e-3)


@pytest.mark.slow
def test_a_path_is_bounded_and_parameters_are_tied():
    """At nodes in the search; the optimum keeps the bound along the whole cycle."""
    tied = jb.optimise.Linear({"leg.hip.torque_1": 1.0, "leg.hip.torque_4": -0.4}, equals=1.0)
    swing = lambda motion: motion.angle("leg_1")
    best = together(CUBIC, coefficients(4), (*STEP, tied))
    one, other = (best.variables[f"leg.hip.torque_{k}"] for k in (1, 4))
    assert one - 0.4 * other == pytest.approx(1.0, abs=1e-6)
    loose, tight = (
        together(CUBIC, coefficients(4), (*STEP, jb.optimise.Along(swing, high=most, name="swing")))
        for most in (2.0, 0.6)
    )
    assert loose.measures["swing_highest"] > 0.61
    assert tight.outcome is jb.optimise.Outcome.CONVERGED
    assert tight.measures["swing_highest"] == pytest.approx(0.6, rel=1e-6)
    assert tight.objective == pytest.approx(254.254212, rel=1e-6)
    with pytest.raises(jb.ArgumentError, match="no cycle was found"):
        together(CUBIC, coefficients(4), (*STEP, jb.optimise.Along(swing, high=0.5)))


@pytest.mark.slow
def test_a_search_begins_at_a_gait_and_divides_costs():
    per = together(PD, GAINS, ("speed==0.5", "step_length==0.4"), "torque_squared_per_length")
    again = together(
        per.scene,
        GAINS,
        ("speed==0.5", "step_length==0.4"),
        "torque_squared_per_length",
        guess=per.gait,
        segments=3,
    )
    assert again.objective == pytest.approx(per.objective, rel=1e-7)
    assert per.measures["period"] == pytest.approx(0.8, rel=1e-8)


def test_derivatives_of_the_conditions_are_differences():
    along = jb.optimise.Along(lambda motion: motion.angle("leg_1"), high=0.3, name="swing")
    problem, z = simultaneous_problem(CUBIC, coefficients(4), [*STEP, "speed<0.6", along])
    random = np.random.default_rng(0)
    z = z + 0.01 * random.standard_normal(len(z))
    here = problem.at(z)
    of_equal = random.standard_normal(len(here.equal))
    of_spare = np.zeros(len(here.spare))  # quotients count as linear
    of_spare[1:] = random.random(len(of_spare) - 1)

    def values(z):
        there = problem.at(z)
        return np.concatenate([[there.objective], there.equal, there.spare])

    def gradient(z):
        there = problem.at(z)
        return there.gradient - of_equal @ there.equal_slopes - of_spare @ there.spare_slopes

    def quotients(function, step):
        moves = step * np.eye(len(z))
        return np.transpose([(function(z + e) - function(z - e)) / (2.0 * step) for e in moves])

    slopes = np.vstack([here.gradient, here.equal_slopes, here.spare_slopes])
    expected = quotients(values, 1e-5)
    # At the span, where the law's slope jumps, differences see both sides.
    smooth = np.ones(len(z), dtype=bool)
    smooth[-5], smooth[problem.count * 5 - 1] = False, False
    np.testing.assert_allclose(slopes[:, smooth], expected[:, smooth], rtol=1e-5, atol=1e-4)
    whole = problem.curvature(z, of_equal, of_spare)
    bends = quotients(gradient, 1e-4)
    size = np.max(np.abs(bends))
    chosen = np.ix_(smooth, smooth)
    np.testing.assert_allclose(whole[chosen], bends[chosen], atol=1e-4 * size)


def of_gains(scene, kp, kd, target):
    """Bounds of all gains and targets of a scene's motors."""
    bounds = {"kp": kp, "kd": kd, "target": target}
    names = [name for name in jb.parameter_names(scene) if name.rsplit(".")[-1] in bounds]
    return {name: bounds[name.rsplit(".")[-1]] for name in names}


@pytest.mark.slow
@pytest.mark.parametrize(
    "gains",
    [
        (50.0, 5.0, 0.05, 20.0, 1.0, 0.4),
        (340.0, 56.0, -0.3, 146.0, 8.4, 0.1),
        (88.0, 45.0, -0.6, 19.0, 49.0, -0.8),
        (374.0, 38.0, 0.9, 84.0, 33.0, 0.6),
    ],
)
def test_six_gains_of_three_links_are_found_from_poor_ones(gains):
    """Three links with a motor between torso and each leg; collocation has the same cost."""
    scene = three_links(A.PD(*gains[:3]), A.PD(*gains[3:]))
    vary = of_gains(scene, (0.0, 400.0), (0.0, 60.0), (-1.0, 1.0))
    assert len(vary) == 6
    best = jb.optimise_gait(scene, vary=vary, minimise="torque_squared", subject_to=list(STEP))
    assert best.outcome is jb.optimise.Outcome.CONVERGED
    assert best.formulation == "together"
    assert best.objective == pytest.approx(COST_OF_SIX, rel=1e-8)
    assert abs(best.gait.multipliers[0]) > 30.0
    at_bounds = {bound.name for bound in best.optimality.bounds}
    assert at_bounds == {name for name in vary if not name.endswith("kp")}


@pytest.mark.slow
def test_a_search_from_the_least_torques_finds_the_cheaper_optimum():
    """The torso is held against the vertical; near the gains given there is another optimum."""
    lean = A.PD(50.0, 5.0, 0.05, of={"torso": 1.0, "vertical": -1.0})
    scene = three_links(lean, A.PD(20.0, 1.0, 0.4, of={"leg_1": 1.0, "leg_2": -1.0}))
    best = together(scene, of_gains(scene, (1.0, 400.0), (0.1, 60.0), (-1.0, 1.0)))
    assert best.objective == pytest.approx(37.470464, rel=1e-6)


def three_links(stance, swing):
    """The compass with a torso, and a motor between it and each leg."""
    legs = ("leg_1", "leg_2")
    mechanism = jb.Mechanism(
        root="hip",
        root_mass=15.0,
        bodies=(
            *(jb.Body(leg, mass=5.0, inertia=0.0, centre=0.5) for leg in legs),
            jb.Body("torso", mass=10.0, inertia=0.0, centre=-0.5),
        ),
        feet=tuple(jb.Foot(leg, centre=1.0) for leg in legs),
        mirror=(legs,),
        joints=(
            jb.Motor({"torso": 1.0, "leg_2": -1.0}, stance, name="hip_stance"),
            jb.Motor({"leg_1": 1.0, "torso": -1.0}, swing, name="hip_swing"),
        ),
    )
    return jb.RigidScene(mechanism, jb.Ground(slope=0.0, g=9.81))


@pytest.mark.slow
def test_a_step_ends_as_the_foot_comes_down():
    """Of 0.5 m in 0.8 s the cheapest cycle ends as the foot leaves the ground upwards."""
    scene, vary, step = spline(6, 0.8), coefficients(6), ("step_length==0.5", "period==0.8")
    with pytest.raises(
        jb.ArgumentError, match=r"486\.09\d*, the foot does not come down at the end"
    ):
        together(scene, vary, step)
    best = together(scene, vary, (*step, "landing_speed>0.05"))
    assert best.outcome is jb.optimise.Outcome.CONVERGED
    assert best.measures["landing_speed"] == pytest.approx(0.05, rel=1e-6)
    assert best.objective == pytest.approx(486.348738, rel=1e-7)


def test_a_cycle_that_is_no_gait_is_told_why():
    """A gait that is followed beyond its strike has one before its end."""
    whole, z = simultaneous_problem(NEAR, GAINS, list(STEP))
    gait = jb.find_gait(NEAR, START, parameters=())
    u, period = z[-len(GAINS) :], float(gait.measures.period)
    z = whole.followed_cycle(u, gait.measures.state, 1.2 * period)
    told = rf"before its end, after {period:.4g} s of {1.2 * period:.4g} s"
    assert told in whole.why_no_gait(z)


def test_a_formulation_is_chosen():
    how = dict(vary=GAINS, minimise="torque_squared", subject_to=list(STEP), iterations=2)
    for optimiser, scene, formulation in (
        ("trust-region", PD, "gait by gait"),
        ("slsqp", PD, "gait by gait"),
        # A step of its gains may move the state as far as a fold.
        ("trust-region", NEAR, "together"),
    ):
        best = jb.optimise_gait(scene, optimiser=optimiser, **how)
        assert best.formulation == best.to_dataset().attrs["formulation"] == formulation
    best = jb.optimise_gait(CUBIC, **how | {"vary": coefficients(4)})
    assert best.formulation == "together"


def five_links():
    """RABBIT's numbers: Chevallereau et al., IEEE Control Systems Magazine 23 (2003)."""
    bodies, numbers = [], (1, 2)
    for i in numbers:
        bodies.append(jb.Body(f"thigh_{i}", mass=6.8, inertia=1.08, centre=0.163))
        shank = dict(mass=3.2, inertia=0.93, centre=0.128, parent=f"thigh_{i}", at=0.4)
        bodies.append(jb.Body(f"shank_{i}", **shank))
    bodies.append(jb.Body("torso", mass=20.0, inertia=2.22, centre=-0.2))
    angles = {
        "stance_hip": {"torso": 1.0, "thigh_2": -1.0},
        "swing_hip": {"thigh_1": 1.0, "torso": -1.0},
        "stance_knee": {"shank_2": 1.0, "thigh_2": -1.0},
        "swing_knee": {"shank_1": 1.0, "thigh_1": -1.0},
    }
    law = A.TimeSpline((0.0,) * 6, 0.7)
    mechanism = jb.Mechanism(
        root="hip",
        root_mass=0.0,
        bodies=tuple(bodies),
        feet=tuple(jb.Foot(f"shank_{i}", centre=0.4) for i in numbers),
        mirror=(("thigh_1", "thigh_2"), ("shank_1", "shank_2")),
        joints=tuple(jb.Motor(angle, law, name=name) for name, angle in angles.items()),
    )
    return jb.RigidScene(mechanism, jb.Ground(slope=0.0, g=9.81))


@pytest.mark.nightly
def test_five_links_walk_from_zero_torque_and_their_knees_bend_one_way():
    scene = five_links()
    names = [name for name in jb.parameter_names(scene) if ".torque_" in name]
    assert len(names) == 24
    knees = [
        jb.optimise.Along(
            lambda motion, i=i: motion.angle(f"shank_{i}"), high=0.0, name=f"knee {i}", unit="rad"
        )
        for i in (1, 2)
    ]
    step = ("step_length==0.5", "period==0.7", *knees)
    best = together(scene, dict.fromkeys(names, (-300.0, 300.0)), step)
    assert best.objective == pytest.approx(390.808117, rel=1e-6)
    assert abs(best.gait.multipliers[0]) > 30.0
    for i in (1, 2):
        assert best.measures[f"knee_{i}_highest"] <= 0.0


def test_the_cost_of_transport_is_an_integral_like_any_other():
    """Its optimum is certified, and its value is that of a walk's measure."""
    best = jb.optimise_gait(
        PD, vary=GAINS, minimise="cost_of_transport", subject_to=STEP, formulation="together"
    )
    assert best.outcome is jb.optimise.Outcome.CONVERGED
    walk = jb.rigid_walk(best.scene, best.gait.measures.state, footsteps=2, max_arrivals=2)
    cost = jb.measure.cost_of_transport(best.scene, walk).cost
    assert best.objective == pytest.approx(float(cost[-1]), rel=1e-6)


@pytest.mark.parametrize(
    ("how", "words"),
    [
        (dict(formulation="all at once"), "formulation = 'all at once' is not"),
        (dict(segments=0), "segments = 0 is not allowed"),
        (dict(minimise="spectral_radius"), "spectral_radius, which is no integral along the cycle"),
        (dict(subject_to="radius_bound<1"), "radius_bound, which is no integral along the cycle"),
        (dict(minimise="peak_torque"), "peak_torque, an extreme, except as the upper bound"),
        (dict(subject_to="peak_torque>3"), "peak_torque, an extreme, except as the upper bound"),
        (dict(subject_to="joint_range[leg_1]<1"), r"joint_range\[leg_1\], an extreme"),
        (dict(footsteps=2), "a cycle of several footsteps"),
        (dict(scatter={"slope": 0.1}, scene=dict(slope=0.01)), "with scatter"),
    ],
)
def test_what_has_no_such_search_is_refused(how, words):
    how = dict(minimise="torque_squared", formulation="together") | how
    scene = jb.with_parameters(PD, how.pop("scene", {}))
    with pytest.raises(jb.ArgumentError, match=words):
        jb.optimise_gait(scene, vary=GAINS, **how)


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (jb.seed_scene, "for compliant feet, which press into the ground"),
        (jb.models.hsu_chen, "for a walker whose modes change"),
    ],
)
def test_scenes_that_have_no_such_search_are_refused(scene, words):
    with pytest.raises(jb.ArgumentError, match=words):
        jb.optimise_gait(
            scene(), vary={"slope": (0.01, 0.05)}, maximise="speed", formulation="together"
        )
