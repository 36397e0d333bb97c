"""Points of a branch and their axis, against closed forms and multipliers that are written down."""

import dataclasses
from types import SimpleNamespace

import jax
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.continuation import Axis, BranchEvent, _trace
from jaxbiped.continuation._bifurcations import explains, not_located
from jaxbiped.continuation._branch_point import axis_of, branch_point, change_of, start_of
from jaxbiped.continuation._continue_gait import continuation_setup
from jaxbiped.continuation._cycle import NO_WALK, Cycle
from jaxbiped.gait._pseudo_arclength import Curve, CurvePoint
from tests.mechanisms import scene_of

RIGID = jb.ladder()["rigid"]


@pytest.mark.parametrize(
    ("axis", "middle"),
    [(Axis("g", 2.0, 200.0, True, 0), 20.0), (Axis("g", 2.0, 200.0, False, 0), 101.0)],
)
def test_an_axis_by_factors_and_by_differences(axis, middle):
    assert [axis.value(s) for s in (0.0, 0.5, 1.0)] == pytest.approx([2.0, middle, 200.0])
    for s in (0.0, 0.3, 1.0):
        assert axis.place(axis.value(s)) == pytest.approx(s, abs=1e-14)
        change = axis.value(s + 1e-6) - axis.value(s - 1e-6)
        assert axis.slope(s) == pytest.approx(change / 2e-6, rel=1e-8)


def test_a_range_of_two_decades_is_gone_through_by_factors():
    for low, high, asked, log in (
        (0.1, 10.0, None, True),
        (0.1, 9.99, None, False),
        (0.1, 10.0, False, False),
        (1.0, 2.0, True, True),
    ):
        assert axis_of(RIGID, "g", (low, high), asked).log is log
        assert axis_of(RIGID, "g", (high, low), asked)[1:3] == (low, high)
    assert not axis_of(RIGID, "slope", (-0.1, 1.0), None).log
    names = jb.parameter_names(RIGID)
    for name in ("m", "l", "g", "slope"):
        axis = axis_of(RIGID, name, (0.3, 0.5), None)
        moved = jb.with_parameters(RIGID, {name: 0.4})
        before, after = jax.tree.leaves(RIGID), jax.tree.leaves(moved)
        changed = [k for k in range(len(names)) if float(before[k]) != float(after[k])]
        assert changed in ([axis.leaf], [])


def test_a_branch_begins_at_its_scene_or_at_the_nearer_end():
    scene = jb.with_parameters(RIGID, {"slope": 0.02})
    for bounds, begin in (((0.01, 0.1), 0.02), ((0.03, 0.1), 0.03), ((0.0, 0.01), 0.01)):
        assert start_of(scene, axis_of(scene, "slope", bounds, None)) == begin


SIZES = np.array([4.0, 0.5, 1.0])
LOOSER = np.array([[-0.49, 0.0], [0.0, 0.0]])


def cycle(**changes):
    """Of two components: it returns (2.1, 0.9) with multipliers −0.5 and 0, looser −0.49."""
    given = dict(
        recurring=np.array([[2.1, 0.9], [2.2, 0.8]]),
        jacobian=np.stack([
            np.array([[-0.5, 0.0, 3.0], [0.0, 0.0, 7.0]]), np.column_stack([LOOSER, [3.0, 7.0]])
        ]),
        monodromy=np.stack([np.diag([-0.5, 1.01])] * 2),
        velocity=np.array([[0.0, 2.0]] * 2),
        period=np.array([0.4, 0.5]),
        advance=np.array([0.2, 0.3]),
        peak=np.array([90.0, 80.0]),
        code=np.array([0, 3]),
        grazes=np.array([0, 1]),
        sound=np.array([True, False]),
    )  # fmt: skip
    return Cycle(**(given | changes))


def point_of(seen):
    axis = Axis("g", 1.0, 3.0, False, 0)
    change = change_of(seen, np.array([2.0, 1.0]), axis.slope(0.25))
    place, tangent = np.array([0.5, 2.0, 0.25]), np.array([0.0, 0.6, 0.8])
    found = CurvePoint(place, tangent, change)
    return change, branch_point(Curve(None, SIZES, 1e-9), axis, found)


def test_a_change_is_that_of_the_cycle_and_not_of_its_witness():
    change, _ = point_of(cycle())
    np.testing.assert_allclose(change.value, [0.1, -0.1])
    np.testing.assert_allclose(change.by_point, [[-1.5, 0.0], [0.0, -1.0]])
    np.testing.assert_allclose(change.by_s, [6.0, 14.0])
    assert change.code == 0
    for changes, code in ((dict(code=np.array([3, 0])), 3), (dict(sound=[False, True]), NO_WALK)):
        assert point_of(cycle(**changes))[0].code == code


def test_a_point_has_the_numbers_of_its_cycle():
    _, point = point_of(cycle())
    assert (point.value, point.period, point.step_length, point.peak_normal) == (
        1.5,
        0.4,
        0.2,
        90.0,
    )
    np.testing.assert_allclose(point.recurring, [2.0, 1.0])
    np.testing.assert_allclose(point.multipliers, [-0.5])
    np.testing.assert_allclose(point.multiplier_errors, [0.01], rtol=1e-6)
    assert point.residual == pytest.approx(0.1)
    # The eigenvector along the velocity is that of 1.01.
    assert point.unit_multiplier_error == pytest.approx(0.01)
    assert point.stable is True
    assert point.bifurcation == int(jb.gait.Bifurcation.NONE)
    _, grazing = point_of(cycle(grazes=np.array([1, 0])))
    assert np.isinf(grazing.multiplier_errors).all()
    assert grazing.stable is None


@pytest.mark.parametrize(
    ("before", "beyond", "slides"),
    [
        (0.0, 0.0, False), (0.2, 0.31, True), (0.2, 0.29, False), (0.001, 0.012, True),
        (0.001, 0.0105, False),
    ],
)  # fmt: skip
def test_a_foot_begins_to_slide_where_more_of_its_load_slips(before, beyond, slides):
    assert _trace.slides(before, beyond) is slides


def test_a_foot_that_stands_carries_its_weight():
    """The seed's foot, pressed in by d where K dⁿ is the weight."""
    scene = dataclasses.replace(jb.seed_scene(slope=0.0), clearance=jb.laws.AlwaysTouching())
    weight = 2.0 * 9.8
    depth = (weight / 1e6) ** (1.0 / 1.5)
    state = scene.state(theta_1=-0.5, standing="2")
    state = state._replace(hip_z=state.hip_z - depth)
    assert _trace._load(scene, state) == pytest.approx(1.0, rel=1e-3)
    for share, unloaded in ((5e-4, True), (2e-3, False)):
        lifted = state._replace(hip_z=state.hip_z + depth * (1.0 - share ** (1.0 / 1.5)))
        words = _trace.limit_cause(scene, lambda _: scene, lifted, 1e-3)
        assert words == (
            "no touch: the stance foot carries nothing on the section" if unloaded else None
        )


def test_bifurcations_explain_as_many_multipliers_as_they_take_out():
    doubling, sacker = BranchEvent.PERIOD_DOUBLING, BranchEvent.NEIMARK_SACKER

    def at(*values):
        matrix = np.diag([*values, 0.0])
        return SimpleNamespace(change=SimpleNamespace(seen=SimpleNamespace(jacobian=[matrix])))

    inside, one, two = at(0.5, 0.4), at(-1.5, 0.4), at(-1.5, 1.4)
    for here, there, kinds, expected in (
        (inside, inside, [], True),
        (inside, one, [], False),
        (inside, one, [doubling], True),
        (one, inside, [doubling], True),
        (inside, two, [sacker], True),
        (inside, two, [doubling], False),
        (inside, two, [doubling, doubling], True),
        (inside, one, [sacker], False),
        (inside, one, [doubling, doubling], False),
        (inside, one, [sacker, doubling], True),
    ):
        assert explains(here, there, kinds) is expected, (kinds, expected)


def test_an_entry_that_is_not_located_has_the_multiplier_nearest_to_the_circle():
    point = SimpleNamespace(
        multipliers=np.array([3.0, -1.1, 0.2]), multiplier_errors=np.array([0.3, 0.01, 0.0]),
        value=0.4,
    )  # fmt: skip
    found = not_located(point, 0.7)
    assert found[2:] == (-1.1, 0.01, pytest.approx(0.3), 0.7)


@pytest.mark.parametrize(("name", "footsteps"), [("torso", 3), ("unequal", 6)])
def test_a_cycle_is_as_many_arrivals(name, footsteps):
    scene = scene_of(name)
    axis = axis_of(scene, "slope", (0.02, 0.04), None)
    how = dict(accuracy="balanced", engine="auto")
    setup = continuation_setup(scene, axis, footsteps=footsteps, **how)
    assert (setup.arrivals, setup.footsteps) == (3, footsteps)
    setup = continuation_setup(scene, axis, footsteps=None, **how)
    assert (setup.arrivals, setup.footsteps) == (1, footsteps // 3)
