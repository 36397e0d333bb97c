"""Attempted steps of a landing solve, against what comes first in courses that are given."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial import Polynomial

from jaxbiped import Ending
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._stance_motion import rolling_rates
from jaxbiped.hybrid import Rolling
from jaxbiped.hybrid._landing_system import SurfaceCourse
from jaxbiped.solve._explicit_step import DOPRI8
from jaxbiped.solve._landing_steps import (
    EndingWatch,
    Landing,
    LandingProgress,
    ModeProgress,
    _after_arrival,
    _after_change,
    _after_free_step,
    _landing,
    ending_of,
    initial_progress,
    with_next_step,
)
from jaxbiped.solve._step_events import ModeEvents, StepOnto
from tests.dynamics.test_mode_changes import mode_of
from tests.dynamics.test_modes import HEEL_TOE, in_mode, loads_of_feet
from tests.dynamics.test_rolling_mechanisms import rigid
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker
from tests.solve.test_step_events import AHEAD, FALLS, STEP, TIPS, ends_of, of_controls

ROLLING = Rolling()
RTOL, DURATION = 1e-6, 2.5
TOLERANT = 1e-3
YES, NO = True, False
STANDS = [0.3] * 6
DIPS = [0.2, 0.1, -1e-3, 0.1, 0.1, 0.2]
TOUCHES = [0.2, 0.1, 0.0, 0.1, 0.1, 0.2]
LEANS = of_controls(AHEAD)


def numbers(tree):
    return jax.tree.map(jnp.asarray, tree)


def walk_for(duration=DURATION, footsteps=4.0, state=None):
    state = simplest_state(*STABLE) if state is None else state
    how = duration, footsteps, RTOL, 100.0
    return Landing(ROLLING, simplest_walker(), state, *map(jnp.asarray, how))


def progress(state, turning, modes=None, **more):
    usual = dict(
        t=2.0, step=STEP, pace=0.11, arrival=1.5, period=0.9, due=2.4, landing=0, ending=NO,
        arrived=NO, footsteps=3, grazes=5, pulls=0, accepted=7, rejected=1, code=0,
    )  # fmt: skip
    return LandingProgress(
        state=state, accelerations=turning, modes=numbers(modes), **numbers(usual | more)
    )


def course(count=2):
    zeros = jnp.zeros(count)
    return SurfaceCourse(zeros, zeros, zeros > 1.0, jnp.zeros(0), (jnp.zeros(()),) * 2)


def modes_of(changing=0, behind=0, times=(1.7, 1.9)):
    paces = jnp.array([0.1, 0.2, 0.3])
    return ModeProgress(course(), changing, NO, 1, jnp.array(times), paces, behind)


def onto_of(state, near=NO, rest=1e-5, counts=YES, closing=-0.5):
    return StepOnto(*numbers((near, rest)), state, *numbers((closing, counts)))


@jax.jit
def by_landing_on_falls(walk, now, trial, error, rates, onto, changes):
    return [
        _after_free_step(
            walk,
            now,
            trial,
            error,
            DOPRI8.length(error),
            DOPRI8,
            rates,
            onto,
            endings,
            changes,
        )
        for endings in (EndingWatch.LOCATED, EndingWatch.INTERPOLATED)
    ]


def after(opening=STANDS, stance=LEANS, error=1.0, modes=None, changes=None, onto=None, **more):
    """After a free step, if falls are landed on or not: what is carried on, and if it was kept."""
    curves = (
        each if isinstance(each, Polynomial) else of_controls(each) for each in (opening, stance)
    )
    (state, turning), (trial, last) = ends_of(*curves)
    now, rates = progress(state, turning, modes, **more), (*trial[3:], *last)
    changes = None if changes is None else ModeEvents(*numbers(changes))
    there = onto_of(trial, **onto or {})
    found = by_landing_on_falls(walk_for(), now, trial, jnp.asarray(error), rates, there, changes)
    for told, kept in found:
        end = trial if kept else state
        np.testing.assert_array_equal(told.state, end)
        assert (float(told.arrival), int(told.footsteps)) == (
            float(now.arrival),
            int(now.footsteps),
        )
    return found


def outcome(told):
    names = "landing", "ending", "arrived"
    return {name for name in names if bool(getattr(told, name))}


@pytest.mark.parametrize(
    ("error", "factor"),
    [(1.0, 0.8), (0.5, 0.8 * 2**0.125), (1e-8, 5.0), (2.0, 0.8 / 2**0.125), (1e12, 0.2)],
)
def test_the_next_step_has_four_fifths_of_the_largest_that_the_error_allows(error, factor):
    """By the eighth root of the error, at most five times longer or shorter."""
    for told, kept in after(error=error):
        assert bool(kept) == (error <= 1.0)
        assert float(told.t) == pytest.approx(2.0 + STEP * (error <= 1.0))
        assert float(told.pace) == pytest.approx(factor * STEP)
        assert outcome(told) == set()
        assert (int(told.code), int(told.grazes)) == (0, 5)


@pytest.mark.parametrize(
    ("opening", "onto", "expected"),
    [
        (FALLS, {}, {"landing"}),
        (FALLS, dict(near=YES), {"arrived"}),
        (FALLS, dict(near=YES, counts=NO), {"landing"}),
        (FALLS, dict(near=YES, rest=0.11), {"landing"}),
        (FALLS, dict(near=YES, rest=0.09), {"arrived"}),
        (STANDS, dict(near=YES), {"arrived"}),
        (Polynomial([-0.1, 0.05]), dict(near=YES), set()),
        (TOUCHES, dict(near=YES), set()),
    ],
)
def test_a_strike_has_come_where_the_step_ends_beside_it_and_else_is_landed_on(
    opening, onto, expected
):
    for told, kept in after(opening, onto=onto, error=1e-8):
        assert bool(kept)
        assert outcome(told) == expected
        assert int(told.grazes) == 5 + (opening is TOUCHES)
        if opening is FALLS:
            assert float(told.step) == pytest.approx(-0.7 * STEP)
    for told, kept in after(opening, onto=onto, error=2.0):
        assert not bool(kept)
        assert outcome(told) == set()
        assert int(told.grazes) == 5


def test_a_step_that_is_too_long_to_tell_is_tried_again_at_half_its_length():
    for told, kept in after(DIPS, error=1e-8):
        assert not bool(kept)
        assert float(told.pace) == pytest.approx(0.5 * STEP)
    for told, _ in after(DIPS, error=1e12):
        assert float(told.pace) == pytest.approx(0.2 * STEP)


@pytest.mark.parametrize(
    ("footsteps", "strike", "kept"), [(1, 2.0, NO), (1, 1.99, YES), (0, 2.0, YES)]
)
def test_only_behind_a_strike_a_step_begins_on_the_section(footsteps, strike, kept):
    rises = Polynomial([1e-9, 0.3, -0.4])
    for told, keeps in after(rises, error=1e-8, footsteps=footsteps, arrival=strike):
        assert bool(keeps) == kept
        assert outcome(told) == ({"landing"} if kept else set())


@pytest.mark.parametrize(("side", "ending"), [(1.0, Ending.FELL_BACK), (-1.0, Ending.FELL_FORWARD)])
def test_a_fall_is_landed_on_or_its_time_is_interpolated(side, ending):
    (lands, kept), (ends, _) = after([3.0] * 6, side * TIPS, error=1e-8)
    assert bool(kept)
    assert outcome(lands) == {"landing", "ending"}
    assert int(lands.code) == 0
    share = [r.real for r in (of_controls(TIPS) - 1.0).roots() if 0.0 < r.real < 1.0 and not r.imag]
    assert float(lands.step) == pytest.approx(STEP * (share[0] - 1.0), abs=1e-6)
    assert float(lands.t) == pytest.approx(2.0 + STEP)
    assert outcome(ends) == set()
    assert int(ends.code) == int(ending)
    assert float(ends.t) == pytest.approx(2.0 + STEP * share[0], abs=1e-6)
    # One that has fallen already takes no step.
    for told, kept in after([3.0] * 6, [1.1 * side] * 6):
        assert not bool(kept)
        assert int(told.code) == int(ending)


@pytest.mark.parametrize(("step", "lost"), [(3e-15, YES), (5e-14, NO), (np.nan, YES)])
def test_a_step_that_time_does_not_feel_any_more_is_lost(step, lost):
    """Of a hundred trillionth of the time, here 2 s."""
    for told, _ in after(step=step):
        assert (int(told.code) == int(Ending.SOLVER_FAILED)) == lost
    for told, _ in after(step=step, t=0.02, due=0.1):
        assert (int(told.code) == int(Ending.SOLVER_FAILED)) == np.isnan(step)


NOTHING = (NO, 0, 1.0, NO, NO)
"""Of two surfaces: crosses, which, place, unclear, grazes."""


@pytest.mark.parametrize(
    ("opening", "due", "changes", "onto", "expected", "changing"),
    [
        (STANDS, 0, NOTHING, {}, set(), 0),
        (STANDS, 0, (YES, 1, 0.5, NO, NO), {}, {"landing"}, 2),
        (STANDS, 0, (YES, 0, 0.5, NO, NO), dict(near=YES), {"landing"}, 1),
        (STANDS, 2, NOTHING, {}, set(), 0),
        (STANDS, 2, NOTHING, dict(near=YES), {"changed"}, 2),
        (STANDS, 2, NOTHING, dict(near=YES, counts=NO), {"changed"}, 2),
        (STANDS, 2, NOTHING, dict(near=YES, rest=0.11), set(), 0),
        (STANDS, 2, NOTHING, dict(near=YES, rest=0.09), {"changed"}, 2),
        (STANDS, 2, (YES, 1, 0.5, NO, NO), dict(near=YES), {"changed"}, 2),
        (STANDS, 2, (YES, 1, 0.5, NO, NO), {}, {"landing"}, 2),
        (STANDS, 2, (YES, 0, 0.5, NO, NO), dict(near=YES), {"landing"}, 1),
        (STANDS, 2, (NO, 0, 1.0, NO, YES), dict(near=YES), set(), 0),
        (FALLS, 0, NOTHING, dict(near=YES), {"arrived"}, 0),
        (FALLS, 2, NOTHING, dict(near=YES), {"landing"}, 0),
        (FALLS, 0, (YES, 0, 0.2, NO, NO), dict(near=YES), {"landing"}, 1),
        (FALLS, 0, (YES, 0, 0.5, NO, NO), dict(near=YES), {"arrived"}, 0),
        (FALLS, 0, (YES, 0, 0.5, NO, NO), {}, {"landing"}, 0),
    ],
)
def test_a_change_of_mode_has_come_where_it_was_due_alone_and_else_is_landed_on(
    opening, due, changes, onto, expected, changing
):
    how = dict(modes=modes_of(due, behind=2), changes=changes, onto=onto)
    for told, kept in after(opening, error=1e-8, **how):
        assert bool(kept)
        changed = {"changed"} if told.modes.changed else set()
        assert outcome(told) | changed == expected
        assert int(told.modes.changing) == changing
        assert int(told.modes.behind) == 0
        np.testing.assert_allclose(told.modes.paces, [0.1, 5.0 * STEP, 0.3])
        assert int(told.grazes) == 5 + changes[4]
        if expected == {"landing"}:
            place = changes[2] if changing else 0.3
            assert float(told.step) == pytest.approx(STEP * (place - 1.0))
    for told, kept in after(opening, error=2.0, **how):
        assert not bool(kept)
        assert outcome(told) == set()
        assert not bool(told.modes.changed)
        assert (int(told.modes.changing), int(told.modes.behind)) == (0, 2)
        np.testing.assert_array_equal(told.modes.paces, [0.1, 0.2, 0.3])


def test_the_first_step_behind_an_event_is_the_longer_of_what_was_and_what_is_free():
    (told, _), _ = after(modes=modes_of(behind=1), changes=NOTHING, pace=0.9)
    np.testing.assert_allclose(told.modes.paces, [0.9, 0.2, 0.3])
    (told, _), _ = after(modes=modes_of(behind=3), changes=NOTHING, pace=0.2)
    np.testing.assert_allclose(told.modes.paces, [0.1, 0.2, 0.8 * STEP])
    (told, kept), _ = after(modes=modes_of(), changes=(NO, 0, 1.0, YES, NO), error=1e-8)
    assert not bool(kept)
    assert float(told.pace) == pytest.approx(0.5 * STEP)


def test_a_fall_behind_a_change_of_mode_ends_no_step():
    for place, code in ((0.1, 0), (0.99, int(Ending.FELL_BACK))):
        changes = YES, 0, place, NO, NO
        _, (told, _) = after([3.0] * 6, TIPS, error=1e-8, modes=modes_of(), changes=changes)
        assert int(told.code) == code
        assert bool(told.landing) == (code == 0)


def test_a_fall_in_the_same_step_is_landed_on_before_a_change_that_was_due():
    how = dict(modes=modes_of(2), changes=NOTHING, onto=dict(near=YES))
    (told, _), _ = after([3.0] * 6, TIPS, error=1e-8, **how)
    assert outcome(told) == {"landing", "ending"}
    assert not bool(told.modes.changed)
    assert int(told.modes.changing) == 0


@jax.jit
def landed(now, onto):
    return _landing(walk_for(), now, now.state, onto)


@pytest.mark.parametrize(
    ("now", "onto", "expected"),
    [
        (dict(), dict(near=NO), (2, NO, 0)),
        (dict(), dict(near=YES), (2, YES, 0)),
        (dict(), dict(near=YES, counts=NO), (0, NO, 0)),
        (dict(), dict(near=NO, counts=NO), (2, NO, 0)),
        (dict(landing=11), dict(near=NO), (12, NO, 0)),
        (dict(landing=12), dict(near=NO), (13, NO, int(Ending.SOLVER_FAILED))),
        (dict(landing=12), dict(near=YES), (13, YES, 0)),
        (dict(ending=YES), dict(near=NO), (2, NO, 0)),
        (dict(ending=YES), dict(near=YES), (2, NO, int(Ending.FELL_BACK))),
        (dict(ending=YES), dict(near=YES, counts=NO), (2, NO, int(Ending.FELL_BACK))),
    ],
)
@pytest.mark.parametrize("changing", [None, 0, 2])
def test_newtons_steps_onto_an_event_end_beside_it(now, onto, expected, changing):
    """At most twelve. Two legs that pass each other are no strike."""
    state = simplest_state(*STABLE)
    modes = None if changing is None else modes_of(changing)
    begin = progress(state, (jnp.zeros(()),) * 2, modes, step=-0.3, landing=1)._replace(
        **numbers(now)
    )
    there = onto_of(jax.tree.map(lambda leaf: leaf + 0.25, state), **onto)
    told = landed(begin, there)
    falls = int(told.code) in (int(Ending.FELL_BACK), int(Ending.FELL_FORWARD))
    landing, struck, code = expected
    if changing and not now.get("ending"):
        landing, struck = int(begin.landing) + 1, NO
    assert (int(told.landing), bool(told.arrived), int(told.code)) == (landing, struck, code)
    assert float(told.t) == pytest.approx(1.7 + 1e-5 * falls, abs=1e-12)
    np.testing.assert_array_equal(told.state, there.state if falls else state)
    assert float(told.step) == 1e-5
    if changing is not None:
        assert bool(told.modes.changed) == (changing == 2 and onto["near"])


def test_a_walker_that_leans_forward_lands_on_a_fall_forward():
    state = simplest_state(-1.0, 0.1)
    begin = progress(state, (jnp.zeros(()),) * 2, landing=1, ending=YES)
    assert int(landed(begin, onto_of(state, near=YES)).code) == int(Ending.FELL_FORWARD)


@pytest.mark.parametrize(
    ("before", "closing", "steady"),
    [
        (0.70101, -0.5, YES),
        (0.7005, -0.5, NO),
        (0.70061, 0.5, YES),
        (0.7005, -0.1, YES),
        (np.inf, -0.5, NO),
    ],
)
def test_the_next_strike_is_due_where_two_footsteps_lasted_alike(before, closing, steady):
    """In which the opening changes by less than √rtol / 5."""
    state = simplest_state(*STABLE)
    now = progress(state, (jnp.zeros(()),) * 2, t=2.2, arrival=1.5, period=before, landing=3)
    other = simplest_state(*np.negative(STABLE))
    told = _after_arrival(walk_for(), now, onto_of(state, rest=1e-3, closing=closing), other)
    assert float(told.t) == float(told.arrival) == 2.201
    assert float(told.period) == pytest.approx(0.701)
    assert float(told.due) == (pytest.approx(2.902) if steady else np.inf)
    assert (int(told.landing), int(told.footsteps)) == (0, 4)
    np.testing.assert_array_equal(told.state, other)


FLAT = rigid(HEEL_TOE)
BOTH = FLAT.state(theta_leg_1=-0.3)
"""A flat foot that stands."""
UNLOADED = "heel all but unloaded"
COMES = "toe all but down"


@pytest.fixture(scope="module")
def beside():
    """A heel whose load is 5e-7 of the weight, and a toe that falls from 6e-4 of the height."""
    least = 0.5e-3 * TOLERANT * float(FLAT.mechanism.total_mass * FLAT.ground.g)

    def turning(rate):
        return in_mode(FLAT, BOTH._replace(omega_leg_2=rate), (), (True, True))

    heavy, light = -2.0, -5.0
    while light < (middle := 0.5 * (heavy + light)) < heavy:
        load = float(loads_of_feet(FLAT, turning(middle))[0])
        heavy, light = (middle, light) if load > least else (heavy, middle)
    tipped = BOTH._replace(theta_foot_2=2e-3, omega_foot_2=-1.0)
    return {UNLOADED: turning(heavy), COMES: in_mode(FLAT, tipped, (), (True, False))}


@host_jit()
def after_change(walk, trial, onto, course):
    return _after_change(walk, trial, onto, course)


@host_jit()
def surfaces_of(scene, state):
    return ROLLING.course(scene, state)


def test_the_gaps_of_limits_alone_have_second_derivatives():
    """Flat feet have surfaces, and no limit."""
    course = surfaces_of(FLAT, in_mode(FLAT, BOTH, (), (True, True)))
    assert len(course.values) == len(course.rates) == len(course.live) > 0
    assert len(course.bends) == 0


@pytest.mark.parametrize(("arrived", "changed", "event"), [(NO, NO, 0), (YES, NO, 1), (NO, YES, 3)])
@pytest.mark.parametrize(("name", "stands"), [(UNLOADED, (NO, YES)), (COMES, (YES, YES))])
def test_a_change_of_mode_is_noted_with_its_time_and_its_first_step(
    beside, name, stands, arrived, changed, event
):
    """Of the second surface; where the other end of the foot stands the hip stays in its place."""
    at = jax.tree.map(jnp.asarray, beside[name])
    surfaces = jax.tree.map(jnp.zeros_like, surfaces_of(FLAT, at))
    modes = ModeProgress(
        surfaces, 2, changed, 1, jnp.array([1.7, 1.9, 0.0, 0.0]), 0.1 * jnp.arange(1.0, 6.0), 1
    )
    elsewhere = at._replace(hip_x=at.hip_x + 0.25)
    trial = progress(elsewhere, (), modes, landing=4, arrived=arrived, pace=0.7)
    how = 2.5, 4.0, TOLERANT, 100.0
    walk, there = Landing(ROLLING, FLAT, at, *map(jnp.asarray, how)), onto_of(at, rest=1e-3)
    told = after_change(walk, trial, there, surfaces)
    assert float(told.t) == pytest.approx(2.001 if changed else 2.0)
    if changed:
        assert tuple(mode_of(FLAT, told.state)[0]) == stands
        places = [float(ROLLING.completed(FLAT, each)[0]) for each in (told.state, at)]
        assert places[0] == pytest.approx(places[1], abs=1e-15)
    else:
        np.testing.assert_array_equal(told.state, elsewhere)
    assert int(told.landing) == (0 if changed else 4)
    assert float(told.pace) == pytest.approx([0.7, 0.1, 0.2, 0.3][event])
    after = told.modes
    assert int(after.changing) == (0 if changed else 2)
    assert int(after.behind) == (event or 1)
    np.testing.assert_allclose(after.times, [1.7, 2.001 if changed else 1.9, 0.0, 0.0])
    seen = surfaces_of(FLAT, told.state) if event else surfaces
    np.testing.assert_allclose(after.course.values, seen.values, rtol=1e-12)
    np.testing.assert_allclose(after.course.rates, seen.rates, rtol=1e-12)
    unknown = trial._replace(modes=trial.modes._replace(paces=jnp.zeros(5)))
    told = after_change(walk, unknown, there, surfaces)
    assert float(told.pace) == 0.7


next_step = jax.jit(with_next_step)


@pytest.mark.parametrize(
    ("due", "pace", "landing", "step"),
    [
        (2.05, 0.11, 0, 0.05),
        (2.12, 0.11, 0, 0.12),
        (2.14, 0.11, 0, 0.11),
        (np.inf, 0.11, 0, 0.11),
        (2.0 + 1e-7, 0.11, 0, 0.11),
        (1.95, 0.11, 0, 0.11),
        (np.inf, 0.7, 0, 0.5),
        (2.05, 0.11, 3, STEP),
    ],
)
def test_a_step_ends_where_a_strike_is_due_or_the_walk_ends(due, pace, landing, step):
    """Up to 15 % longer than free ones. A landing has its own step."""
    state = simplest_state(*STABLE)
    now = progress(state, (jnp.zeros(()),) * 2, due=due, pace=pace, landing=landing)
    told = next_step(walk_for(), now)
    assert float(told.step) == pytest.approx(step)
    assert told._replace(step=now.step) == now


@pytest.mark.parametrize(
    ("met", "due", "landing", "step", "changing"),
    [
        ((1.17, 1.15), 2.09, 0, 0.05, 2),
        ((1.15, 1.17), 2.09, 0, 0.05, 1),
        ((1.15, 1.17), 2.04, 0, 0.04, 0),
        ((1.15, 1.17), np.inf, 0, 0.11, 0),
        ((1.0, 1.05), 2.09, 0, 0.09, 0),
        ((1.1, 1.17), 2.09, 0, 0.07, 2),
        ((1.3, 1.4), 2.4, 0, 0.11, 0),
        ((-np.inf, -np.inf), 2.09, 0, 0.09, 0),
        ((1.15, 1.17), 2.09, 2, STEP, 1),
    ],
)
def test_a_mode_changes_as_long_behind_a_strike_as_before(met, due, landing, step, changing):
    state = simplest_state(*STABLE)
    modes = modes_of(1, times=met)
    now = progress(state, (jnp.zeros(()),) * 2, modes, due=due, landing=landing)
    told = next_step(walk_for(), now)
    assert float(told.step) == pytest.approx(step)
    assert int(told.modes.changing) == changing


def test_a_walk_begins_with_a_short_step_and_nothing_behind_it():
    """0.03 √(l/g), here 0.03 s."""
    state = simplest_state(*STABLE)._replace(hip_x=jnp.asarray(0.4))
    for duration, step in ((2.5, 0.03), (0.01, 0.01)):
        walk = walk_for(duration, state=state)
        told = initial_progress(walk)
        assert float(told.step) == float(told.pace) == pytest.approx(step)
        assert [float(each) for each in (told.t, told.arrival, told.period, told.due)] == [
            0.0, 0.0, np.inf, np.inf,
        ]  # fmt: skip
        whole = told.landing, told.footsteps, told.grazes, told.pulls, told.accepted, told.rejected
        assert [int(each) for each in (*whole, told.code, told.ending, told.arrived)] == [0] * 9
        np.testing.assert_allclose(told.accelerations, rolling_rates(walk.scene, state))
        assert told.modes is None
        # The root point is on a leg of length 1 that leans by the angle, above the standing foot.
        assert float(told.state[0]) == pytest.approx(0.4 + np.sin(STABLE[0]))
        np.testing.assert_array_equal(told.state[1:], state[1:])


@pytest.mark.parametrize(
    ("footsteps", "code", "waits", "expected"),
    [
        (3, 0, YES, int(Ending.TIMED_OUT)),
        (4, 0, YES, 0),
        (3, 0, NO, 0),
        (3, int(Ending.FELL_BACK), YES, int(Ending.FELL_BACK)),
    ],
)
def test_a_walk_that_waited_for_footsteps_timed_out(footsteps, code, waits, expected):
    now = progress(simplest_state(*STABLE), (), footsteps=footsteps, code=code)
    assert int(ending_of(walk_for(), now, jnp.asarray(waits))) == expected
