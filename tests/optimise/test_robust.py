"""Robust design, against measures of its members one by one; the front of two measures."""

import numpy as np
import pytest

import jaxbiped as jb
from tests.optimise.evaluations import evaluated, evaluated_over_members

pytestmark = pytest.mark.slow
RIGID = jb.ladder()["rigid"]
SCATTERED = "slope", "d"
WANTED = ("speed", "spectral_radius", "impact_loss")


def over_members(scene, criterion, larger):
    gait = jb.find_gait(scene, radius_sensitivities=False)
    return evaluated_over_members(scene, gait, WANTED, criterion, larger)


@pytest.mark.nightly
@pytest.mark.parametrize("criterion", ["mean", "worst"])
def test_measures_are_those_of_the_members_one_by_one(criterion):
    larger = {"speed": False, "spectral_radius": True, "impact_loss": True}
    members, known = over_members(RIGID, criterion, larger)
    own = jb.parameter_values(RIGID)
    rows = []
    for factors in members:
        values = {n: float(own[n]) * f for n, f in zip(SCATTERED, factors, strict=True)}
        scene = jb.with_parameters(RIGID, values)
        gait = jb.find_gait(scene, radius_sensitivities=False)
        rows.append(evaluated(scene, gait, WANTED).values)
    for name in WANTED:
        column = np.asarray([row[name] for row in rows])
        worst = column.max() if larger[name] else column.min()
        expected = column.mean() if criterion == "mean" else worst
        assert known.values[name] == pytest.approx(expected, rel=1e-7), name
    # Of a parameter that is scattered the derivative is that of its nominal value.
    step = 1e-4 * float(own["d"])
    place = jb.parameter_names(RIGID).index("d")
    ends = [
        over_members(jb.with_parameters(RIGID, {"d": float(own["d"]) + s}), criterion, larger)[1]
        for s in (step, -step)
    ]
    for name in WANTED:
        slope = (ends[0].values[name] - ends[1].values[name]) / (2.0 * step)
        assert known.slopes[name][place] == pytest.approx(slope, rel=1e-4), name


def test_the_worst_member_keeps_the_requirement():
    best = jb.optimise_gait(
        RIGID,
        vary={"d": (0.08, 0.12), "r": (0.06, 0.1)},
        maximise="speed",
        subject_to="step_length<0.19",
        scatter={"slope": 0.1},
        members=4,
        criterion="worst",
    )
    assert best.known.values["step_length"] == pytest.approx(0.19, rel=1e-4)
    # A steeper slope makes longer steps: at the nominal one there is room.
    assert float(best.gait.measures.step_length) < 0.189


def test_a_front_is_monotone():
    front = jb.optimise.pareto_front(
        RIGID,
        vary={"d": (0.08, 0.12), "r": (0.06, 0.1)},
        maximise="speed",
        against="step_length",
        bounds=[0.185, 0.19, 0.2],
    )
    speeds = front.values("speed")
    assert np.all(np.diff(speeds) > 0.0)
    assert np.allclose(front.values("step_length"), front.bounds, rtol=1e-5)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"scatter": {"q": 0.1}}, "scatter = 'q'"),
        ({"scatter": {"d": 1.5}}, "scatter of d = 1.5"),
        ({"scatter": {"hip_mass": 0.1}}, "hip_mass = 0"),
        ({"scatter": {"d": 0.1}, "criterion": "median"}, "criterion = 'median'"),
        (
            {"scatter": {"d": 0.1}, "criterion": "worst", "subject_to": "speed=0.4"},
            "from both sides",
        ),
    ],
)
def test_bad_scatter_is_refused(options, sentence):
    with pytest.raises(jb.ArgumentError, match=sentence):
        jb.optimise_gait(RIGID, vary={"d": (0.09, 0.11)}, maximise="speed", **options)
    with pytest.raises(jb.ArgumentError, match="bounds has the shape"):
        jb.optimise.pareto_front(
            RIGID, vary={"d": (0.09, 0.11)}, maximise="speed", against="period", bounds=[]
        )
