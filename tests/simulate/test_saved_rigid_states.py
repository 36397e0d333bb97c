"""Saved states of rigid walks, against equations of their own by SciPy and differences of walks."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from reference.rigid import rigid_walker
from scipy.optimize import brentq

import jaxbiped as jb
from tests.rigid_walkers import STABLE, rigid_seed, simplest_state, simplest_walker

SCENES = {"point feet": (simplest_walker(), simplest_state(*STABLE), 8.0)}
SCENES["round feet"] = (
    rigid_seed(),
    jb.dynamics.RigidState(*map(jnp.asarray, (0.7, -0.25, 0.23, -1.0, -1.6))),
    1.3,
)
TIMES = np.linspace(0.0, 1.0, 23)


class Truth:
    """A walk as footsteps, each from just after an impact to just before the next."""

    def __init__(self, scene, state, duration):
        walker = rigid_walker(scene)
        y, self.begins, self.footsteps = np.array([float(leaf) for leaf in state[1:]]), [0.0], []
        while self.begins[-1] < duration:
            self.footsteps.append(walker.until_strike(y))
            self.begins.append(self.begins[-1] + self.footsteps[-1].t[-1])
            y = walker.after_impact(self.footsteps[-1].y[:, -1])

    def at(self, times):
        """Angles and rates; at a strike those before it."""
        which = np.searchsorted(self.begins[1:], times)
        pairs = zip(which, times, strict=True)
        return np.stack([self.footsteps[k].sol(t - self.begins[k]) for k, t in pairs])

    def passages(self, duration):
        """When the standing leg passes the normal of the slope."""
        found = []
        for begin, step in zip(self.begins, self.footsteps, strict=False):
            upright = brentq(lambda t, step=step: step.sol(t)[1], 0.0, step.t[-1], xtol=1e-14)
            found.append(begin + upright)
        return np.array([time for time in found if time <= duration])


@pytest.fixture(scope="module", params=SCENES)
def case(request):
    scene, state, duration = SCENES[request.param]
    return scene, state, duration, Truth(scene, state, duration)


@pytest.mark.parametrize(("rtol", "most"), [(1e-6, 3e-6), (1e-11, 3e-10)])
def test_states_at_times_are_those_of_an_independent_solution(case, rtol, most):
    scene, state, duration, truth = case
    times = duration * TIMES
    walk = jb.simulate(scene, state, duration=duration, save=times, rtol=rtol)
    assert walk.outcome is jb.Ending.WALKING
    assert int(walk.arrivals.total) == len(truth.footsteps) - 1 >= 2
    np.testing.assert_array_equal(walk.t, times)
    saved = np.stack([np.asarray(leaf) for leaf in walk.state[1:]], axis=1)
    np.testing.assert_allclose(saved, truth.at(times), atol=most)
    # The root point moves with the foot that rolls: its place at the end is that of the plain walk.
    plain = jb.simulate(scene, state, duration=duration, save="end", rtol=rtol)
    assert float(walk.state.hip_x[0]) == pytest.approx(float(state.hip_x), abs=1e-12)
    assert float(walk.state.hip_x[-1]) == pytest.approx(float(plain.final.hip_x), abs=most)


@pytest.mark.parametrize(("rtol", "most"), [(1e-6, 3e-6), (1e-11, 3e-10)])
def test_steps_tell_both_sides_of_each_strike_and_what_lies_between(case, rtol, most):
    scene, state, duration, truth = case
    walk = jb.simulate(scene, state, duration=duration, save="steps", rtol=rtol)
    t = np.asarray(walk.t)
    saved = np.stack([np.asarray(leaf) for leaf in walk.state[1:]], axis=1)
    (strikes,) = np.nonzero(np.diff(t) == 0.0)
    whole = len(truth.footsteps) - 1
    assert len(strikes) == int(walk.arrivals.total) == whole
    np.testing.assert_allclose(t[strikes], truth.begins[1 : 1 + whole], atol=most)
    ends = np.stack([step.y[:, -1] for step in truth.footsteps[:whole]])
    begins = np.stack([step.y[:, 0] for step in truth.footsteps[1:]])
    np.testing.assert_allclose(saved[strikes], ends, atol=10 * most)
    np.testing.assert_allclose(saved[strikes + 1], begins, atol=10 * most)
    assert t[0] == 0.0
    assert t[-1] == duration
    assert whole < len(t) <= 1 + int(walk.accepted) + whole
    times = duration * np.linspace(0.0, 1.0, 201)
    between = np.stack([np.asarray(leaf) for leaf in walk.at(times)[1:]], axis=1)
    np.testing.assert_allclose(between, truth.at(times), atol=3 * most)
    # At a step's own end its state is told again.
    again = np.asarray(walk.at(t).omega_2)[np.diff(t, prepend=-1.0) > 0.0]
    np.testing.assert_allclose(
        again, np.asarray(walk.state.omega_2)[np.diff(t, prepend=-1.0) > 0.0], atol=most
    )


def test_a_place_between_strikes_is_where_its_speed_leads(case):
    scene, state, duration, _ = case
    times = duration * np.linspace(0.0, 1.0, 2001)
    walk = jb.simulate(scene, state, duration=duration, save=times, accuracy="tight")
    speeds = np.asarray(jb.dynamics.rolling_field(0.0, walk.state, scene).hip_x)
    moved = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(times) * (speeds[1:] + speeds[:-1]))])
    np.testing.assert_allclose(walk.state.hip_x - walk.state.hip_x[0], moved, atol=2e-3)


def test_arrivals_at_mid_stance_and_at_a_section_of_ones_own(case):
    scene, state, duration, truth = case
    own = jb.Section(lambda scene, state: -state.theta_2)
    for section in (jb.MidStance(), own):
        walk = jb.simulate(scene, state, duration=duration, save=section, rtol=1e-10)
        expected = truth.passages(duration)
        count = int(walk.arrivals.total)
        assert count == len(expected)
        np.testing.assert_allclose(walk.arrivals.t[:count], expected, atol=3e-9)
        assert np.all(np.isinf(walk.arrivals.t[count:]))
        saved = np.stack([np.asarray(leaf)[:count] for leaf in walk.arrivals.state[1:]], axis=1)
        np.testing.assert_allclose(saved, truth.at(expected), atol=3e-8)


@pytest.mark.slow
def test_both_engines_arrive_alike():
    scene, state, duration = SCENES["round feet"]
    walks = [
        jb.simulate(scene, state, duration=duration, save=jb.MidStance(), rtol=1e-9, engine=engine)
        for engine in ("lanes", "xla")
    ]
    np.testing.assert_allclose(walks[0].arrivals.t[:2], walks[1].arrivals.t[:2], atol=1e-9)


@pytest.mark.parametrize(
    ("engine", "most"), [("lanes", 1e-9), pytest.param("xla", 1e-6, marks=pytest.mark.nightly)]
)
def test_steps_are_saved_under_jit_and_vmap_as_without(engine, most):
    scene, state, duration = SCENES["round feet"]

    def walk(rate, duration=duration):
        begin = state._replace(omega_2=rate)
        how = dict(save="steps", max_solver_steps=100, engine=engine)
        return jb.simulate(scene, begin, duration=duration, **how)

    rates = jnp.array([-1.6, -1.7, 3.0])  # the last one falls
    batch, one = jax.vmap(walk)(rates), jax.jit(walk)(rates[0])
    assert batch.t.shape == (3, 201)
    assert [int(code) for code in batch.ending] == [0, 0, int(jb.Ending.FELL_BACK)]
    for k, rate in enumerate(rates):
        alone = walk(rate)
        count = len(alone.t)
        np.testing.assert_array_equal(batch.t[k, count:], np.inf)
        for leaf, expected in zip(batch.state, alone.state, strict=True):
            np.testing.assert_allclose(leaf[k, :count], expected, rtol=most, atol=most)
        np.testing.assert_allclose(batch.t[k, :count], alone.t, rtol=most)
    inside = jax.jit(lambda rate: walk(rate).at(jnp.array([0.2, 0.9])))(rates[0])
    outside = walk(rates[0]).at([0.2, 0.9])
    np.testing.assert_allclose(inside.theta_1, outside.theta_1, rtol=most)
    np.testing.assert_allclose(one.t, batch.t[0], rtol=most)


@pytest.mark.slow
def test_steps_are_saved_in_the_precision_of_the_start():
    scene, state, duration = SCENES["round feet"]
    single = jax.tree.map(lambda leaf: leaf.astype(jnp.float32), state)
    walk = jb.simulate(scene, single, duration=duration, save="steps")
    fine = jb.simulate(scene, state, duration=duration, save=np.array([0.3, 0.9]))
    assert walk.t.dtype == walk.state.theta_1.dtype == jnp.float32
    between = walk.at([0.3, 0.9])
    assert between.theta_1.dtype == jnp.float32
    np.testing.assert_allclose(between.theta_1, fine.state.theta_1, atol=1e-4)
    # It is known by its scene, too.
    assert len(jb.measure.trajectory_dataset(scene, walk).time) == len(walk.t)


def test_a_long_walk_keeps_all_its_steps():
    scene, state, _ = SCENES["point feet"]
    how = dict(footsteps=1500, accuracy="tight")
    walk, plain = (jb.simulate(scene, state, save=save, **how) for save in ("steps", "end"))
    assert len(walk.t) > 1 << 14  # more than there is room for at first
    assert np.sum(np.diff(walk.t) == 0.0) == int(walk.arrivals.total) == 1500
    assert float(walk.t[-1]) == float(plain.t[-1])
    assert np.all(np.diff(walk.t) >= 0.0)


def test_extremes_are_those_of_both_sides_of_an_impact(case):
    scene, state, duration, truth = case
    walk = jb.simulate(
        scene, state, duration=duration, save="end", rtol=1e-9,
        extremes=lambda scene, state: (state.omega_1, state.hip_x),
    )  # fmt: skip
    *whole, _ = truth.footsteps
    ends = np.array([step.y[2, k] for step in whole for k in (0, -1)])
    assert float(walk.lowest[0]) <= ends.min() + 1e-6
    assert float(walk.highest[0]) >= ends.max() - 1e-6
    course = [step.sol(np.linspace(0.0, step.t[-1], 4001))[2] for step in truth.footsteps]
    assert np.min(course) - 1e-6 <= float(walk.lowest[0])
    assert float(walk.highest[0]) <= np.max(course) + 1e-6
    assert float(walk.lowest[1]) == pytest.approx(float(state.hip_x), abs=1e-12)
    assert float(walk.highest[1]) == pytest.approx(float(walk.final.hip_x), abs=1e-9)


@pytest.mark.slow
def test_both_engines_save_alike_at_times_that_crowd():
    scene, state, duration = SCENES["round feet"]
    # Several in one step, one at the start, one at the end.
    times = np.array([0.0, 0.3, 0.301, 0.302, 0.303, 1.0, 1.0, duration])
    lanes, xla = (
        jb.simulate(scene, state, duration=duration, save=times, rtol=1e-9, engine=engine)
        for engine in ("lanes", "xla")
    )
    np.testing.assert_array_equal(xla.t, times)
    for leaf, expected in zip(xla.state, lanes.state, strict=True):
        np.testing.assert_allclose(leaf, expected, atol=1e-8)

    @jax.jit
    @jax.vmap
    def many(rate):
        begin = state._replace(omega_2=rate)
        how = dict(duration=duration, save=times, rtol=1e-9, engine="xla")
        return jb.simulate(scene, begin, **how)

    batch = many(jnp.array([-1.6, 3.0]))  # the last one falls
    np.testing.assert_allclose(batch.state.theta_1[0], lanes.state.theta_1, atol=1e-8)
    assert np.isinf(batch.t[1, -1])
    assert float(batch.t[1, 0]) == 0.0
    single = jax.tree.map(lambda leaf: leaf.astype(jnp.float32), state)
    walk = jb.simulate(scene, single, duration=duration, save=times, accuracy="draft")
    assert walk.t.dtype == walk.state.theta_1.dtype == jnp.float32
    np.testing.assert_allclose(walk.state.theta_1, lanes.state.theta_1, atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("save", ["times", "section"])
def test_derivatives_are_differences_in_both_modes(save):
    scene, state, duration = SCENES["round feet"]
    save = duration * np.array([0.1, 0.45, 0.93]) if save == "times" else jb.MidStance()

    def saved(numbers):
        slope, angle = numbers
        walk = jb.simulate(
            jb.with_parameters(scene, {"slope": slope}), state._replace(theta_1=angle),
            duration=duration, save=save, max_arrivals=2, accuracy="tight",
        )  # fmt: skip
        arrived = walk.arrivals
        return jnp.concatenate([*walk.state, walk.t, *arrived.state, arrived.t])

    at, step = jnp.array([0.02, -0.25]), 1e-6
    forward, reverse = jax.jacfwd(saved)(at), jax.jacrev(saved)(at)
    moves = jnp.eye(2) * step
    differences = jnp.stack([(saved(at + d) - saved(at - d)) / (2 * step) for d in moves], axis=1)
    np.testing.assert_allclose(forward, differences, rtol=2e-5, atol=2e-5)
    np.testing.assert_allclose(reverse, forward, rtol=1e-10, atol=1e-12)


def test_states_at_times_do_not_depend_on_how_long_the_walk_goes_on():
    scene, state, duration = SCENES["round feet"]

    def saved(longest):
        walk = jb.simulate(scene, state, duration=longest, save=np.array([0.1, 0.6]))
        return jnp.stack([*walk.state, walk.t])

    np.testing.assert_array_equal(jax.jacfwd(saved)(duration), 0.0)


def test_the_end_alone_moves_with_the_duration_at_its_rates():
    scene, state, _ = SCENES["round feet"]
    for save in ("end", jb.MidStance()):

        def final(longest, save=save):
            walk = jb.simulate(scene, state, duration=longest, save=save, accuracy="tight")
            return walk.final

        rates = jb.dynamics.rolling_field(0.0, final(0.6), scene)
        np.testing.assert_allclose(jax.jacfwd(final)(0.6), rates, rtol=1e-9)


def test_a_batch_saves_what_its_walks_save():
    scene, state, duration = SCENES["round feet"]
    times = duration * np.array([0.2, 0.6, 1.0])
    rates = jnp.asarray([-1.7, -1.6, 3.0])  # the last one falls

    @jax.jit
    @jax.vmap
    def walk(rate):
        return jb.simulate(scene, state._replace(omega_2=rate), duration=duration, save=times)

    batch = walk(rates)
    assert list(np.asarray(batch.ending)) == [0, 0, int(jb.Ending.FELL_BACK)]
    for k, rate in enumerate(rates):
        one = jb.simulate(scene, state._replace(omega_2=rate), duration=duration, save=times)
        np.testing.assert_array_equal(one.t, batch.t[k])
        np.testing.assert_allclose(one.state.theta_1, batch.state.theta_1[k], rtol=1e-12)
    assert np.isinf(batch.t[2, -1])


@pytest.mark.slow
def test_a_kneed_walk_keeps_its_modes_whatever_it_saves():
    scene = jb.models.hsu_chen()
    state = jb.find_gait(scene, parameters=(), radius_sensitivities=False).measures.state
    plain = jb.simulate(scene, state, footsteps=2, save="end")
    times = np.linspace(0.0, float(plain.t[-1]), 9)
    for save in (times, jb.MidStance(), "steps"):
        walk = jb.simulate(scene, state, footsteps=2, save=save)
        assert walk.modes == plain.modes != ()
        np.testing.assert_allclose(walk.mode_durations, plain.mode_durations, rtol=1e-12)
    walk = jb.simulate(scene, state, duration=float(times[-1]), save=times)
    steps = jb.simulate(scene, state, footsteps=2, save="steps")
    for leaf, expected in zip(steps.at(times[1:-1]), walk.state, strict=True):
        np.testing.assert_allclose(leaf, expected[1:-1], atol=1e-9)
    assert np.sum(np.diff(steps.t) == 0.0) == len(plain.modes) - 1  # strikes and knees
    held = np.asarray(walk.state.theta_shank_2) - np.asarray(walk.state.theta_thigh_2)
    np.testing.assert_allclose(held, held[0], atol=1e-9)  # the stance knee is locked throughout


def test_an_error_that_is_asked_for_bounds_what_is_saved(case):
    scene, state, duration, truth = case
    times = duration * np.array([0.3, 0.8])
    walk = jb.simulate(scene, state, duration=duration, save=times, accuracy=1e-7)
    assert walk.error.met
    off = np.abs(np.stack([np.asarray(leaf) for leaf in walk.state[1:]], 1) - truth.at(times))
    bars = np.stack([np.asarray(leaf) for leaf in walk.error.bars["state"][1:]], axis=1)
    assert np.all(off <= bars + 1e-10)


def test_an_error_that_is_asked_for_bounds_each_step(case):
    scene, state, duration, truth = case
    walk = jb.simulate(scene, state, duration=duration, save="steps", accuracy=1e-7)
    assert walk.error.met
    t, bars = np.asarray(walk.t), walk.error.bars
    (strikes,) = np.nonzero(np.diff(t) == 0.0)
    off = np.abs(t[strikes] - truth.begins[1 : 1 + len(strikes)])
    assert np.all(off <= bars["t"][strikes] + 1e-11)
    off = np.abs(
        np.stack([np.asarray(leaf) for leaf in walk.state[1:]], 1)[1:-1] - truth.at(t[1:-1])
    )
    told = np.stack([np.asarray(leaf) for leaf in bars["state"][1:]], axis=1)[1:-1]
    inside = ~np.isin(t[1:-1], t[strikes])
    assert np.all(off[inside] <= told[inside] + 1e-10)


def test_what_cannot_be_saved_is_refused_in_a_sentence():
    scene, state, duration = SCENES["round feet"]

    def walk(**options):
        return jb.simulate(scene, state, duration=duration, **options)

    with pytest.raises(jb.ArgumentError, match="save = 'stepz' is not known: choose one of steps"):
        walk(save="stepz")
    with pytest.raises(jb.ArgumentError, match='save = "steps" is not allowed under derivatives'):
        jax.grad(lambda longest: jb.simulate(scene, state, duration=longest, save="steps").t[-1])(
            1.0
        )
    with pytest.raises(jb.ArgumentError, match=r"increasing times from 0 to 1\.3 s"):
        walk(save=np.array([0.5, 2.0]))
    with pytest.raises(jb.ArgumentError, match="must be known beforehand"):
        jax.jit(lambda times: walk(save=times))(jnp.array([0.5]))
    with pytest.raises(jb.ArgumentError, match="holds numbers of its own"):
        walk(save=Tilted(jnp.asarray(0.1)))
    with pytest.raises(jb.ArgumentError, match="extremes is not allowed under derivatives"):
        jax.grad(lambda rate: jb.simulate(
            scene, state._replace(omega_2=rate), duration=duration, save="end",
            extremes=lambda scene, state: state.theta_1,
        ).t[-1])(-1.6)  # fmt: skip


class Tilted(jb.hybrid.AbstractSection):
    """A section with a number of its own."""

    angle: jax.Array

    def value(self, args, y):
        return self.angle - y.theta_2

    def counts(self, args, y):
        return jnp.asarray(True)
