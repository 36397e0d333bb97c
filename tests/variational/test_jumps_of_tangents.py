"""Jumps of tangents at a switch, against a motion of two constant forces that is known exactly."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import jaxbiped as jb
from jaxbiped.hybrid import Gap, RedundantWalking, Rolling, Switch, Walking
from jaxbiped.solve._watch import Watch
from jaxbiped.solve.controllers._grazing import grazes, turns_of
from jaxbiped.solve.controllers._step_size import step_control
from jaxbiped.solve.controllers._switch_locator import MARGIN, SwitchLocator
from jaxbiped.solve.controllers._wrapped_control import Adapted, Attempt
from jaxbiped.solve.solvers import rms_norm
from jaxbiped.variational._collocated_step import RADAU, KnownStep
from jaxbiped.variational._flow import (
    SIDES,
    Flow,
    after_reset,
    jump_of,
    on_section,
    sides_of,
    tangent_on_section,
)
from jaxbiped.variational._saltation import at_fixed_time, meet, meeting_at, saltation_at
from jaxbiped.variational._solve_to_section import (
    TangentControl,
    TangentSolver,
    VariationalField,
    _nodes,
    worst_norm,
)
from jaxbiped.variational._tangents import Seeded, Tangents
from tests.systems import Plain

BEFORE, AFTER = -9.8, 14.0
"""Accelerations above the level and below [m/s²]."""


def field(t, y, args):
    (level,) = args
    return y[1], jnp.where(y[0] > level, BEFORE, AFTER)


def switches(args, y):
    """The level; and a speed at which another force would come on."""
    return (
        Switch(y[0] - args[0], True, force_jumps=True),
        Switch(y[1] + 2.0, True, force_jumps=True),
        Switch(y[0] + y[1], True),
    )


WATCH = Watch(field=field, switches=switches)


def seeded(columns):
    return Seeded((jnp.asarray(0.5),), jnp.asarray([[0.0, 0.0, 1.0]][:columns]), jnp.zeros(3), (0,))


def exact(y, v, level, time):
    """Height and speed so long after a start above the level."""
    speed = -jnp.sqrt(v * v + 2.0 * BEFORE * (level - y))
    fall = (speed - v) / BEFORE
    rest = time - fall
    return jnp.stack([level + speed * rest + 0.5 * AFTER * rest**2, speed + AFTER * rest])


def saltation(watch, y, v, happens=True):
    """At a height and a speed."""
    at = jax.jit(lambda y, happens: saltation_at(watch, y, seeded(3), happens))
    return at((jnp.asarray(y), jnp.asarray(v)), happens)


def test_saltation_is_the_change_of_the_field_over_the_rate_of_crossing():
    at = 0.5 - 1e-12, -3.0
    found = saltation(WATCH, *at)
    np.testing.assert_allclose(found.change, [0.0, (AFTER - BEFORE) / -3.0], atol=1e-9)
    np.testing.assert_array_equal(saltation(WATCH, *at, False).change, [0.0, 0.0])
    np.testing.assert_array_equal(found.by_state, [1.0, 0.0])
    np.testing.assert_array_equal(found.by_parameter, [-1.0])
    np.testing.assert_array_equal(found.which, [True, False, False])


def test_of_two_switches_it_is_the_one_that_was_passed_last():
    def watch(args, y):
        return (*switches(args, y)[:2], Switch(y[1] + 3.0 - 1e-6, True, force_jumps=True))

    other = Watch(field=field, switches=watch)
    # The level was passed a millionth of a second ago, the speed of −3 a ten-millionth of that.
    found = saltation(other, 0.5 - 3e-6, -3.0 + 1e-6 + 1e-12)
    np.testing.assert_array_equal(found.which, [False, False, True])
    np.testing.assert_array_equal(found.by_state, [0.0, 1.0])


@pytest.mark.parametrize("delays", [(1e-6, 1e-8, 1e-10), (1e-8, 1e-10, 1e-6), (1e-10, 1e-6, 1e-8)])
def test_of_three_switches_it_is_the_one_that_was_passed_last(delays):
    """In whatever order they are listed; the motion falls at 3 m/s."""
    levels = [3.0 * delay for delay in delays]
    watch = Watch(
        field=field,
        switches=lambda args, y: tuple(
            Switch(y[0] - args[0] - above, True, force_jumps=True) for above in levels
        ),
    )
    found = saltation(watch, 0.5, -3.0)
    np.testing.assert_array_equal(found.which, np.array(delays) == 1e-10)


def test_across_a_speed_the_rate_of_crossing_is_the_one_before():
    """Friction that comes on at −2 m/s: the speed falls by 9.8 m/s² before and by 4.8 behind."""
    watch = Watch(
        field=lambda t, y, args: (y[1], jnp.where(y[1] > -2.0, -9.8, -4.8)),
        switches=lambda args, y: (Switch(y[1] + 2.0, True, force_jumps=True),),
    )
    found = saltation(watch, 1.0, -2.0 - 1e-12)
    np.testing.assert_allclose(found.change, [0.0, 5.0 / -9.8], atol=1e-9)


@pytest.mark.parametrize(
    ("levels", "corner", "which"),
    [((0.25, 0.625), None, 2), ((0.625, 0.25), None, 1), ((0.625, 0.25), 0.875, 1)],
)
def test_of_the_switches_within_a_step_the_first_one_ends_it(levels, corner, which):
    """From 1 to 0 in a second, at constant speed; tangents jump there, whatever comes before."""
    every = [(level, False) for level in levels] + [(corner, True)] * (corner is not None)
    first = 1.0 - max(level for level, _ in every)
    watch = Watch(
        field=lambda t, y, args: (-1.0 + 0.0 * y[0],),
        switches=lambda args, y: tuple(Switch(y[0] - at, True, corner=c) for at, c in every),
        section=lambda args, y: (0.1 - y[0], jnp.asarray(True)),
    )
    locator = SwitchLocator(step_control(1e-6, 1e-8, rms_norm), watch)
    ends = (jnp.asarray(1.0),), (jnp.asarray(0.0),)

    @jax.jit
    def told(before, after):
        zero, one = jnp.zeros(()), jnp.ones(())
        begun = locator.init(None, zero, one, before, one, (), None, 4.0)[1]
        later = begun._replace(accepted=jnp.asarray(1))
        return [locator._crossings(one, (), before, after, each) for each in (begun, later)]

    (crossed, part, field_part), (arrives, *_) = told(*ends)
    assert (float(part), float(field_part)) == pytest.approx((first, 0.375))
    assert (int(crossed.which), bool(crossed.field)) == (which, True)
    assert bool(crossed.any)
    assert bool(crossed.switch)
    # The first step of a solve is no arrival.
    assert (bool(crossed.section), bool(arrives.section)) == (False, True)


@pytest.mark.parametrize("before", [True, False])
def test_an_arrival_counts_by_the_condition_of_the_section_itself(before):
    """It is asked at the step's start or at its end; the switch counts where the section does not.

    The second component says so: it is positive at one end of the step.
    """
    watch = Watch(
        field=lambda t, y, args: (-1.0 + 0.0 * y[0], 0.0 * y[0]),
        switches=lambda args, y: (Switch(y[0] - 0.5, y[1] < 0.0),),
        section=lambda args, y: (0.1 - y[0], y[1] > 0.0),
        asked_before=before,
    )
    locator = SwitchLocator(step_control(1e-6, 1e-8, rms_norm), watch)
    zero, one = jnp.zeros(()), jnp.ones(())

    @jax.jit
    def arrives(at_start):
        start, end = (one, at_start), (zero, -at_start)
        memory = locator.init(None, zero, one, start, one, (), None, 4.0)[1]
        later = memory._replace(accepted=jnp.asarray(1))
        return locator._crossings(one, (), start, end, later)[0].section

    assert (bool(arrives(one)), bool(arrives(-one))) == (before, not before)


@pytest.mark.parametrize("kind", ["section", "corner"])
def test_a_step_ends_so_little_past_a_surface_or_is_tried_again(kind):
    """By a 10,000th of the way there, or by some margins, which are of the watch's own unit."""
    ends_at_zero = dict(
        section={"switches": lambda args, y: (), "section": lambda args, y: (-y[0], y[0] < 9.0)},
        corner={"switches": lambda args, y: (Switch(y[0], True, corner=True),)},
    )
    unit = 2.0
    margin = MARGIN * unit
    fall = lambda t, y, args: (-1.0 + 0.0 * y[0],)
    watch = Watch(field=fall, time_unit=unit, **ends_at_zero[kind])
    locator = SwitchLocator(step_control(1e-6, 1e-8, rms_norm), watch)
    zero = jnp.zeros(())

    @jax.jit
    def stepped(way, past):
        start, end, span = (way,), (-past,), way + past
        memory = locator.init(None, zero, span, start, zero, (), None, 4.0)[1]
        later = memory._replace(accepted=jnp.asarray(1))
        adapted = locator.adapt(Attempt(zero, span, start, end, (), (zero,), 4.0, later))
        return adapted.keep, adapted.t0, adapted.t1

    for way, past, kept in (
        (1.0, 0.9e-4, True), (1.0, 1.1e-4, False), (1.0, 1.0, False),
        (1e-9, 3.0 * margin, True), (1e-9, 5.0 * margin, False),
    ):  # fmt: skip
        keep, begin, end = stepped(jnp.asarray(way), jnp.asarray(past))
        assert bool(keep) is kept
        if not kept:
            assert float(begin) == 0.0
            assert 0.0 < float(end) - way <= 1e-4 * way + margin


@pytest.mark.parametrize("share", [0.65, 0.9])
def test_a_step_across_a_switch_tells_how_long_before_its_end_that_was(share):
    """So short that it is kept: 10 ps, at 1 m/s through a level."""
    watch = Watch(
        field=lambda t, y, args: (-1.0 + 0.0 * y[0],),
        switches=lambda args, y: (Switch(y[0], True, force_jumps=True),),
    )
    locator = SwitchLocator(step_control(1e-6, 1e-8, rms_norm), watch)
    zero, span = jnp.zeros(()), 1e-11

    @jax.jit
    def stepped(part):
        before, after = (part * span,), ((part - 1.0) * span,)
        memory = locator.init(None, zero, zero + span, before, zero, (), None, 4.0)[1]
        attempt = Attempt(zero, zero + span, before, after, (), (zero,), 4.0, memory)
        adapted = locator.adapt(attempt)
        return adapted.keep, adapted.memory.crossed_field, adapted.memory.past

    keep, which, past = stepped(jnp.asarray(share))
    assert (bool(keep), int(which)) == (True, 1)
    assert float(past) == pytest.approx((1.0 - share) * span, rel=1e-6)


def test_a_step_behind_a_jump_carries_the_columns_of_the_exact_motion():
    """State and columns, with respect to the start and to the level itself."""
    start, level = jnp.array([1.0, -0.5]), 0.5
    fall = float((-jnp.sqrt(0.25 - 2.0 * BEFORE * 0.5) + 0.5) / BEFORE)
    speed = -0.5 + BEFORE * fall
    before = np.array([[1.0, fall, 0.0], [0.0, 1.0, 0.0]])
    y0 = Tangents((jnp.asarray(level - 1e-13), jnp.asarray(speed)), jnp.asarray(before))
    solver = TangentSolver(WATCH, jb.solvers.Rodas4())
    term = diffrax.ODETerm(VariationalField(field))
    step = jax.jit(lambda y: solver.step(term, 0.0, 0.01, y, seeded(3), None, jnp.asarray(True))[0])
    ours = step(y0)
    slopes = jax.jacfwd(exact, argnums=(0, 1, 2))(start[0], start[1], level, fall + 0.01)
    np.testing.assert_allclose(ours.columns, np.stack(slopes, axis=1), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(ours.state, exact(*start, level, fall + 0.01), rtol=1e-9)


def test_columns_of_a_step_are_its_derivatives():
    """Against JAX's own of the step alone: of a pendulum that is damped by what it has heated.

    One rate is a component; two are not, and the first one of the state is among these.
    """

    def heated(t, y, args):
        heat, speed, angle = y
        (pull,) = args
        return speed**2 - pull * heat, -pull * jnp.sin(angle) - heat * speed, speed

    solver, span = jb.solvers.Rodas4(), 0.2
    start, pull = (jnp.asarray(0.3), jnp.asarray(-1.2), jnp.asarray(0.8)), jnp.asarray(0.5)
    watch = Watch(field=heated, switches=lambda args, y: ())

    @jax.jit
    def by_columns(start):
        args = Seeded((pull,), jnp.asarray([[0.0, 0.0, 0.0, 1.0]]), jnp.zeros(4), (0,))
        y0, made_jump = Tangents(start, jnp.eye(3, 4)), jnp.asarray(False)
        term = diffrax.ODETerm(VariationalField(heated))
        return TangentSolver(watch, solver).step(term, 0.0, span, y0, args, None, made_jump)[:2]

    @jax.jit
    @jax.jacfwd
    def derivatives(z):
        *y, pull = z
        ends = solver.step(diffrax.ODETerm(heated), 0.0, span, tuple(y), (pull,), None, False)[:2]
        return jnp.stack([jnp.stack(part) for part in ends])

    end, error = derivatives(jnp.stack([*start, pull]))
    tangents, errors = by_columns(start)
    np.testing.assert_allclose(tangents.columns, end, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(errors.columns, error, rtol=1e-9, atol=1e-14)
    assert np.min(np.abs(end)) > 1e-3


@pytest.mark.parametrize(("height", "moves"), [(1e-11, False), (1e-9, True)])
def test_the_short_step_across_a_switch_moves_no_column(height, moves):
    """At 3 m/s downwards for 10 ps: behind the level saltation is all that counts."""
    columns = jnp.array([[1.0, 0.3, 0.0], [0.0, 1.0, 0.0]])
    y0 = Tangents((jnp.asarray(0.5 + height), jnp.asarray(-3.0)), columns)
    solver = TangentSolver(WATCH, jb.solvers.Rodas4())
    term = diffrax.ODETerm(VariationalField(field))
    step = jax.jit(lambda y: solver.step(term, 0.0, 1e-11, y, seeded(3), None, jnp.asarray(False)))
    new, error, *_ = step(y0)
    assert float(new.state[0]) == pytest.approx(0.5 + height - 3e-11, abs=1e-15)
    assert np.array_equal(new.columns, columns) is not moves
    assert moves or not np.any(error.columns)


def _beside_a_switch(power):
    """A Jacobian whose first entry goes as this power of the time since a switch, the others not.

    The last one is rounding.
    """
    times = np.abs(SIDES)
    first = np.where(np.asarray(SIDES) > 0.0, 3e4 + 2.0 * (1e11 * times) ** power * 1e4, 0.0)
    noise = 1e-12 * np.array([1.0, -3.0, 2.0, 2.0, -5.0, 1.0])
    return np.stack([first, 0.0 * times + 7.0, noise], axis=1)[:, None]


@pytest.mark.parametrize("power", [0.5, 1.0])
def test_a_jump_of_the_jacobian_is_its_value_at_the_switch(power):
    jump = np.asarray(jump_of(jnp.asarray(_beside_a_switch(power))))[0]
    np.testing.assert_allclose(jump, [3e4, 0.0, 0.0], rtol=1e-12, atol=1e-10)


@pytest.mark.parametrize("power", [-0.75, -0.5, -0.25])
def test_a_jacobian_without_bound_at_a_switch_has_no_jump(power):
    assert np.all(np.isnan(jump_of(jnp.asarray(_beside_a_switch(power)))))


class Braking(Plain):
    """x' = v, v' = −a sin(v/v0), for v above v0 −a sin 1: a corner of friction under a load."""

    def vector_field(self, t, y, args):
        return y[1], -args[0] * jnp.sin(jnp.minimum(y[1] / SLOW, 1.0))

    def switches(self, args, y):
        return Switch(y[0], True), Switch(y[1] - SLOW, True, corner=True)


SLOW = 5e-6
"""Speed over which that friction builds up [m/s]."""


def test_a_jump_at_a_corner_of_steep_friction_keeps_no_change_of_the_slip():
    """A load that stops 1e4 m/s²: within 0.6 ns friction's slope is another one altogether."""
    args = Seeded((jnp.asarray(1e4),), jnp.zeros((0, 3)), jnp.zeros(3), (0,))
    flow = Flow(Braking(), section, Braking().vector_field, args, jax.tree.structure((0.0, 0.0)))
    y, q = jnp.array([0.1, SLOW]), jnp.array([1e4])
    velocity = lambda y: flow.velocity(jnp.concatenate([y, q]))

    @jax.jit
    def told(number):
        states = y + sides_of(flow, y, number, q)[:, None] * velocity(y)
        return jump_of(jax.lax.map(jax.jacfwd(velocity), states))[1, 1]

    jump = -1e4 * np.cos(1.0) / SLOW
    assert float(told(2.0)) == pytest.approx(jump, rel=1e-3)
    # As far from it as penetrations need, it is off by a hundredth.
    assert float(told(1.0)) != pytest.approx(jump, rel=5e-3)


class Flight(Plain):
    """y'' = −a; what arrives is turned: (y, v) → (y v, sin v + a)."""

    def vector_field(self, t, y, args):
        return y[1], -args[0]

    def switches(self, args, y):
        return (Switch(y[0] - args[0], True),)

    def reset_map(self, args, y):
        return y[0] * y[1], jnp.sin(y[1]) + args[0]


def section(args, y):
    return y[0] * y[0] - 0.1 * args[0] + 0.2 * y[1], jnp.asarray(True)


def arrived(z, time):
    """Where the flight from z = (y, v, a) is on the section, from about the time of its arrival."""
    y, v, a = z
    at = lambda t: jnp.stack([y + v * t - 0.5 * a * t * t, v - a * t, a])
    value = lambda t: section((a,), at(t)[:2])[0]
    for _ in range(2):  # so that second derivatives are those of the arrival
        time = time - value(time) / jax.grad(value)(time)
    return at(time)


def test_second_tangents_on_a_section_are_derivatives_of_the_arrival():
    height = lambda t: 1.0 + 2.0 * t - 1.5 * t * t
    when = brentq(lambda t: height(t) ** 2 - 0.3 + 0.2 * (2.0 - 3.0 * t), 1.2, 1.6, xtol=1e-15)
    z0, v, q = jnp.array([1.0, 2.0, 3.0]), jnp.array([0.3, -0.2, 0.0]), jnp.array([0.1, 0.4, 0.7])
    shape = jax.tree.structure((0.0, 0.0))
    flow = Flow(Flight(), section, Flight().vector_field, seeded(3), shape)

    @jax.jit
    def both(z0):
        reached = arrived(z0, jnp.asarray(when))
        time = (z0[1] - reached[1]) / z0[2]
        fixed = lambda z: jnp.stack(
            [z[0] + z[1] * time - 0.5 * z[2] * time**2, z[1] - z[2] * time, z[2]]
        )
        first, along = jax.jvp(fixed, (z0,), (v,))[1], jax.jvp(fixed, (z0,), (q,))[1]
        second = jax.jvp(lambda z: jax.jvp(fixed, (z,), (v,))[1], (z0,), (q,))[1][:2]
        jacobian = jnp.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])
        ours = on_section(flow, jacobian, reached, first, along, second)
        exact_first = lambda z, d: jax.jvp(lambda z: arrived(z, jnp.asarray(when)), (z,), (d,))[1]
        mixed = jax.jvp(lambda z: exact_first(z, v), (z0,), (q,))[1]
        turned = lambda z: flow.reset(arrived(z, jnp.asarray(when)))
        push = jax.jvp(lambda z: jax.jvp(turned, (z,), (v,))[1], (z0,), (q,))
        return {
            "v": (ours[0], exact_first(z0, v)),
            "q": (ours[1], exact_first(z0, q)),
            "second": (ours[2], mixed[:2]),
            "alone": (tangent_on_section(flow, reached, first), exact_first(z0, v)),
            "reset": (after_reset(flow, reached, *ours)[1], push[1]),
        }

    for name, (ours, expected) in both(z0).items():
        np.testing.assert_allclose(ours, expected, rtol=1e-9, atol=1e-9, err_msg=name)


@pytest.mark.parametrize(
    ("lowest", "touches", "graze"), [(1e-3, True, False), (1e-9, True, True), (0.5, False, False)]
)
def test_a_switch_that_turns_within_a_step_is_told_by_how_near_it_comes(lowest, touches, graze):
    """A ball pulled up: its height falls to its lowest halfway through the step and rises again.

    Its speed, the other switch, does not turn.
    """
    rates = lambda y: (y[1], jnp.asarray(2.0))
    height = lambda y: (Switch(y[0], jnp.asarray(True)), Switch(y[1], jnp.asarray(True)))
    ends = [(jnp.asarray(1.0 + lowest), jnp.asarray(v)) for v in (-2.0, 2.0)]
    errors = (jnp.asarray(1e-7), jnp.asarray(1e-7))
    found = turns_of(rates, height, jnp.asarray(2.0), *ends, errors)
    assert bool(found.touches[0]) is touches
    assert bool(found.graze) is graze
    assert float(found.places[0]) == pytest.approx(0.5)


@pytest.mark.parametrize(("later", "slows"), [(-0.0999, True), (-0.1, False), (-0.1001, False)])
def test_a_foot_that_touches_down_grazes_only_if_it_is_slowed(later, slows):
    """Known to metres, every depth at which it might turn is near the ground."""
    falls = jb.seed_state()._replace(hip_vz=jnp.asarray(-0.1))
    above = falls._replace(hip_z=jnp.asarray(0.396))
    below = falls._replace(hip_z=jnp.asarray(0.395), hip_vz=jnp.asarray(later))
    old, new = (jb.hybrid.Walking().gaps(jb.seed_scene(), y) for y in (above, below))
    assert bool(grazes(old, new, jnp.asarray(0.01), jnp.asarray(10.0))) is slows


@pytest.mark.parametrize(
    ("deepest", "share"), [(0.01, 0.2), (-0.01, 0.2), (0.01, 0.8), (-0.01, 0.8), (0.5, 1.5)]
)
def test_a_gap_grazes_where_it_turns_no_deeper_than_it_is_known(deepest, share):
    """At constant deceleration it is deepest at a share of the step, or some time behind its end.

    There it has closed within the step, and slows down.
    """
    span, size, slowing = 0.5, 3.0, 4.0
    times = span * np.array([0.0, 1.0]) - span * share
    depths, rates = deepest - 0.5 * slowing * times**2, -slowing * times
    old, new = (
        Gap(jnp.asarray(depth), jnp.asarray(rate), None, size)
        for depth, rate in zip(depths, rates, strict=True)
    )
    for known, expected in ((1.1, True), (0.9, False)):
        rtol = jnp.asarray(known * abs(deepest) / size)
        assert bool(grazes((old,), (new,), jnp.asarray(span), rtol)) is expected


def test_radau_is_exact_for_polynomials_and_its_clock_runs_in_the_root_of_time():
    nodes = RADAU.sum(axis=1)
    assert nodes[-1] == pytest.approx(1.0)
    for power in range(3):
        np.testing.assert_allclose(RADAU @ nodes**power, nodes ** (power + 1) / (power + 1))
    for power in range(5):  # order five at the end
        assert RADAU[-1] @ nodes**power == pytest.approx(1.0 / (power + 1))
    blank = KnownStep(None, None, jnp.asarray(2.0), jnp.asarray(0.5), jnp.asarray(1.75), None, None)
    part, share = blank.clock()
    root = np.sqrt(0.25) + nodes * (np.sqrt(0.75) - np.sqrt(0.25))
    np.testing.assert_allclose(part, (root**2 - 0.25) / 0.5)
    np.testing.assert_allclose(share, 2.0 * root * (np.sqrt(0.75) - np.sqrt(0.25)))
    # The integral of 1/√t, singular at the switch, from its values at the nodes.
    fresh = blank._replace(start=jnp.asarray(1.75))
    part, share = fresh.clock()
    integral = RADAU[-1] @ (np.asarray(share) / np.sqrt(0.5 * np.asarray(part)))
    assert integral == pytest.approx(2.0 * np.sqrt(0.5))


def test_systems_of_walkers_exchange_legs_and_carry_the_larger_load():
    scene, state = jb.seed_scene(), jb.seed_state()
    swapped = jb.dynamics.exchange_legs(scene, state)
    for leg in (Walking(), RedundantWalking()):
        assert [float(x) for x in leg.reset_map(scene, state)] == [float(x) for x in swapped]
    low = state._replace(hip_z=jnp.asarray(0.3945))
    load = jax.jit(lambda y: (Walking().load(scene, y), jb.dynamics.foot_forces(scene, y)))
    for each in (low, jb.dynamics.exchange_legs(scene, low)):
        largest, forces = load(each)
        both = float(forces[0].normal), float(forces[1].normal)
        assert float(largest) == max(both) > min(both) == 0.0
    assert Walking.cyclic_coordinates == Rolling.cyclic_coordinates == (0,)


def test_displaced_motions_meet_a_switch_later_by_their_distance_over_its_rate():
    """Columns of two directions and of the level; the switches are the level, a speed, a sum."""
    height, speed = 0.6, -3.0
    state = jnp.asarray(height), jnp.asarray(speed)
    normals = {1: ([1.0, 0.0], -1.0), 2: ([0.0, 1.0], 0.0), 3: ([1.0, 1.0], 0.0)}
    columns = jnp.asarray([[0.3, -0.2], [0.1, 0.7]])
    by_level, shifts, size = jnp.asarray([[0.4, 0.9]]), jnp.asarray([0.05, -0.06]), 2.5
    rates = np.array([speed, BEFORE])
    for which, (normal, along) in normals.items():
        met = meeting_at(WATCH, state, seeded(1), jnp.asarray(which))
        rate = np.dot(normal, rates)
        np.testing.assert_allclose(met.by_state, np.array(normal) / rate)
        np.testing.assert_allclose(met.by_parameter, [along / rate], atol=1e-15)
        np.testing.assert_allclose(met.rates, rates)
        found, later = meet(met, (columns, by_level), (shifts, shifts[:1]), jnp.asarray([size]))
        delays = -(np.asarray(columns) @ normal) / rate
        delay = -(np.asarray(by_level[0]) @ normal + along * size) / rate
        np.testing.assert_allclose(later[0], shifts + delays)
        np.testing.assert_allclose(later[1], shifts[:1] + delay)
        np.testing.assert_allclose(found[0], columns + np.outer(delays, rates), atol=1e-14)
        np.testing.assert_allclose(found[1], by_level + delay * rates, atol=1e-14)
    # Where no parameter moves there is nothing to add.
    alone = met._replace(by_parameter=jnp.zeros(0))
    none = jnp.zeros((0, 2)), jnp.zeros(0)
    found, later = meet(alone, (columns, none[0]), (shifts, none[1]), jnp.zeros(0))
    assert [each.shape for each in (*found, *later)] == [(2, 2), (0, 2), (2,), (0,)]
    np.testing.assert_allclose(later[0], shifts + delays)
    fixed = at_fixed_time(state, (columns, by_level), (shifts, shifts[:1]))
    np.testing.assert_allclose(fixed[0], columns - np.outer(shifts, [height, speed]))
    np.testing.assert_allclose(fixed[1], by_level - 0.05 * np.array([height, speed]))


def test_nodes_are_the_steps_that_a_solve_took_and_its_arrival():
    times = jnp.asarray([0.0, 0.1, 0.3, jnp.inf])
    states = jnp.arange(4.0), 10.0 + jnp.arange(4.0)
    arrival = Tangents((jnp.asarray(2.5), jnp.asarray(12.5)), jnp.zeros((2, 1)))
    found = _nodes(times, states, jnp.asarray(0.25), arrival)
    assert int(found.steps) == 2
    np.testing.assert_array_equal(found.start, [0.0, 0.0, 10.0])
    np.testing.assert_array_equal(found.ends.values[:2], [[0.1, 1.0, 11.0], [0.3, 2.0, 12.0]])
    assert int(found.ends.counts) == 2
    np.testing.assert_array_equal(found.arrival, [0.25, 2.5, 12.5])


class Noting:
    """A controller that keeps what it is asked."""

    atol = 1e-9

    def adapt_step_size(self, *attempt):
        self.asked = Attempt(*attempt)
        return (None,) * len(Adapted._fields)


def test_a_column_s_error_counts_against_its_entry_a_share_of_its_largest_and_its_floor():
    noting, inverse = Noting(), jnp.asarray([2.0, 0.5])
    begins = jnp.asarray([[0.3, -4.0], [-0.2, 0.0]])
    ends, errors = jnp.asarray([[0.1, 1.0], [0.6, -6.0]]), jnp.asarray([[1e-6, 2e-6], [-3e-6, 0.0]])
    y0, y1, error = (Tangents((jnp.ones(()),) * 2, columns) for columns in (begins, ends, errors))
    args = Seeded((), jnp.zeros((0, 2)), jnp.asarray([0.01, 0.0]), ())
    control = TangentControl(noting, 1e-4, inverse)
    control.adapt(Attempt(0.0, 0.1, y0, y1, args, error, 3, None))
    size = np.array([[0.6, 8.0], [0.3, 3.0]])
    allowed = 1e-4 * (size + 0.1 * np.array([0.6, 8.0]) + np.array([0.01, 0.0]))
    expected = np.array(errors) * np.array([[2.0], [0.5]]) / allowed
    np.testing.assert_allclose(noting.asked.error.columns / noting.atol, expected, rtol=1e-12)
    assert noting.asked.error.state == error.state
    for y, given in ((noting.asked.y0, y0), (noting.asked.y1, y1)):
        np.testing.assert_array_equal(y.columns, 0.0)
        assert y.state == given.state
    of_columns = np.sqrt((np.array(errors) ** 2).mean(axis=0)).max()
    small = error._replace(state=(jnp.asarray(1e-7),) * 2)
    assert float(worst_norm(small)) == pytest.approx(of_columns)
    assert float(worst_norm(error)) == 1.0
