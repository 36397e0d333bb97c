"""The two engines, against each other; each is refused what it cannot do."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb
from tests.compliant_walkers import frictionless_walker
from tests.unknown_to_lanes import ErrorFunction

pytestmark = pytest.mark.slow

SEED, START = jb.seed_scene(), jb.seed_state()


def _end(state, engine, scene=SEED, **options):
    options = {"duration": 1.0, "save": "end", **options}
    return jb.simulate(scene, state, engine=engine, **options)


def _both(scene=SEED, state=START, **options):
    """By lanes and by XLA."""
    walks = [_end(state, engine, scene, **options) for engine in ("lanes", "xla")]
    assert [walk.engine for walk in walks] == ["lanes", "xla"]
    return walks


@given(
    st.lists(st.floats(-0.05, 0.05, allow_subnormal=False), min_size=8, max_size=8),
    st.floats(0.005, 0.04),
    st.floats(0.3, 3.0),
)
@settings(max_examples=12, deadline=None)
def test_random_scenes_and_starts_end_alike(noise, slope, factor):
    normal = SEED.normal
    scene = jb.seed_scene(slope=slope, K=normal.K * factor, c=normal.c / factor)
    state = jax.tree.map(lambda leaf, n: leaf * (1.0 + n), START, jb.State(*noise))
    ends = _both(scene, state, accuracy="tight")
    assert ends[0].outcome == ends[1].outcome
    # A fall is noticed where a step ends, and the engines' steps are not the same.
    assert float(ends[0].t[0]) == pytest.approx(float(ends[1].t[0]), abs=3e-3)
    if ends[0].outcome == jb.Ending.WALKING:
        for a, b in zip(ends[0].final, ends[1].final, strict=True):
            assert float(a) == pytest.approx(float(b), abs=2e-6)


@pytest.mark.nightly
def test_saved_times_and_footsteps_agree():
    times = jnp.linspace(0.0, 2.5, 6)
    options = dict(duration=2.5, footsteps=3, save=times, accuracy="tight")
    ours, theirs = _both(**options)
    assert ours.outcome == theirs.outcome == jb.Ending.WALKING
    np.testing.assert_array_equal(ours.t, theirs.t)
    np.testing.assert_allclose(ours.state, theirs.state, atol=1e-6)


def test_lanes_under_jit_and_vmap():
    times = jnp.linspace(0.0, 0.5, 3)

    def run(speed):
        return _end(START._replace(hip_vx=speed), "lanes", duration=0.5, save=times)

    speeds = jnp.linspace(0.4, 0.6, 11)
    eager = jax.vmap(run)(speeds)
    compiled = jax.jit(jax.vmap(run))(speeds)
    alone = [run(speed) for speed in speeds]
    jax.tree.map(np.testing.assert_array_equal, eager, compiled)
    jax.tree.map(
        lambda batch, *each: np.testing.assert_array_equal(batch, jnp.stack(each)), eager, *alone
    )


def test_every_step_and_the_motion_between_them_agree():
    times = np.linspace(0.0, 0.5, 101)
    ours, theirs = _both(duration=0.5, rtol=1e-8, save="steps")
    np.testing.assert_allclose(np.stack(ours.at(times)), np.stack(theirs.at(times)), atol=2e-7)
    for walk in (ours, theirs):
        assert walk.t.shape == (int(walk.accepted) + 1,) == walk.state.hip_x.shape
        assert (float(walk.t[0]), float(walk.t[-1])) == (0.0, 0.5)
        assert walk.at(walk.t[0]) == START
        with pytest.raises(jb.ArgumentError, match=r"t = 0\.6 is not allowed"):
            walk.at(0.6)


def test_rounding_alone_makes_the_engines_steps_differ():
    walks = _both(duration=0.5, save="steps")
    first = [np.diff(walk.t)[:10] for walk in walks]
    np.testing.assert_allclose(*first, rtol=1e-6)
    counts = [int(walk.accepted) for walk in walks]
    nudged = START._replace(theta_1=np.nextafter(float(START.theta_1), 1.0))
    other = _end(nudged, "lanes", duration=0.5, save="steps")
    assert max(abs(count - int(other.accepted)) for count in counts) < 20
    for walk in (walks[1], other):
        np.testing.assert_allclose(walk.final, walks[0].final, atol=1e-5)


@pytest.mark.parametrize("solver", ["rodas3p", "rodas4", "rodas4p", "rodas5p"])
def test_the_motion_between_steps_is_the_independent_solutions(solver, reference):
    times, exact = reference
    walk = _end(START, "lanes", duration=2.0, solver=solver, rtol=1e-8, save="steps")
    np.testing.assert_allclose(np.stack(walk.at(times), axis=1), exact, atol=3e-5)
    # The end of a step is the continuous solution there.
    np.testing.assert_allclose(np.stack(walk.at(walk.t)), np.stack(walk.state), atol=1e-14)


def test_every_step_ends_where_the_end_alone_does():
    options = dict(duration=3.0, footsteps=2)
    end, steps = (_end(START, "lanes", save=s, **options) for s in ("end", "steps"))
    assert end.final == steps.final
    assert end.outcome == steps.outcome == jb.Ending.WALKING
    assert (int(end.accepted), int(end.rejected)) == (int(steps.accepted), int(steps.rejected))
    fallen = _end(START, "lanes", jb.seed_scene(slope=0.04), duration=9.0, save="steps")
    assert fallen.outcome == jb.Ending.FELL_FORWARD
    few = _end(START, "lanes", save="steps", max_solver_steps=5)
    assert few.outcome == jb.Ending.OUT_OF_STEPS
    assert len(few.t) == 1 + int(few.accepted) <= 6
    nothing = _end(START._replace(omega_1=1e200), "lanes", save="steps")
    assert nothing.outcome == jb.Ending.SOLVER_FAILED


def test_without_a_step_there_is_the_start():
    nothing = _end(START, "lanes", save="steps", rtol=1e-12, max_solver_steps=1)
    assert (nothing.outcome, int(nothing.accepted)) == (jb.Ending.OUT_OF_STEPS, 0)
    assert nothing.t.shape == (1,)
    assert float(nothing.at(0.0).hip_z) == float(nothing.state.hip_z[0]) == START.hip_z
    with pytest.raises(ValueError, match=r"lasts from 0\.0 to 0\.0 s"):
        nothing.at(0.1)


def test_bristles_are_saved_step_by_step():
    law = jb.laws.LuGre(mu_static=0.5, mu_kinetic=0.4, v_s=1e-3, sigma_0=5e4, sigma_1=100.0)
    scene = eqx.tree_at(lambda s: s.friction, SEED, law)
    times = jnp.linspace(0.0, 0.1, 31)
    steps, timed = (_end(START, "lanes", scene, save=s) for s in ("steps", times))
    assert len(steps.at(times)) == 10
    np.testing.assert_allclose(np.stack(steps.at(times)), np.stack(timed.state), atol=1e-13)


@pytest.mark.parametrize("transform", [jax.jit, jax.jacfwd])
def test_what_is_traced_is_not_saved_step_by_step_by_lanes(transform):
    def run(speed):
        return _end(START._replace(hip_vx=speed), "lanes", save="steps").final.hip_x

    with pytest.raises(jb.ArgumentError, match="under jit, vmap or derivatives"):
        transform(run)(0.5)


def test_batches_over_scenes_and_starts_at_once():
    def run(slope, speed):
        state = START._replace(hip_vx=speed)
        return _end(state, "lanes", jb.seed_scene(slope=slope), duration=0.3).final.hip_x

    slopes, speeds = jnp.array([0.01, 0.02, 0.03]), jnp.array([0.45, 0.5])
    grid = jax.vmap(lambda a: jax.vmap(lambda b: run(a, b))(speeds))(slopes)
    assert grid.shape == (3, 2)
    np.testing.assert_array_equal(grid[1, 1], run(slopes[1], speeds[1]))


def test_auto_takes_lanes_where_it_can():
    def chosen(**options):
        options = {"duration": 1.0, "save": "end", **options}
        return jb.Simulation.prepare(SEED, START, **options).engine

    assert chosen() == "lanes"
    assert chosen(save=jnp.linspace(0.0, 1.0, 3)) == "lanes"
    assert chosen(save="steps") == "lanes"
    assert chosen(dt=1e-4) == chosen(solver="tsit5") == chosen(solver="kvaerno3") == "lanes"
    assert chosen(engine="xla") == chosen(solver=diffrax.HalfSolver(diffrax.Tsit5())) == "xla"

    def traced(speed):
        state = START._replace(hip_vx=speed)
        run = jb.Simulation.prepare(SEED, state, duration=1.0, save="end")
        assert run.engine == "lanes"
        return speed

    jax.vmap(traced)(jnp.ones(2))


def test_lanes_compute_in_64_bits():
    state = jax.tree.map(lambda leaf: leaf.astype(jnp.float32), START)
    soft = frictionless_walker(K=1e3)
    with pytest.raises(jb.ArgumentError, match="it computes in 64 bits"):
        _end(state, "lanes", soft)
    run = jb.Simulation.prepare(soft, state, duration=0.01, save="end")
    assert run.engine == "xla"


def test_auto_leaves_to_xla_what_lanes_cannot_express():
    scene = eqx.tree_at(lambda s: s.friction, SEED, ErrorFunction(mu=0.5))
    how = dict(duration=1e-5, save="steps", solver="euler", dt=1e-6)
    walk = _end(START, "auto", scene, **how)
    assert (walk.engine, walk.outcome) == ("xla", jb.Ending.WALKING)
    with pytest.raises(jb.ArgumentError, match="'erf'"):
        _end(START, "lanes", scene, **how)


def test_memory_is_asked_for_by_the_steps_taken():
    """A cap that no memory could hold; and steps that do not fit into the first room."""
    few = jb.simulate(SEED, START, duration=0.1)
    capped = jb.simulate(SEED, START, duration=0.1, max_solver_steps=1 << 50)
    np.testing.assert_array_equal(np.array(capped.t), np.array(few.t))
    np.testing.assert_array_equal(np.array(capped.at(0.05)), np.array(few.at(0.05)))
    how = dict(duration=7.0, rtol=1e-13, max_solver_steps=1 << 20)
    many, end = (jb.simulate(SEED, START, save=save, **how) for save in ("steps", "end"))
    assert int(many.accepted) > 1 << 18
    np.testing.assert_array_equal(np.array(many.final), np.array(end.final))
    assert many.t.shape == (int(many.accepted) + 1,)
