"""What a variational solve ends with, against a fall whose arrival is known in closed form."""

from types import SimpleNamespace

import diffrax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import jaxbiped as jb
from jaxbiped import Ending
from jaxbiped.dynamics import vector_field
from jaxbiped.hybrid import switches
from jaxbiped.hybrid._endings import ending_code
from jaxbiped.solve._watch import Watch
from jaxbiped.solve.solvers import Rodas4, Rodas5P
from jaxbiped.variational._solve_to_section import (
    SectionArrival,
    _code,
    arrival_at,
    onto_section,
    peak_of,
)
from jaxbiped.variational._tangents import (
    Seeded,
    Tangents,
    VariationalSolution,
    along_columns,
    along_columns_in_turn,
)
from jaxbiped.variational._variational_program import AdaptiveColumns
from jaxbiped.variational._variational_solve import (
    motion_solve,
    seeded_directions,
    solve_variational,
)

G, HEIGHT, SPEED, SIZE = 9.8, 0.7, 0.4, 0.5
"""Gravity, height and speed at the start; and by how much a column moves gravity."""
YES, NO = jnp.asarray(True), jnp.asarray(False)


def load(args, y):
    """It is largest on the way down, where twice height times speed is a tenth of gravity."""
    return 2.0 + 0.1 * y[1] - y[0] * y[0]


def watch_of(**more):
    """A ball that falls onto the level of its second argument."""
    return Watch(
        field=lambda t, y, args: (y[1], -args[0]),
        switches=lambda args, y: (),
        section=lambda args, y: (args[1] - y[0], YES),
        **more,
    )


def at(time, g=G, height=HEIGHT, speed=SPEED):
    return np.array([height + speed * time - 0.5 * g * time**2, speed - g * time])


def columns_at(time):
    """Derivatives with respect to the start's height and speed and to gravity, shape (2, 3)."""
    return np.array([[1.0, time, -0.5 * SIZE * time**2], [0.0, 1.0, -SIZE * time]])


LANDS = (SPEED + np.sqrt(SPEED**2 + 2.0 * G * HEIGHT)) / G
ARGS = Seeded((jnp.asarray(G), jnp.asarray(0.0)), jnp.array([[0.0, 0.0, SIZE]]), jnp.zeros(3), (0,))
BEHIND = LANDS + 1e-4


def tangents(time):
    return Tangents(tuple(map(jnp.asarray, at(time))), jnp.asarray(columns_at(time)))


def landing_columns():
    """The time's derivatives, by the rate on the ground, and the state's."""
    still, speed = columns_at(LANDS), at(LANDS)[1]
    by_time = -still[0] / speed
    return by_time, still + np.outer([speed, -G], by_time)


def test_a_state_just_past_the_section_is_taken_back_onto_it():
    state, past = arrival_at(watch_of(), tangents(BEHIND).state, ARGS.args)
    np.testing.assert_allclose(state, [0.0, at(LANDS)[1]], atol=1e-14)
    assert float(past) == pytest.approx(1e-4, abs=1e-14)
    (height, _), time, none = onto_section(
        watch_of(), tangents(BEHIND).state, jnp.asarray(BEHIND), ARGS.args
    )
    assert float(time) == pytest.approx(LANDS, abs=1e-14)
    assert abs(float(height)) < 1e-14
    assert none is None


@pytest.mark.parametrize("along", [along_columns, along_columns_in_turn])
def test_derivatives_follow_the_arrival(along):
    by_time, columns = landing_columns()
    now = tangents(BEHIND), jnp.asarray(BEHIND), ARGS
    y, time, time_columns = onto_section(watch_of(), *now, along)
    assert float(time) == pytest.approx(LANDS, abs=1e-14)
    np.testing.assert_allclose(y.state, [0.0, at(LANDS)[1]], atol=1e-14)
    np.testing.assert_allclose(time_columns, by_time, rtol=1e-9)
    np.testing.assert_allclose(y.columns, columns, rtol=1e-9, atol=1e-10)


def peak_time(*start):
    found = minimize_scalar(
        lambda t: -load(None, at(t, *start)), bounds=(0.2, LANDS), options={"xatol": 1e-12}
    )
    return found.x


def peak_and_columns():
    """By the envelope: only what is explicit changes the largest value."""
    time = peak_time(G, HEIGHT, SPEED)
    height, _ = at(time)
    slope = np.array([-2.0 * height, 0.1])
    return time, load(None, at(time)), slope @ columns_at(time)


@pytest.mark.parametrize("along", [along_columns, along_columns_in_turn])
@pytest.mark.parametrize("late", [1e-4, -1e-4])
def test_the_largest_load_is_that_between_two_steps(along, late):
    time, highest, by = peak_and_columns()
    assert 0.25 < time < LANDS - 0.01
    value, columns = peak_of(watch_of(peak=load), tangents(time + late), ARGS, along)
    assert float(value) == pytest.approx(highest, abs=1e-9)
    np.testing.assert_allclose(columns, by, atol=2e-6)
    none, zeros = peak_of(watch_of(), tangents(time), ARGS, along)
    assert float(none) == 0.0
    np.testing.assert_array_equal(zeros, np.zeros(3))


def test_where_a_load_has_no_maximum_it_is_taken_as_it_is():
    rises = watch_of(peak=lambda args, y: y[0] * y[0])
    value, columns = peak_of(rises, tangents(LANDS), ARGS)
    assert float(value) == pytest.approx(0.0, abs=1e-20)
    np.testing.assert_allclose(columns, np.zeros(3), atol=1e-12)


def ending_of(result, code=0, arrived=NO):
    landed = SimpleNamespace(code=jnp.asarray(code), arrived=arrived)
    return int(_code(SimpleNamespace(result=result), landed))


def test_the_code_of_a_solve_through_diffrax():
    results = diffrax.RESULTS
    assert ending_of(results.successful) == int(Ending.TIMED_OUT)
    assert ending_of(results.max_steps_reached) == int(Ending.OUT_OF_STEPS)
    assert ending_of(results.dt_min_reached) == int(Ending.SOLVER_FAILED)
    for result in (results.successful, results.max_steps_reached):
        assert ending_of(result, int(Ending.STUMBLED)) == int(Ending.STUMBLED)
        assert ending_of(result, int(Ending.STUMBLED), YES) == 0
        assert ending_of(result, 0, YES) == 0


@pytest.mark.parametrize("kind", [SectionArrival, VariationalSolution])
@pytest.mark.parametrize(
    ("grazes", "code", "undetermined"),
    [
        (0, 0, False), (1, 0, True), (0, Ending.TIMED_OUT, False), (0, Ending.FELL_BACK, False),
        (0, Ending.OUT_OF_STEPS, True), (0, Ending.SOLVER_FAILED, True), (2, Ending.STUMBLED, True),
    ],
)  # fmt: skip
def test_derivatives_are_not_to_be_had_behind_a_graze_or_without_an_end(
    kind, grazes, code, undetermined
):
    told = dict.fromkeys(kind._fields) | dict(
        grazes=jnp.asarray(grazes), code=jnp.asarray(int(code))
    )
    assert bool(kind(**told).undetermined) == undetermined


def problem(carries=1.0, max_time=9.0):
    """Two columns of the state and one of gravity, on the way to `finish`."""
    return SimpleNamespace(
        args=ARGS.args, state=tangents(0.0).state,
        by_state=jnp.eye(2), by_parameter=jnp.zeros((1, 2)),
        sizes=jnp.array([SIZE]), carries_parameters=jnp.asarray(carries),
        state_floors=jnp.zeros(2), parameter_floors=jnp.zeros(1), max_time=jnp.asarray(max_time),
    )  # fmt: skip


def finished(watch, now, **how):
    columns = AdaptiveColumns(Rodas4(), watch, (0,), save_nodes=False)
    return columns.finish(problem(**how), now)


def met_at(time, shifts):
    """Columns where a switch was met later by these shifts, of state and parameters."""
    rates = np.array([at(time)[1], -G])
    met = columns_at(time) + np.outer(rates, shifts)
    parts = (met.T[:2], met.T[2:]), (np.array(shifts[:2]), np.array(shifts[2:]))
    return [tuple(map(jnp.asarray, part)) for part in parts]


def now_at(time, peak=0.2, code=0, arrived=YES, lost=NO, jumps_at_peak=NO, shifts=(0.3, -0.2, 0.7)):
    landed = SimpleNamespace(
        code=jnp.asarray(code), arrived=arrived, accepted=5, jumps=2, grazes=1,
        at_peak=tangents(peak).state, jumps_at_peak=jumps_at_peak,
    )  # fmt: skip
    columns, later = met_at(time, shifts)
    peaks, peak_later = met_at(peak, np.negative(shifts))
    return SimpleNamespace(
        resets=None,
        t=jnp.asarray(time), state=tangents(time).state, columns=columns, shifts=later,
        landed=landed, peak_columns=peaks, peak_shifts=peak_later, attempted=8, lost=lost,
    )  # fmt: skip


def test_a_program_finishes_on_the_section_with_columns_at_a_fixed_time():
    by_time, columns = landing_columns()
    peak, highest, by_peak = peak_and_columns()
    told = finished(watch_of(peak=load), now_at(BEHIND, peak))
    assert float(told.t) == pytest.approx(LANDS, abs=1e-13)
    np.testing.assert_allclose(told.reached, [0.0, at(LANDS)[1]], atol=1e-13)
    np.testing.assert_allclose(told.state, told.reached)
    np.testing.assert_allclose(told.time_columns, by_time, rtol=1e-9)
    np.testing.assert_allclose(told.columns, columns.T, rtol=1e-9, atol=1e-10)
    assert float(told.peak) == pytest.approx(highest)
    np.testing.assert_allclose(told.peak_columns, by_peak, atol=1e-5)
    counts = told.code, told.attempted, told.accepted, told.jumps, told.grazes
    assert [int(each) for each in counts] == [0, 8, 5, 2, 1]


def test_columns_of_parameters_that_are_not_carried_are_not_known():
    told = finished(watch_of(), now_at(BEHIND, jumps_at_peak=YES), carries=0.0)
    assert np.isnan(told.columns).tolist() == [[False] * 2, [False] * 2, [True] * 2]
    assert np.isnan(told.time_columns).tolist() == [False, False, True]
    assert float(told.peak) == 0.0
    np.testing.assert_array_equal(told.peak_columns, np.zeros(3))


def test_behind_a_jump_the_largest_load_has_no_derivatives():
    time, highest, _ = peak_and_columns()
    told = finished(watch_of(peak=load), now_at(BEHIND, time, jumps_at_peak=YES))
    assert float(told.peak) == pytest.approx(highest, abs=1e-9)
    assert np.all(np.isnan(told.peak_columns))


def test_a_load_that_is_largest_at_the_arrival_is_that_on_the_section():
    _, columns = landing_columns()
    told = finished(watch_of(peak=lambda args, y: -y[1]), now_at(BEHIND, jumps_at_peak=YES))
    assert float(told.peak) == pytest.approx(-at(LANDS)[1], abs=1e-12)
    np.testing.assert_allclose(told.peak_columns, -columns[1], rtol=1e-9, atol=1e-10)


def test_a_load_that_is_largest_at_the_start_is_the_starts():
    """Where it falls from there, faster and faster, as beyond a maximum before it."""
    time, *_ = peak_and_columns()
    late = tangents(time + 0.02)
    value, columns = peak_of(watch_of(peak=load), late, ARGS, start=late.state)
    assert float(value) == float(load(None, late.state))
    np.testing.assert_allclose(columns, along_columns(lambda y, a: load(a, y), late, ARGS)[1])


def test_an_arrival_makes_another_state_and_its_columns():
    def bounced(args, y):
        return y[0], -args[0] * y[1]

    told = finished(watch_of(arrival=bounced), now_at(BEHIND))
    _, columns = landing_columns()
    speed = at(LANDS)[1]
    np.testing.assert_allclose(told.reached, [0.0, speed], atol=1e-13)
    np.testing.assert_allclose(told.state, [0.0, -G * speed], atol=1e-13)
    expected = -G * columns[1] - speed * np.array([0.0, 0.0, SIZE])
    np.testing.assert_allclose(told.columns[:, 1], expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("how", "max_time", "code"),
    [
        (dict(), 9.0, int(Ending.OUT_OF_STEPS)),
        (dict(), BEHIND, int(Ending.TIMED_OUT)),
        (dict(lost=YES), BEHIND, int(Ending.SOLVER_FAILED)),
        (dict(code=int(Ending.FELL_BACK), lost=YES), BEHIND, int(Ending.FELL_BACK)),
        (dict(code=int(Ending.FELL_BACK), arrived=YES), 9.0, 0),
    ],
)
def test_the_code_of_a_program(how, max_time, code):
    """Without a section the state stays where it ended."""
    level = Watch(field=watch_of().field, switches=lambda args, y: ())
    told = finished(level, now_at(BEHIND, **dict(arrived=NO) | how), max_time=max_time)
    assert int(told.code) == code
    assert float(told.t) == BEHIND
    np.testing.assert_array_equal(told.state, tangents(BEHIND).state)
    np.testing.assert_allclose(told.columns, columns_at(BEHIND).T, rtol=1e-12, atol=1e-15)
    np.testing.assert_array_equal(told.time_columns, np.zeros(3))


@pytest.mark.slow
def test_columns_that_a_graze_left_undetermined_cost_no_steps():
    scene, start = jb.seed_scene(), jb.seed_state()
    watch = Watch(field=vector_field, switches=switches)
    how = motion_solve(watch, Rodas5P(), 1e-6)._replace(max_time=0.3)
    at, seeded = seeded_directions(scene, start, (2, 5), ())

    def followed(columns):
        found, _ = solve_variational(how, at._replace(columns=columns), seeded, jnp.zeros(0))
        return found

    plain, lost = followed(at.columns), followed(at.columns.at[:, 0].set(jnp.nan))
    assert abs(int(lost.attempted) - int(plain.attempted)) < 0.5 * int(plain.attempted)
    assert np.isnan(lost.columns[0]).all()
    np.testing.assert_allclose(lost.columns[1], plain.columns[1], rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(lost.state, plain.state, atol=1e-6)


def test_codes_put_failures_before_what_only_ran_out():
    code = lambda events, **flags: int(
        ending_code(events, **dict(done=NO, out_of_steps=NO, timed_out=NO) | flags)
    )
    assert code({}) == Ending.SOLVER_FAILED
    assert code({}, done=YES) == Ending.WALKING
    assert code({}, out_of_steps=YES) == Ending.OUT_OF_STEPS
    assert code({}, timed_out=YES, out_of_steps=YES) == Ending.TIMED_OUT
    assert code({Ending.STUMBLED: YES, Ending.STOPPED: NO}, done=YES) == Ending.STUMBLED
