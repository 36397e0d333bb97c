"""Verdicts, against arrivals that are written down, and feet that roll, slide and arrive."""

from types import SimpleNamespace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.basins import Label
from jaxbiped.dynamics._contacts import contact_places, slip_distances
from jaxbiped.dynamics._state import recurring_periods, turned_difference
from jaxbiped.solve._steps import LastStep, Step
from jaxbiped.sweep._convergence_test import NO_GAIT, UNDECIDED, Goals, after_arrival, empty_history
from jaxbiped.sweep._label_recorders import LabelMemory, LabelRecorder, Pursuit, _outcome

RADIUS, GAP, RTOL = 0.1, 1e-4, 1e-7
ONWARD = jax.jit(after_arrival, static_argnums=3)


def goals(*points, radii=None):
    """Gaits at these places of states (x, y), told by x alone."""
    count = len(points)
    return Goals(
        jnp.asarray([[p, 0.0] for p in points]),
        jnp.asarray([[[1.0, 0.0]]] * count),
        jnp.full((count, 1, 1), jnp.inf),
        jnp.asarray([[[1.0, 0.0]] * 2] * count),
        jnp.ones(count),
        jnp.asarray([RADIUS] * count if radii is None else radii),
        jnp.asarray([1.0, 10.0]),
    )


def histories(sequence, to, cycles):
    """What is known after each arrival."""
    now = empty_history(jnp.zeros(()), 2, cycles)
    for x, y in sequence:
        now = ONWARD(now, (jnp.asarray(x), jnp.asarray(y)), to, cycles, GAP, RTOL)
        yield now


def first_verdict(sequence, to, cycles):
    """How many arrivals it takes, and what is known then."""
    for number, now in enumerate(histories(sequence, to, cycles), 1):
        if int(now.verdict) != UNDECIDED:
            return number, now
    return None, now


def test_a_walk_that_comes_within_the_radius_and_nearer_walks():
    """From a distance of one, halved by each footstep: the first below a tenth is the fifth."""
    number, now = first_verdict([(0.5**k, 1.0) for k in range(9)], goals(0.0), (1,))
    assert (number, int(now.verdict), int(now.goal)) == (5, int(Label.WALKING), 0)
    assert float(now.rate) == pytest.approx(0.5)
    assert float(now.closest) == pytest.approx(0.0625)
    assert int(now.cycle_footsteps) == 1
    # Within the radius but going away it is open.
    assert first_verdict([(0.01 * 1.1**k, 1.0) for k in range(9)], goals(0.0), (1,))[0] is None


def slow(multiplier, bend, footsteps, begin=0.03, noise=0.0):
    """Arrivals of x → λ x + b x² − x³, of λ's place in the plane where it is complex."""
    random, z = np.random.default_rng(0), begin + 0.0j
    for _ in range(footsteps):
        yield z.real, 10.0 * z.imag
        z = multiplier * z + bend * z * z - z * abs(z) ** 2 + noise * random.uniform(-1.0, 1.0)


def linear_model(multiplier):
    """A gait at the origin that is known by its multiplier alone: no radius was measured."""
    rotation = np.array([[multiplier.real, -multiplier.imag], [multiplier.imag, multiplier.real]])
    metric = np.diag([1.0, 0.1])  # in which the second component is the imaginary part
    return Goals(*map(jnp.asarray, (
        np.zeros((1, 2)), metric[None], rotation[None], metric[None],
        [0.5 * (1.0 + abs(multiplier))], [-1.0], [1.0, 10.0],
    )))  # fmt: skip


@pytest.mark.parametrize("noise", [0.0, 3e-7])
@pytest.mark.parametrize(
    ("multiplier", "bend", "begin"),
    [
        (-0.97, 1.0, 0.03), (-0.999, 1.0, 0.03), (0.99 * np.exp(1.0j), 0.5, 0.03),
        (0.9999 * np.exp(2.5j), 0.5, 0.003), (0.99, -1.0, 0.03), (0.9999, -1.0, 0.03),
        (0.9999, 1.0, 3e-5), (-0.5, 3.0, 0.03),
    ],
)  # fmt: skip
def test_a_slow_gait_is_recognised_by_its_linear_model(multiplier, bend, begin, noise):
    """The map contracts there: iterated for long it comes to the origin."""
    multiplier = complex(multiplier)
    far = abs(list(slow(multiplier, bend, 4000, begin))[-1][0])
    assert far < 0.9 * begin
    _, now = first_verdict(slow(multiplier, bend, 60, begin, noise), linear_model(multiplier), (1,))
    assert (int(now.verdict), int(now.goal)) == (int(Label.WALKING), 0)
    assert int(now.cycle_footsteps) == 1


@pytest.mark.parametrize(
    ("multiplier", "bend", "begin"), [(0.99, 1.0, 0.012), (0.9999, 1.0, 0.02), (-0.97, 0.0, 0.2)]
)
def test_what_leaves_a_slow_gait_does_not_converge_to_it(multiplier, bend, begin):
    """It begins beyond the unstable fixed point, or outside the unstable cycle of two."""
    arrivals = list(slow(multiplier, bend, 16, begin))
    assert abs(arrivals[-1][0]) > begin
    _, now = first_verdict(arrivals, linear_model(complex(multiplier)), (1,))
    assert now is None or int(now.verdict) != int(Label.WALKING)


def test_a_slow_transient_about_an_unknown_gait_is_no_cycle_of_two():
    for multiplier in (-0.97, -0.9):
        arrivals = slow(complex(multiplier), 0.0, 600, 1e-3)
        _, now = first_verdict(arrivals, goals(5.0, radii=[NO_GAIT]), (1,))
        assert int(now.cycle_footsteps) == 1


def test_a_cycle_of_two_is_told_by_every_other_footstep():
    sequence = [((-1) ** k * (1.0 + 0.6**k), 1.0) for k in range(14)]
    number, now = first_verdict(sequence, goals(1.0, -1.0), (2, 2))
    assert (int(now.verdict), int(now.cycle_footsteps)) == (int(Label.WALKING), 2)
    assert 0.6 ** (number - 1) <= RADIUS < 0.6 ** (number - 2)
    assert float(now.rate) == pytest.approx(0.6)


@pytest.mark.parametrize("length", [1, 2])
@pytest.mark.parametrize(("share", "walks"), [(0.88, True), (0.93, True), (0.97, False)])
def test_two_cycles_must_lead_nearer_by_half_of_what_the_multiplier_promises(length, share, walks):
    """Of 0.9 a cycle: what is left after two of them may be up to (1 + 0.81)/2 of the offset."""
    assert (share**2 <= 0.5 * (1.0 + 0.9**2)) is walks
    places = [5.0 * g for g in range(length)]
    model = goals(*places, radii=[-1.0] * length)._replace(
        models=jnp.full((length, 1, 1), 0.9), contractions=jnp.full(length, 0.95)
    )
    sequence = [(places[k % length] + 0.03 * share ** (k / length), 1.0) for k in range(20)]
    _, now = first_verdict(sequence, model, (length,) * length)
    assert (int(now.verdict) == int(Label.WALKING)) is walks


@pytest.mark.parametrize(("period", "arrivals"), [(1, 4), (2, 5), (3, 6), (4, 7)])
def test_an_unknown_cycle_is_one_that_repeats_three_times(period, arrivals):
    sequence = [(5.0 + (k % period), 1.0) for k in range(20)]
    number, now = first_verdict(sequence, goals(0.0, radii=[NO_GAIT]), (1,))
    assert (number, int(now.verdict)) == (arrivals, int(Label.UNRESOLVED))
    assert int(now.cycle_footsteps) == period
    # A step of more than the gap, in units of the scales, is no repetition.
    for size, known in ((0.9, True), (1.1, False)):
        step = 10.0 * np.sqrt(2.0) * GAP * size
        drifting = [(5.0, step * k) for k in range(20)]
        number, _ = first_verdict(drifting, goals(0.0, radii=[NO_GAIT]), (1,))
        assert (number is not None) is known


@pytest.mark.parametrize(
    ("code", "verdict", "label", "goal", "cycle"),
    [
        (Label.WALKING, UNDECIDED, Label.UNRESOLVED, -1, 2),
        (Label.WALKING, Label.WALKING, Label.WALKING, 1, 2),
        (Label.WALKING, Label.UNRESOLVED, Label.UNRESOLVED, -1, 2),
        (Label.WALKING, Label.SLID, Label.SLID, -1, 0),
        (Label.OUT_OF_STEPS, UNDECIDED, Label.OUT_OF_STEPS, -1, 0),
        (Label.OUT_OF_STEPS, Label.WALKING, Label.WALKING, 1, 2),
        (Label.STUMBLED, Label.WALKING, Label.STUMBLED, -1, 0),
        (Label.FELL_BACK, UNDECIDED, Label.FELL_BACK, -1, 0),
    ],
)
def test_a_failure_is_certain_and_what_only_ran_out_is_open(code, verdict, label, goal, cycle):
    trace = empty_history(np.float64(0.0), 2, (1,))._replace(
        verdict=np.int64(verdict), goal=np.int64(1), cycle_footsteps=np.int64(2)
    )
    rest = dict.fromkeys(("footsteps", "time", "distance", "attempted"), np.float64(3.0))
    found = _outcome(trace, code=np.int64(code), **rest)
    told = (int(found.label), int(found.gait), int(found.cycle_footsteps))
    assert told == (int(label), goal, cycle)


SCENE = jb.seed_scene()


def standing(angle, rate, depth=1e-4, hip_x=0.0):
    """A walker that rolls on leg 2, which is at this angle; leg 1 is far off the ground."""
    walker = SCENE.walker
    reach = walker.hip_to_foot
    return jb.State(*map(jnp.asarray, (
        hip_x - walker.r * angle - reach * np.sin(angle), walker.r - depth + reach * np.cos(angle),
        1.3, angle, -(walker.r + reach * np.cos(angle)) * rate, -reach * np.sin(angle) * rate,
        0.5, rate,
    )))  # fmt: skip


@pytest.mark.parametrize("leg", [0, 1])
def test_a_foot_that_rolls_does_not_slide_and_one_that_slides_does(leg):
    name = lambda y: y if leg else jb.dynamics.exchange_legs(SCENE, y)
    places = contact_places(SCENE, name(standing(0.2, -1.0)))
    told = lambda **moved: slip_distances(SCENE, name(standing(0.1, -1.0, **moved)), places)
    landed, slid = told()
    assert float(slid) == pytest.approx(0.0, abs=1e-12)
    assert float(landed[leg]) == pytest.approx(float(places[leg]), abs=1e-15)
    assert float(told(hip_x=-0.03)[1]) == pytest.approx(0.03)
    # A foot in the air takes its place along.
    landed, slid = told(depth=-1e-3, hip_x=0.07)
    assert float(slid) == 0.0
    assert float(landed[leg]) == pytest.approx(float(places[leg]) + 0.07)


class Straight:
    """A continuous solution along a straight line."""

    def __init__(self, *, t0, t1, y0, y1):
        self.ends = t0, t1, y0, y1

    def evaluate(self, time):
        t0, t1, y0, y1 = self.ends
        return jax.tree.map(lambda a, b: a + (time - t0) / (t1 - t0) * (b - a), y0, y1)


@pytest.fixture(scope="module")
def attempt():
    """One step of a labelling, from one given state to another."""
    recorder = LabelRecorder(jb.MidStance(), (1,), grazes=False)

    @jax.jit
    def one(before, after, t, strike, landed, radius):
        how = SimpleNamespace(
            system=jb.hybrid.Walking(),
            course=lambda solve, last, t1, y1: Straight(t0=last.t, t1=t1, y0=last.state, y1=y1),
        )
        flat, none = jnp.zeros((1, 6, 7)), jnp.asarray([NO_GAIT])
        far = Goals(
            jnp.zeros((1, 7)), flat, flat[..., 1:], flat[:, :2], jnp.zeros(1), none, jnp.ones(7)
        )
        pursuit = Pursuit(far, 0.0, 2.0)
        solve = SimpleNamespace(scene=SCENE, rtol=jnp.zeros(()), recording=pursuit)
        yes, no = jnp.asarray(True), jnp.asarray(False)
        step = Step(t - 0.01, before, t, after, yes, lambda course: (), strikes=no)
        memory = LabelMemory(
            LastStep(no, t, before, ()), empty_history(strike, 7, (1,)), (strike,), landed
        )
        memory = recorder.follow(how, solve, memory, step)
        return memory.trace, recorder.decides(memory)

    return one


def test_arrivals_at_mid_stance_are_those_of_either_leg(attempt):
    before, after = standing(0.01, -1.0), standing(-0.03, -1.0)
    landed = tuple(contact_places(SCENE, before))
    for exchanged in (False, True):
        ends = before, after
        if exchanged:
            ends = tuple(jb.dynamics.exchange_legs(SCENE, each) for each in ends)
            landed = landed[::-1]
        trace, over = attempt(*ends, 1.0, 0.5, landed, 0.0)
        arrived = np.array(trace.recent[0])
        assert not bool(over)
        assert arrived[2] == pytest.approx(0.0, abs=1e-9)  # θ₂, of the leg that stands
        np.testing.assert_allclose([arrived[1], arrived[6]], [1.3, -1.0], rtol=1e-12)
    uphill, _ = attempt(after, before, 1.0, 0.5, landed, 0.0)
    assert np.isinf(np.array(uphill.recent[0])).all()


def test_a_foot_may_slide_a_leg_and_a_footstep_may_take_its_time(attempt):
    state = standing(0.2, -1.0)
    place = contact_places(SCENE, state)
    for by, verdict in ((0.39, UNDECIDED), (0.41, int(Label.SLID))):
        trace, over = attempt(state, state, 1.0, 0.5, (place[0], place[1] - by), 0.0)
        assert int(trace.verdict) == verdict
        assert bool(over) is (verdict != UNDECIDED)
    for time, verdict in ((2.49, UNDECIDED), (2.51, int(Label.TIMED_OUT))):
        assert int(attempt(state, state, time, 0.5, place, 0.0)[0].verdict) == verdict


class Clock(NamedTuple):
    """A state with a phase."""

    place: float
    phase: float

    periodic = {"phase": 2.0 * np.pi}  # noqa: RUF012


def test_differences_of_phases_are_those_modulo_their_period():
    turn = 2.0 * np.pi
    assert recurring_periods(Clock) == (None, turn)
    assert recurring_periods(jb.State) == ()
    assert turned_difference(turn - 0.1, turn) == pytest.approx(-0.1)
    flat, none = jnp.zeros((1, 1, 2)), jnp.asarray([NO_GAIT])
    far = Goals(
        jnp.zeros((1, 2)), flat, flat[..., 1:], jnp.zeros((1, 2, 2)), jnp.zeros(1), none,
        jnp.ones(2),
    )  # fmt: skip
    onward = jax.jit(after_arrival, static_argnums=(3, 6))
    repeats = []
    for periods in ((), recurring_periods(Clock)):
        history = empty_history(jnp.zeros(()), 2, (1,))
        for phase in (1e-6, turn - 1e-6, 1e-6, turn - 1e-6):
            state = (jnp.asarray(1.0), jnp.asarray(phase))
            history = onward(history, state, far, (1,), 1e-4, 1e-6, periods)
        repeats.append(int(history.repeats[0]))
    assert repeats == [0, 3]
