"""Branches of rigid walkers against what was published and what `find_gait` says."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import xarray
from scipy.optimize import brentq

import jaxbiped as jb
from jaxbiped.continuation import (
    BranchEvent,
    bifurcation_curve,
    doubling_cascade,
    find_isolated,
    open_branch,
    resume_branch,
    switch_branch,
)
from jaxbiped.gait import BranchEnd
from tests.cli.commands import interrupt_after
from tests.rigid_walkers import (
    FIRST_DOUBLING,
    MULTIPLIER,
    STABLE,
    UNSTABLE,
    rigid_seed,
    simplest_state,
    simplest_walker,
)

pytestmark = pytest.mark.slow

FEIGENBAUM = 4.669201609
PLAIN = dict(parameters=(), radius_sensitivities=False, accuracy="tight")


@pytest.fixture(scope="module")
def rigid():
    return jb.continue_gait(rigid_seed(), "slope", bounds=(0.01, 0.11), accuracy="tight")


@pytest.fixture(scope="module")
def simplest_branch():
    return jb.continue_gait(
        simplest_walker(0.009),
        bounds=(0.0005, 0.019),
        guess=simplest_state(*STABLE),
        accuracy="tight",
    )


@pytest.fixture(scope="module")
def cascade(simplest_branch):
    return doubling_cascade(simplest_branch, 5)


def test_the_rigid_seed_doubles_where_find_gait_says(rigid):
    (event,) = rigid.bifurcations
    assert event.kind is BranchEvent.PERIOD_DOUBLING
    assert abs(event.multiplier + 1.0) < 1e-6
    state = rigid.state(event)

    def above(slope):
        gait = jb.find_gait(rigid_seed(slope), state, **PLAIN)
        return float(np.min(np.asarray(gait.multipliers).real)) + 1.0

    expected = brentq(above, 0.1, 0.102, xtol=1e-12)
    assert event.value == pytest.approx(expected, abs=1e-9)


def test_points_are_the_gaits_that_find_gait_finds(rigid):
    for k in (3, len(rigid) // 2):
        point = rigid.points[k]
        gait = jb.find_gait(rigid.scene_at(k), rigid.state(k), **PLAIN)
        assert point.period == pytest.approx(float(gait.measures.period), abs=1e-9)
        assert point.step_length == pytest.approx(float(gait.measures.step_length), abs=1e-9)
        assert point.stable is bool(gait.stable)
        assert np.abs(point.multipliers) == pytest.approx(np.abs(gait.multipliers), abs=1e-7)
        assert point.residual < 1e-9
        assert point.unit_multiplier_error < 1e-8


def test_values_increase_and_end_on_the_bounds(rigid):
    assert np.all(np.diff(rigid.values) > 0.0)
    assert rigid.values[[0, -1]] == pytest.approx([0.01, 0.11], abs=1e-12)
    assert [str(stop.end) for stop in rigid.stops] == ["reached", "reached"]


def test_the_simplest_walkers_long_gait(simplest_branch):
    (event,) = simplest_branch.bifurcations
    assert event.kind is BranchEvent.PERIOD_DOUBLING
    assert event.value == pytest.approx(FIRST_DOUBLING, abs=1e-9)
    before = simplest_branch.values < event.value - 1e-9
    assert [p.stable for p, b in zip(simplest_branch.points, before, strict=True) if b] == [
        True
    ] * int(before.sum())
    start = int(np.argmin(np.abs(simplest_branch.values - 0.009)))
    assert simplest_branch.values[start] == pytest.approx(0.009, abs=1e-12)
    assert simplest_branch.points[start].recurring[1] == pytest.approx(STABLE[0], abs=1e-11)
    leading = simplest_branch.points[start].multipliers[0]
    assert min(abs(leading - MULTIPLIER), abs(leading - MULTIPLIER.conjugate())) < 1e-9


def test_deflation_finds_both_gaits_of_the_pair():
    """Published: 0.20031090049483 and 0.19393736960624; multipliers of the short 4.000, 0.459."""
    gaits = find_isolated(simplest_walker(0.009), accuracy="tight")
    angles = sorted(float(gait.state.theta_2) for gait in gaits)
    assert angles == pytest.approx([UNSTABLE[0], STABLE[0]], abs=1e-11)
    assert angles == pytest.approx([0.19393736960624, 0.20031090049483], abs=1e-9)
    short = min(gaits, key=lambda gait: float(gait.state.theta_2))
    assert short.point.multipliers[:2].real == pytest.approx([4.000, 0.459], abs=5e-3)
    assert [gait.stable for gait in gaits] == [gait is not short for gait in gaits]
    # What is known is avoided.
    again = find_isolated(simplest_walker(0.009), known=tuple(g.state for g in gaits), starts=8)
    assert again == ()


@pytest.mark.nightly
def test_gaits_of_three_footsteps_are_found_without_a_guess():
    scene = simplest_walker(0.0155)
    gaits = find_isolated(scene, footsteps=3, starts=16, accuracy="tight")
    assert len(gaits) == 2
    for gait in gaits:
        once = jb.find_gait(scene, gait.state, footsteps=1, **PLAIN)
        assert abs(float(once.measures.state.theta_2) - float(gait.state.theta_2)) > 1e-3
        thrice = jb.find_gait(scene, gait.state, footsteps=3, **PLAIN)
        assert str(thrice.outcome) == "found"
        assert float(thrice.measures.state.theta_2) == pytest.approx(
            float(gait.state.theta_2), abs=1e-9
        )
    branch = jb.continue_gait(
        scene, bounds=(0.011, 0.017), guess=gaits[0].state, footsteps=3, accuracy="tight"
    )
    # Both belong to one family, which begins at a fold and is stable beside it.
    (fold,) = [each for each in branch.bifurcations if each.kind is BranchEvent.FOLD]
    assert abs(fold.multiplier - 1.0) < 1e-6
    assert branch.values.min() == pytest.approx(fold.value, abs=1e-9)
    assert True in branch.stable


def test_the_cascade_tends_to_feigenbaums_ratio(cascade):
    assert [branch.footsteps for branch in cascade.branches] == [1, 2, 4, 8, 16]
    for event in cascade.doublings:
        assert abs(event.multiplier + 1.0) < 1e-6
    assert np.all(np.diff(cascade.values) > 0.0)
    assert cascade.ratios[-1] == pytest.approx(FEIGENBAUM, abs=0.02)
    assert 0.0182 < cascade.accumulation < 0.0184


def test_a_doubled_gait_is_one_of_twice_the_footsteps(simplest_branch, cascade):
    two = switch_branch(simplest_branch)
    assert two.footsteps == 2
    assert two.points[0].stable
    assert abs(two.points[0].value - FIRST_DOUBLING) < 2e-4
    assert two.bifurcations[0].value == pytest.approx(cascade.values[1], abs=1e-9)
    k = len(two) // 2
    scene, state = two.scene_at(k), two.state(k)
    once = jb.return_map(scene, state, accuracy="tight").state
    twice = jb.return_map(scene, state, footsteps=2, accuracy="tight").state
    assert abs(float(once.theta_2 - state.theta_2)) > 1e-3
    assert abs(float(twice.theta_2 - state.theta_2)) < 1e-9


def test_each_footstep_of_a_cycle_is_as_long_as_its_legs_reach(cascade, tmp_path):
    """Legs of 1 m on points: a step is as long as twice the sine of the angle in which it ends."""
    four = cascade.branches[2]
    place = four.state_type._fields.index("theta_2") - 1
    for point in four.points:
        steps = point.footsteps
        reach = 2.0 * np.sin(np.roll(steps.recurring[:, place], -1))
        np.testing.assert_allclose(steps.step_length, reach, rtol=1e-9)
        for name in ("period", "step_length"):
            total = getattr(steps, name).sum()
            assert total == pytest.approx(getattr(point, name), rel=1e-9)
        assert steps.peak_normal.max() == pytest.approx(point.peak_normal, rel=1e-6)
    point = four.points[-1]
    gait = jb.find_gait(four.scene_at(point), four.state(point), footsteps=4, **PLAIN)
    # The first length of a gait is that of the step with whose end it begins.
    lengths = np.roll(point.footsteps.step_length, 1)
    np.testing.assert_allclose(gait.step_lengths, lengths, rtol=1e-6)
    four.to_dataset().to_netcdf(tmp_path / "four.nc")
    again = open_branch(xarray.open_dataset(tmp_path / "four.nc"), four.scene)
    for read, kept in zip(again.points, four.points, strict=True):
        for name, values in kept.footsteps._asdict().items():
            np.testing.assert_array_equal(getattr(read.footsteps, name), values)


def test_the_fork_of_a_cascade_is_smooth_and_begins_at_its_doublings(cascade):
    ax = jb.plot.branch(cascade, "period").axes[0]
    ax.set_ylim(3.7, 4.0)
    lines = [line for line in ax.lines if len(line.get_xdata()) > 1][-(2 + 4 + 8 + 16) :]
    event = cascade.doublings[0]
    for line in lines[:2]:
        x, y = line.get_xydata()[0]
        assert (x, y) == pytest.approx((event.value, event.point.period), rel=1e-12)
        corners = np.diff(ax.transData.transform(line.get_xydata()), axis=0)
        turns = np.diff(np.unwrap(np.arctan2(corners[:, 1], corners[:, 0])))
        assert np.degrees(np.abs(turns)).max() < 15.0
    for line in lines[2:6]:
        assert line.get_xdata()[0] == cascade.values[1]
        assert min(abs(cascade.doublings[1].point.footsteps.period - line.get_ydata()[0])) == 0.0


def test_a_stored_branch_is_resumed(rigid, tmp_path):
    short = jb.continue_gait(
        rigid_seed(), "slope", bounds=(0.01, 0.11), accuracy="tight", max_points=20
    )
    short.to_dataset().to_netcdf(tmp_path / "branch.nc")
    short.to_dataset().to_zarr(tmp_path / "branch.zarr", consolidated=False)
    for stored in (
        xarray.open_dataset(tmp_path / "branch.nc"),
        xarray.open_zarr(tmp_path / "branch.zarr", consolidated=False),
    ):
        opened = open_branch(stored, rigid_seed())
        assert repr(opened) == repr(short)
        assert np.array_equal(opened.multipliers, short.multipliers)
    whole = resume_branch(opened)
    assert np.all(np.diff(whole.values) > 0.0)
    assert len(whole) > len(short)
    assert whole.bifurcations[0].value == pytest.approx(rigid.bifurcations[0].value, abs=1e-9)
    wider = resume_branch(whole, 10, direction="backward", bounds=(0.005, 0.11))
    assert np.all(np.diff(wider.values) > 0.0)
    assert wider.values[[0, -1]] == pytest.approx([0.005, 0.11], abs=1e-9)
    assert len(wider.bifurcations) == 1
    # What lies beyond the point goes, with its bifurcations.
    cut = resume_branch(whole, 5, max_points=3)
    assert len(cut) == 9
    assert cut.bifurcations == ()


def test_ctrl_c_ends_a_branch_with_its_points_so_far(monkeypatch):
    interrupt_after(monkeypatch, 1, "radius")
    found = jb.continue_gait(rigid_seed(), "slope", bounds=(0.018, 0.022))
    assert {stop.end for stop in found.stops} == {BranchEnd.INTERRUPTED}
    assert len(found) >= 2
    assert np.all(np.diff(found.values) > 0.0)


def test_a_dataset_says_what_is_in_it(rigid):
    data = rigid.to_dataset()
    assert data["slope"].attrs["units"] == "rad"
    assert data["state_omega_2"].attrs["units"] == "rad/s"
    sizes = np.abs(data["multipliers_real"] + 1j * data["multipliers_imag"]).max("multiplier")
    assert np.array_equal(data["spectral_radius"], sizes)
    assert np.array_equal(data["spectral_radius_error"], data["multipliers_error"][:, 0])
    assert all(each.attrs["long_name"] for each in data.variables.values())
    table = rigid.to_latex(along="event", columns=["event_slope", "event_kind"])
    assert re.search(r"0\.100401149\d+\(\d\d\) & period-doubling", table)
    assert data["speed"].values == pytest.approx(data["step_length"] / data["period"])
    assert set(np.unique(data["stable"])) == {-1, 0, 1}
    assert data["event_kind"].attrs["flag_meanings"].split()[int(data["event_kind"][0])] == (
        "period-doubling"
    )
    with pytest.raises(jb.ArgumentError, match=r"differs from the branch's own in scene\.r"):
        open_branch(data, jb.with_parameters(rigid_seed(), {"r": 0.09}))
    with pytest.raises(jb.ArgumentError, match="must be that of a branch"):
        open_branch(xarray.Dataset(), rigid_seed())
    with pytest.raises(jb.ArgumentError, match="it has no variable 'event_value_error'"):
        open_branch(data.drop_vars("event_value_error"), rigid_seed())


def test_a_curve_of_doublings_passes_through_that_of_another_scene(rigid):
    curve = bifurcation_curve(rigid, rigid.bifurcations[0], "r", bounds=(0.06, 0.09))
    assert np.all(np.abs(curve.multipliers + 1.0) < 1e-8)
    assert curve.units == ("rad", "m")
    k = int(np.argmin(np.abs(curve.values[:, 1] - 0.065)))
    slope, radius = curve.values[k]
    other = jb.continue_gait(
        jb.with_parameters(rigid_seed(), {"r": radius}),
        bounds=(slope - 0.005, slope + 0.005),
        guess=jb.dynamics.RigidState(0.0, *curve.points[k].recurring),
        accuracy="tight",
    )
    assert other.bifurcations[0].value == pytest.approx(slope, abs=1e-8)


def test_the_compliant_branch_turns_at_a_fold():
    """Few points: the fold, and `find_gait` on either side of it."""
    scene = jb.seed_scene(slope=0.0105)
    branch = jb.continue_gait(scene, bounds=(0.009, 0.0108), max_points=30, largest_step=0.1)
    folds = [each for each in branch.bifurcations if each.kind is BranchEvent.FOLD]
    assert len(folds) == 1
    assert abs(folds[0].multiplier - 1.0) < 1e-6
    assert folds[0].value == pytest.approx(0.0095185, abs=1e-6)
    state = branch.state(folds[0])
    options = dict(parameters=(), radius_sensitivities=False)
    inside = jb.find_gait(jb.seed_scene(slope=folds[0].value + 1e-6), state, **options)
    outside = jb.find_gait(jb.seed_scene(slope=folds[0].value - 1e-6), state, **options)
    assert str(inside.outcome) == "found"
    assert str(outside.outcome) != "found"
    assert {True, False} <= set(branch.stable)
    assert abs(folds[0].value - bisected_slope("fold")) <= folds[0].value_error


def bisected_slope(kind):
    """Where bisection by `find_gait` at the tight accuracy saw the seed's stability end [rad]."""
    results = Path(__file__).parents[2] / "experiments" / "results" / "slope_branch.json"
    losses = json.loads(results.read_text())["scenes"]["stribeck"]["losses"]
    (bracket,) = (loss["bisection"] for loss in losses if loss["kind"] == kind)
    return 0.5 * sum(bracket)


def test_the_compliant_doubling_lies_within_its_bar_of_the_bisected_one():
    scene = jb.seed_scene(slope=0.097)
    branch = jb.continue_gait(scene, bounds=(0.096, 0.104), largest_step=0.1, max_points=30)
    (event,) = branch.bifurcations
    assert event.kind is BranchEvent.PERIOD_DOUBLING
    assert abs(event.value - bisected_slope("period-doubling")) <= event.value_error < 3e-5


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (dict(along="slop", bounds=(0.0, 0.1)), "along = 'slop' is not known"),
        (dict(along="xi", bounds=(0.0, 0.1)), "along = 'xi' is not known"),
        (dict(bounds=(0.1, 0.1)), "the range is empty"),
        (dict(bounds=(0.1,)), "give two numbers"),
        (dict(bounds=(0.01, np.nan)), "must be a finite number"),
        (dict(bounds=(0.01, 2.0)), "radians"),
        (dict(along="m", bounds=(-1.0, 2.0)), "above 0"),
        (dict(bounds=(-0.01, 0.1), log=True), "above 0"),
        (dict(bounds=(0.01, 0.1), footsteps=0), "footsteps = 0"),
        (dict(bounds=(0.01, 0.1), max_points=0), "max_points = 0"),
        (dict(bounds=(0.01, 0.1), largest_step=0.0), "largest_step = 0"),
        (dict(bounds=(0.01, 0.1), accuracy="fast"), "accuracy = 'fast'"),
        (dict(bounds=(0.01, 0.1), engine="gpu"), "engine = 'gpu'"),
        (dict(bounds=(0.01, 0.1), guess=jb.seed_state()), "must be a RigidState"),
    ],
)
def test_what_is_not_allowed_costs_a_sentence(options, words):
    with pytest.raises(jb.ArgumentError, match=words) as refusal:
        jb.continue_gait(rigid_seed(), **options)
    assert "\n" not in str(refusal.value)


def test_more_that_is_not_allowed(rigid):
    redundant = jb.RedundantScene(jb.seed_scene(), jb.constraints.Index1(), "angle")
    with pytest.raises(jb.ArgumentError, match="redundant coordinates"):
        jb.continue_gait(redundant, bounds=(0.01, 0.1))
    with pytest.raises(jb.ArgumentError, match="the branch has"):
        resume_branch(rigid, 10_000)
    with pytest.raises(jb.ArgumentError, match="direction"):
        resume_branch(rigid, direction="up")
    with pytest.raises(jb.ArgumentError, match="branch itself follows it"):
        bifurcation_curve(rigid, rigid.bifurcations[0], "slope", bounds=(0.01, 0.1))
    with pytest.raises(jb.ArgumentError, match="is outside"):
        bifurcation_curve(rigid, rigid.bifurcations[0], "r", bounds=(0.01, 0.02))
    with pytest.raises(jb.ArgumentError, match="period doubling"):
        switch_branch(jb.continue_gait(rigid_seed(), bounds=(0.018, 0.022), max_points=3))


def test_where_there_is_no_gait_the_branch_says_why():
    """Level ground: nothing feeds a passive walk."""
    branch = jb.continue_gait(rigid_seed(0.0), bounds=(-0.001, 0.0), max_points=5)
    assert len(branch) == 0
    assert branch.stops[0].cause.startswith("no gait")
    assert "no beginning" in repr(branch)


@pytest.mark.nightly
def test_slip_and_lost_touch_are_told_as_limits():
    slips = jb.continue_gait(
        jb.seed_scene(mu_kinetic=0.2), "mu_kinetic", bounds=(0.1, 0.2), largest_step=0.1
    )
    assert slips.stops[0].cause.startswith("slip")
    assert slips.bifurcations[0].kind is BranchEvent.LIMIT
    bounces = jb.continue_gait(jb.seed_scene(c=4e4), "c", bounds=(1e4, 4e4), largest_step=0.1)
    assert bounces.stops[0].cause.startswith("no touch")
