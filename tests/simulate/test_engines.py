"""The two engines give the same motions, and each is refused what it cannot do."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb
from tests.reference import reference_states

SCENES = {
    "seed": jb.seed_scene(),
    "frictionless": jb.Scene(
        walker=jb.seed_scene().walker,
        ground=jb.seed_scene().ground,
        normal=jb.Hertz(K=1e6),
        friction=jb.Frictionless(),
        clearance=jb.AlwaysTouching(),
    ),
}


def _end(state, engine, scene=SCENES["seed"], **options):
    options = {"duration": 1.0, "save": "end", **options}
    return jb.simulate(scene, state, engine=engine, **options)


@given(
    st.lists(st.floats(-0.05, 0.05, allow_subnormal=False), min_size=8, max_size=8),
    st.floats(0.005, 0.04),
    st.floats(0.3, 3.0),
)
@settings(max_examples=12, deadline=None)
def test_random_scenes_and_starts_end_alike(noise, slope, factor):
    seed = jb.seed_scene(slope=slope)
    scene = jb.Scene(
        walker=seed.walker,
        ground=seed.ground,
        normal=jb.RistowSchafer(K=seed.normal.K * factor, c=seed.normal.c / factor),
        friction=seed.friction,
    )
    state = jax.tree.map(lambda leaf, n: leaf * (1.0 + n), jb.seed_state(), jb.State(*noise))
    ends = [_end(state, engine, scene, accuracy="tight") for engine in ("lanes", "xla")]
    assert ends[0].outcome == ends[1].outcome
    assert float(ends[0].t[0]) == pytest.approx(float(ends[1].t[0]), abs=1e-4)
    if ends[0].outcome == jb.Ending.WALKING:
        for a, b in zip(ends[0].final, ends[1].final, strict=True):
            assert float(a) == pytest.approx(float(b), abs=2e-6)


@pytest.mark.parametrize(
    ("name", "solver"),
    [("seed", name) for name in ("rodas3p", "rodas4p", "rodas5p")] + [("frictionless", "rodas4")],
)
def test_every_solver_and_law_agrees(name, solver):
    options = dict(duration=0.2, solver=solver, rtol=1e-8, watch=())
    ends = [_end(jb.seed_state(), e, SCENES[name], **options) for e in ("lanes", "xla")]
    assert ends[0].engine == "lanes"
    assert ends[1].engine == "xla"
    for a, b in zip(ends[0].final, ends[1].final, strict=True):
        assert float(a) == pytest.approx(float(b), abs=1e-6)


def test_lanes_agree_with_an_independent_solution():
    times, exact = reference_states()
    found = _end(jb.seed_state(), "lanes", duration=2.0, accuracy="tight", save=times).state
    np.testing.assert_allclose(np.stack(found, axis=1), exact, atol=1e-6)


def test_saved_times_and_footsteps_agree():
    times = jnp.linspace(0.0, 2.5, 6)
    options = dict(duration=2.5, steps=3, save=times, accuracy="tight")
    ours, theirs = (_end(jb.seed_state(), engine, **options) for engine in ("lanes", "xla"))
    assert ours.outcome == theirs.outcome == jb.Ending.WALKING
    np.testing.assert_array_equal(ours.t, theirs.t)
    for a, b in zip(ours.state, theirs.state, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-6)


@pytest.mark.parametrize("save", ["end", jnp.linspace(0.0, 0.5, 3)], ids=["end", "times"])
def test_lanes_under_jit_and_vmap(save):
    def run(speed):
        return _end(jb.seed_state()._replace(hip_vx=speed), "lanes", duration=0.5, save=save)

    speeds = jnp.linspace(0.4, 0.6, 11)
    eager = jax.vmap(run)(speeds)
    compiled = jax.jit(jax.vmap(run))(speeds)
    alone = [run(speed) for speed in speeds]
    jax.tree.map(np.testing.assert_array_equal, eager, compiled)
    jax.tree.map(
        lambda batch, *each: np.testing.assert_array_equal(batch, jnp.stack(each)), eager, *alone
    )


def test_batches_over_scenes_and_starts_at_once():
    def run(slope, speed):
        state = jb.seed_state()._replace(hip_vx=speed)
        return _end(state, "lanes", jb.seed_scene(slope=slope), duration=0.3).final.hip_x

    slopes, speeds = jnp.array([0.01, 0.02, 0.03]), jnp.array([0.45, 0.5])
    grid = jax.vmap(lambda a: jax.vmap(lambda b: run(a, b))(speeds))(slopes)
    assert grid.shape == (3, 2)
    np.testing.assert_array_equal(grid[1, 1], run(slopes[1], speeds[1]))


def test_auto_takes_lanes_where_it_can():
    def chosen(**options):
        options = {"duration": 1.0, "save": "end", **options}
        return jb.Simulation.prepare(jb.seed_scene(), jb.seed_state(), **options).engine

    assert chosen() == "lanes"
    assert chosen(save=jnp.linspace(0.0, 1.0, 3)) == "lanes"
    assert chosen(engine="xla") == chosen(save="steps") == chosen(solver="kvaerno3") == "xla"

    def traced(speed):
        state = jb.seed_state()._replace(hip_vx=speed)
        run = jb.Simulation.prepare(jb.seed_scene(), state, duration=1.0, save="end")
        assert run.engine == "xla"
        return speed

    jax.vmap(traced)(jnp.ones(2))


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (dict(engine="gpu"), "choose one of auto, xla, lanes"),
        (dict(engine="lanes", save="steps"), "does not save every step"),
        (dict(engine="lanes", solver="kvaerno3"), "Kvaerno3 is not one of its solvers"),
        (dict(engine="lanes", adjoint=diffrax.ForwardMode()), "an adjoint is diffrax's"),
        (dict(save=jnp.array([0.0, 2.0])), "must be increasing times from 0 to 1"),
    ],
)
def test_what_an_engine_cannot_do_is_refused_beforehand(options, reason):
    with pytest.raises(jb.ArgumentError, match=reason):
        jb.simulate(jb.seed_scene(), jb.seed_state(), **{"duration": 1.0, "save": "end", **options})


def test_lanes_compute_in_64_bits():
    state = jax.tree.map(lambda leaf: leaf.astype(jnp.float32), jb.seed_state())
    soft = jb.Scene(
        walker=jb.seed_scene().walker,
        ground=jb.seed_scene().ground,
        normal=jb.Hertz(K=1e3),
        friction=jb.Frictionless(),
    )
    with pytest.raises(jb.ArgumentError, match="it computes in 64 bits"):
        _end(state, "lanes", soft)
    run = jb.Simulation.prepare(soft, state, duration=0.01, save="end")
    assert run.engine == "xla"
