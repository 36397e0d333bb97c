"""What comes within a step of single support, against the polynomials of its angles."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial import Polynomial

import jaxbiped as jb
from jaxbiped.dynamics import rolling_field
from jaxbiped.dynamics._stance_motion import rolling_rates
from jaxbiped.hybrid import Rolling
from jaxbiped.hybrid._landing_system import LandingMotion
from jaxbiped.solve._explicit_methods import ExplicitMethod
from jaxbiped.solve._explicit_step import explicit_step
from jaxbiped.solve._step_events import euler_step_onto, events_within
from tests.rigid_walkers import STABLE, compass_gait, simplest_state, simplest_walker

RTOL, STEP = 1e-6, 0.4
ROLLING = jb.dynamics.rigid_state(jb.seed_state())
SCENE = simplest_walker()
AHEAD, BEHIND = [-0.2] * 6, [0.2] * 6
"""Control values of the stance leg's angle: that of a swing leg ahead is larger by 0.4."""


def of_controls(control):
    """The quintic on (0, 1) whose control values, in Bernstein's form, these are."""
    s, rest = Polynomial([0.0, 1.0]), Polynomial([1.0, -1.0])
    binomials = (1, 5, 10, 10, 5, 1)
    return sum(
        c * b * s**k * rest ** (5 - k)
        for k, (c, b) in enumerate(zip(control, binomials, strict=True))
    )


def ends_of(opening, stance):
    """States and rates at both ends of a step in which these polynomials are followed."""
    angles = opening - stance, stance
    found = []
    for s in (0.0, 1.0):
        values, rates, turning = (
            [float(each.deriv(n)(s)) / STEP**n if n else float(each(s)) for each in angles]
            for n in range(3)
        )
        state = jb.dynamics.RigidState(*map(jnp.asarray, (0.0, *values, *rates)))
        found.append((state, tuple(map(jnp.asarray, turning))))
    return found


@jax.jit
def within(before, after, length, begins_on_section):
    return events_within(
        LandingMotion(Rolling(), SCENE), jnp.asarray(STEP), before, after,
        rtol=jnp.asarray(RTOL), length=length, begins_on_section=begins_on_section,
    )  # fmt: skip


def told(opening, stance, length=0.1, *, begins=False):
    curves = (
        each if isinstance(each, Polynomial) else of_controls(each) for each in (opening, stance)
    )
    return within(*ends_of(*curves), jnp.asarray(length), jnp.asarray(begins))


def words(events):
    """Names of what happens."""
    names = "arrives", "ends", "unclear", "grazes"
    return {name for name in names if bool(getattr(events, name))}


FALLS = 0.1 * Polynomial([1.0, -1.0 / 0.3])
"""An opening that falls through zero at 0.3 of the step."""
TIPS = np.array([0.2, 0.4, 0.6, 0.8, 0.95, 1.1])
"""Control values of a stance leg that falls over backwards: beyond 1 rad at the end."""
DIP = np.array([0.2, 0.1, 0.0, 0.1, 0.1, 0.2])
"""Control values of what comes down to about zero and rises again."""
MIDDLE = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def lead_of(lead, opening=FALLS):
    """The stance leg's angle with such a lead of the swing leg."""
    return 0.5 * (opening - lead)


@pytest.mark.parametrize(
    ("stance", "arrives"),
    [
        (of_controls(AHEAD), True),
        (of_controls(BEHIND), False),
        (lead_of(Polynomial([0.6, -1.0])), True),
        (lead_of(Polynomial([0.2, -1.0])), False),
        (lead_of(Polynomial([-0.2, 1.0])), True),
        (lead_of(Polynomial([-0.6, 1.0])), False),
    ],
)
def test_a_foot_that_comes_down_strikes_where_it_is_ahead_then(stance, arrives):
    """At the root of the opening, 0.3, whatever it is at the ends."""
    found = told(FALLS, stance)
    assert words(found) == ({"arrives"} if arrives else set())
    assert bool(found.above)
    assert float(found.place) == pytest.approx(0.3, rel=1e-9)


@pytest.mark.parametrize(
    ("opening", "begins", "above", "expected"),
    [
        (Polynomial([-0.1, -0.1]), False, False, set()),
        (Polynomial([-0.1, 0.3]), False, False, set()),
        (Polynomial([0.1, 0.3]), False, True, set()),
        (Polynomial([0.0, 0.3, -0.2]), False, True, set()),
        (Polynomial([0.0, -0.3, 0.2]), False, False, set()),
        (Polynomial([0.0, 0.3, -0.4]), False, True, {"unclear"}),
        (Polynomial([1e-9, 0.3, -0.4]), False, True, {"arrives"}),
        (Polynomial([1e-9, 0.3, -0.4]), True, True, {"unclear"}),
        (Polynomial([1e-9, -0.3, 0.2]), True, False, set()),
        (Polynomial([-1e-9, 0.3, -0.2]), True, True, set()),
    ],
)
def test_a_step_that_begins_on_the_section_is_told_by_its_rate(opening, begins, above, expected):
    found = told(opening, AHEAD, begins=begins)
    assert (words(found), bool(found.above)) == (expected, above)


@pytest.mark.parametrize(
    ("lowest", "length", "expected"),
    [
        (-2e-6, 0.1, {"unclear"}),
        (-0.5e-6, 0.1, {"grazes"}),
        (0.5e-6, 0.1, {"grazes"}),
        (2e-6, 0.1, set()),
        (2e-6, 1.0, {"unclear"}),
        (6e-5, 1.0, {"unclear"}),
        (6.5e-5, 1.0, set()),
        (6.5e-5, 1.1, {"unclear"}),
    ],
)
def test_a_step_that_may_dip_is_too_long_unless_it_is_known_so_well(lowest, length, expected):
    """Known to rtol, and to 2 rtol^¾ times the sixth power of the step's length."""
    found = told(DIP + lowest * MIDDLE, AHEAD, length)
    assert words(found) == expected
    # What dips behind the other foot scuffs, and a leg that nearly falls is the same.
    assert words(told(DIP + lowest * MIDDLE, BEHIND, length)) == set()
    upright = np.array([0.8, 0.9, 1.0, 0.9, 0.9, 0.8]) - lowest * MIDDLE
    for side in (1.0, -1.0):
        assert words(told([3.0] * 6, side * upright, length)) == expected


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_stance_leg_beyond_one_radian_has_fallen(side):
    found = told([3.0] * 6, side * TIPS)
    assert words(found) == {"ends"}
    expected = [
        r.real for r in (of_controls(TIPS) - 1.0).roots() if 0.0 < r.real < 1.0 and not r.imag
    ]
    assert float(found.place) == pytest.approx(*expected, abs=1e-6)
    assert words(told([3.0] * 6, side * (TIPS - 0.11))) == set()


def test_what_strikes_and_falls_in_one_step_is_too_long():
    assert words(told(FALLS, -TIPS)) == {"unclear"}
    assert words(told(FALLS, TIPS)) == {"ends"}  # with the swing foot behind


@pytest.mark.parametrize(
    ("opening", "lead", "expected"),
    [
        (4e-6 * Polynomial([1.0, -2.0, 1.0]) - 0.5e-6, Polynomial([0.4]), {"grazes"}),
        (4e-6 * Polynomial([1.0, -2.0, 1.0]) - 1.5e-6, Polynomial([0.4]), {"arrives"}),
        (FALLS, Polynomial([0.5e-6]), {"grazes"}),
        (FALLS, Polynomial([-0.5e-6]), {"grazes"}),
        (FALLS, Polynomial([3e-6]), {"arrives"}),
        (FALLS, Polynomial([-3e-6]), set()),
        (FALLS, Polynomial([3e-6 - 0.3, 1.0]), {"grazes"}),
        (FALLS, Polynomial([3e-6 + 0.3, -1.0]), {"grazes"}),
        (FALLS, Polynomial([-3e-6 + 0.3, -1.0]), {"grazes"}),
        (FALLS, Polynomial([5e-6 + 0.3, -1.0]), {"arrives"}),
        (FALLS, Polynomial([-5e-6 + 0.3, -1.0]), set()),
    ],
)
def test_what_hardly_comes_down_or_hardly_ahead_grazes(opening, lead, expected):
    """Near where the opening turns, or where both legs are in line, as it is known to rtol."""
    assert words(told(opening, lead_of(lead, opening))) == expected


def motion(swing, stance, swing_rate, stance_rate):
    numbers = 0.7, swing, stance, swing_rate, stance_rate
    return jb.dynamics.RigidState(*map(jnp.asarray, numbers))


@jax.jit
def onto(falling, trial, turning):
    rates = *trial[3:], *turning
    return euler_step_onto(
        LandingMotion(Rolling(), SCENE), falling, trial, rates, jnp.asarray(RTOL)
    )


@pytest.mark.parametrize(
    ("value", "rate", "turning", "near"),
    [
        (0.9e-4, -2.0, 0.0, True),
        (-0.9e-4, -2.0, 0.0, True),
        (1.1e-4, -2.0, 0.0, False),
        (-1.1e-4, -2.0, 0.0, False),
        (0.9e-4, 2.0, 0.0, False),
        (0.8e-4, -2.0, 24.0, True),
        (0.8e-4, -2.0, -26.0, False),
        (0.8e-4, -2.0, 26.0, False),
        (0.5e-4, -0.0, 0.0, False),
    ],
)
def test_one_euler_step_leads_onto_a_strike_or_a_fall_that_is_near(value, rate, turning, near):
    """From a tenth of √rtol, if half the acceleration takes a fiftieth of rtol off on the way."""
    rest = -value / (rate or 1.0)
    for stance, leads in ((-0.2, True), (0.2, False)):
        strike = motion(value - stance, stance, rate - 0.3, 0.3)
        found = onto(jnp.asarray(False), strike, (jnp.asarray(0.75 * turning), 0.25 * turning))
        assert (bool(found.near), bool(found.counts)) == (near, leads)
        assert float(found.closing) == pytest.approx(rate)
        assert float(found.rest) == pytest.approx(rest)
        expected = [0.7, *(a + rest * b for a, b in zip(strike[1:3], strike[3:], strict=True))]
        expected += [strike[3] + rest * 0.75 * turning, 0.3 + rest * 0.25 * turning]
        np.testing.assert_allclose(found.state, expected)
    for side in (1.0, -1.0):
        fall = motion(0.3, side * (1.0 - value), 0.4, -side * rate)
        found = onto(jnp.asarray(True), fall, (jnp.asarray(0.0), -side * jnp.asarray(turning)))
        assert bool(found.near) == near
        assert float(found.rest) == pytest.approx(rest)
        assert float(found.closing) == pytest.approx(rate)


def test_a_swing_foot_passes_the_other_on_the_way_to_a_strike():
    """It is 1 µrad behind it, or ahead, and 8 µs of 0.2 rad/s on the way change that."""
    for lead, rate, ahead in ((-1e-6, 0.2, True), (1e-6, -0.2, False), (-2e-6, 0.2, False)):
        value, closing = 1.6e-5, -2.0
        trial = motion(
            0.5 * (value + lead),
            0.5 * (value - lead),
            0.5 * (closing + rate),
            0.5 * (closing - rate),
        )
        assert bool(onto(jnp.asarray(False), trial, (0.0, 0.0)).counts) == ahead


def test_a_step_is_that_of_dormand_and_prince_with_its_error():
    """Diffrax's, with the root mean square of errors in units of rtol (0.01 + the larger end)."""
    scene, state, step = compass_gait(), simplest_state(*STABLE), jnp.asarray(0.1)

    @jax.jit
    def both(state, step):
        begin = state, rolling_rates(scene, state), step, jnp.asarray(RTOL)
        own = [
            explicit_step(
                LandingMotion(Rolling(), scene), *begin, method=ExplicitMethod(embedded=e)
            )
            for e in (False, True)
        ]
        term, solver = diffrax.ODETerm(rolling_field), diffrax.Dopri8(scan_kind="lax")
        first = solver.init(term, 0.0, step, state, scene)
        end, error, *_ = solver.step(term, 0.0, step, state, scene, first, made_jump=False)
        return own, end, error, rolling_field(0.0, end, scene)

    own, expected, errors, behind = jax.tree.map(np.asarray, both(state, step))
    errors, expected = np.array(errors)[1:], np.array(expected)[1:]
    for (end, error, stages), shift in zip(own, (0.0, errors), strict=True):
        assert float(end[0]) == float(state[0])
        np.testing.assert_allclose(end[1:], expected - shift, rtol=1e-12)
        size = RTOL * (0.01 + np.maximum(np.abs(state[1:]), np.abs(end[1:])))
        assert float(error) == pytest.approx(np.sqrt(np.mean((errors / size) ** 2)), rel=1e-4)
        np.testing.assert_allclose(stages[-1], np.array(behind)[1:], rtol=1e-3)


METHODS = ExplicitMethod(), ExplicitMethod(embedded=True)


def test_the_embedded_method_is_one_order_lower():
    """Its error of one step falls by 2⁸ where that is halved, and is the larger one."""
    scene = jb.ladder()["rigid"]

    def end(step, state=ROLLING, **how):
        rates = rolling_rates(scene, state)
        return explicit_step(LandingMotion(Rolling(), scene), state, rates, step, 1e-6, **how)[0]

    gaps = []
    for step in (0.06, 0.03):
        finer = np.array(end(0.5 * step, end(0.5 * step)))
        own, other = (np.abs(np.array(end(step, method=m)) - finer).max() for m in METHODS)
        assert own < 0.5 * other
        gaps.append(other)
    assert np.log2(gaps[0] / gaps[1]) == pytest.approx(8.0, abs=0.4)


def test_an_error_of_a_step_is_the_difference_of_the_two_orders_in_units_of_the_tolerance():
    """Relative, and absolute by a hundredth; the root mean square over angles and rates."""
    scene, rtol, step = jb.ladder()["rigid"], 1e-7, 0.05
    rates = rolling_rates(scene, ROLLING)
    (end, error, _), (other, *_) = (
        explicit_step(LandingMotion(Rolling(), scene), ROLLING, rates, step, rtol, method=method)
        for method in METHODS
    )
    ends = np.array([ROLLING, end, other], dtype=float)[:, 1:5]
    allowed = rtol * (0.01 + np.max(np.abs(ends[:2]), axis=0))
    expected = np.sqrt(np.mean(((ends[1] - ends[2]) / allowed) ** 2))
    assert float(error) == pytest.approx(expected, rel=1e-4)
