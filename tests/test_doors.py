"""Public functions' doors, against what constructors and plain floats give."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb

SCENE, START = jb.seed_scene(), jb.seed_state()
RIGID, ROLLING = jb.ladder()["rigid"], jb.dynamics.rigid_state(jb.seed_state())
TWICE = {
    "int": 2,
    "NumPy integer": np.int32(2),
    "NumPy float32": np.float32(2.0),
    "JAX float32": jnp.float32(2.0),
    "JAX integer": jnp.asarray(2),
}


def short(scene, state=START, **options):
    return jb.simulate(scene, state, **{"duration": 0.02, "save": "end", **options})


def put(scene, name, value):
    """As a user does it who passes the constructors by."""
    part = "normal" if name == "K" else "walker"
    none = lambda leaf: leaf is None
    return eqx.tree_at(lambda s: getattr(getattr(s, part), name), scene, value, is_leaf=none)


DOORS = {
    "simulate": (SCENE, short),
    "redundant": (
        jb.RedundantScene(SCENE),
        lambda s: short(s, engine="lanes"),
    ),
    "rigid_walk": (RIGID, lambda s: jb.rigid_walk(s, ROLLING, footsteps=1)),
    "find_gait": (RIGID, jb.find_gait),
    "find_gaits": (RIGID, lambda s: jb.find_gaits(s, jax.tree.map(jnp.atleast_1d, ROLLING))),
    "return_map": (RIGID, lambda s: jb.return_map(s, ROLLING)),
    "gait_sweep": (RIGID, lambda s: jb.gait_sweep(s, {"slope": [0.02]})),
    "labelling": (RIGID, jb.labelling),
    "continue_gait": (RIGID, lambda s: jb.continue_gait(s, "slope", bounds=(0.01, 0.02))),
    "optimise_gait": (
        RIGID,
        lambda s: jb.optimise_gait(s, vary=dict(d=(0.1, 0.2)), maximise="speed"),
    ),
    "fit_gait": (
        RIGID,
        lambda s: jb.fit_gait(s, ("d",), jb.identify.MeasuredGait({"period": (0.4, 1e-3)})),
    ),
    "nearest_bifurcation": (
        RIGID,
        lambda s: jb.continuation.nearest_bifurcation(s, None, "slope"),
    ),
}


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("value", [np.nan, -1.0, jnp.asarray(jnp.inf), None, "1", True])
def test_a_value_that_no_constructor_saw_is_refused_as_by_one(door, value):
    scene, enter = DOORS[door]
    if scene.redundant:
        scene = eqx.tree_at(lambda s: s.scene, scene, put(scene.scene, "m", value))
    else:
        scene = put(scene, "m", value)
    with pytest.raises(jb.ArgumentError, match=r"^m = .*|^scene holds '1'|^scene holds True"):
        enter(scene)


def test_a_rule_of_two_numbers_holds_at_a_door():
    with pytest.raises(jb.ArgumentError, match=r"l = 0\.01 and r = 0\.08 are not allowed together"):
        short(put(SCENE, "l", 0.01))
    with pytest.raises(jb.ArgumentError, match="J = 0 is not allowed where hip_mass = 0"):
        short(put(SCENE, "J", 0))


@pytest.mark.parametrize("kind", TWICE)
def test_two_means_two(kind):
    two = TWICE[kind]
    plain = short(put(SCENE, "m", 2.0), duration=2.0, rtol=1e-4)
    walk = short(put(SCENE, "m", two), duration=two, rtol=1e-4, footsteps=None)
    assert (walk.engine, float(walk.t[-1])) == ("lanes", 2.0)
    assert jax.tree.all(jax.tree.map(np.array_equal, walk.final, plain.final))
    rigid = put(RIGID, "m", two)
    by_float = jb.rigid_walk(put(RIGID, "m", 2.0), ROLLING, duration=2.0).final
    by_kind = jb.rigid_walk(rigid, ROLLING, duration=two).final
    assert jax.tree.all(jax.tree.map(np.array_equal, by_kind, by_float))
    request = jb.Simulation.prepare(put(SCENE, "m", two), jb.seed_state(), duration=two)
    assert request.scene.walker.m.dtype == np.float64


def ends_alone(make, values):
    """Of values by lane the first is allowed and walks as alone; the others are not, and fail."""
    run = jax.vmap(lambda x: (lambda w: (w.ending, w.final))(make(x)))
    ending, final = run(jnp.asarray(values))
    final = jax.tree.leaves(final)
    assert [str(jb.Ending(int(x))) for x in ending] == ["walking", *["solver failed"] * 2]
    assert all(np.isnan(leaf[1:]).all() for leaf in final)
    pairs = zip(final, jax.tree.leaves(make(values[0]).final), strict=True)
    assert all(np.array_equal(a[0], b) for a, b in pairs)


LANES = {"engine": "lanes"}
TRACED = {
    "K": (lambda K: short(put(SCENE, "K", K), **LANES), [1e6, np.nan, -1e6]),
    "l": (lambda l: short(put(SCENE, "l", l), **LANES), [0.4, 0.01, np.inf]),
    "J": (lambda J: short(put(SCENE, "J", J), **LANES), [0.0096, 0.0, -0.1]),
    "duration": (lambda t: short(SCENE, duration=t, **LANES), [0.02, -1.0, np.nan]),
    "rtol": (lambda r: short(SCENE, rtol=r, **LANES), [1e-5, -1.0, np.nan]),
    "start": (
        lambda w: short(SCENE, START._replace(omega_1=w), **LANES), [-0.0052, np.nan, np.inf]
    ),
    "rigid": (
        lambda d: jb.rigid_walk(put(RIGID, "d", d), ROLLING, footsteps=1), [0.1, -0.1, np.nan]
    ),
    "rigid duration": (lambda t: jb.rigid_walk(RIGID, ROLLING, duration=t), [0.1, -0.1, np.nan]),
}  # fmt: skip


@pytest.mark.parametrize("what", TRACED)
def test_traced_it_fails_in_its_own_lane_alone(what):
    ends_alone(*TRACED[what])


def test_traced_in_redundant_coordinates_it_fails_in_its_own_lane_alone():
    redundant = jb.RedundantScene(SCENE)
    change = lambda d: eqx.tree_at(lambda s: s.scene.walker.d, redundant, d)
    ends_alone(lambda d: short(change(d), **LANES), [0.1, -0.1, np.nan])


def test_a_traced_return_of_a_scene_that_is_not_allowed_is_none():
    run = jax.vmap(lambda d: jb.return_map(put(RIGID, "d", d), ROLLING))
    found = run(jnp.asarray([0.1, -0.1, np.nan]))
    assert [jb.Ending(int(code)) for code in found.code] == [0, 6, 6]
    assert np.isnan(found.time[1:]).all()
    assert float(found.time[0]) == float(jb.return_map(RIGID, ROLLING).time)


def test_a_labelling_whose_scene_was_changed():
    label = jb.labelling(RIGID)
    starts = jax.tree.map(jnp.atleast_1d, ROLLING)
    with pytest.raises(jb.ArgumentError, match="m = -1 is not allowed"):
        eqx.tree_at(lambda made: made.scene.walker.m, label, -1.0)(starts)
    whole = eqx.tree_at(lambda made: made.scene.walker.m, label, 1)(starts)
    assert whole.label[0] == label(starts).label[0]


@pytest.mark.parametrize("value", [None, "a", True])
def test_a_leaf_of_a_start_that_is_no_number(value):
    with pytest.raises(jb.ArgumentError, match=r"state\.hip_x = .* is not a number"):
        short(SCENE, START._replace(hip_x=value))
    assert short(SCENE, START._replace(hip_x=np.longdouble(0.0))).engine == "lanes"
