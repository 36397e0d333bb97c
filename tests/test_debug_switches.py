"""Public functions under JAX's debugging switches, against what they give without."""

import contextlib
import tempfile

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.mechanisms import scene_of, start_of

pytestmark = pytest.mark.slow

SCENE, START = jb.seed_scene(), jb.seed_state()
RIGID, ROLLING = jb.ladder()["rigid"], jb.dynamics.rigid_state(START)
KNEED = jb.models.hsu_chen()
BENT = KNEED.state(**next(iter(jb.models.MODELS["hsu-chen"].starts.values())))
TORSO = scene_of("torso")
SWITCHES = {
    "debug_nans": True,
    "numpy_rank_promotion": "raise",
    "numpy_dtype_promotion": "strict",
    "check_tracer_leaks": True,
    "enable_checks": True,
}


def _walk():
    return jb.simulate(SCENE, START, duration=0.02, accuracy="draft")


def _rolled():
    return jb.rigid_walk(RIGID, ROLLING, footsteps=2, max_arrivals=2)


def _numbers_of(steps):
    return {name: column for name, column in vars(steps).items() if column.dtype == float}


def _many(state):
    return jax.tree.map(lambda leaf: np.full(2, float(leaf)), state)


def _pendulum():
    body = jb.constraints.LinkBody(mass=1.0, inertia=0.0096)
    joint = jb.constraints.Pin((0.0, 0.1), (0.0, 0.0), 0)
    linkage = jb.constraints.Linkage((body,), (joint,))
    start = jb.dynamics.LinkageState((0.1 * np.sin(0.5), -0.1 * np.cos(0.5), 0.5), (0.0,) * 3)
    scene = jb.dynamics.LinkageScene(linkage, jb.constraints.Index1())
    return jb.swing(scene, start, times=np.array([0.0, 0.1])).state


def _of_stiffness(K):
    scene = jb.with_parameters(SCENE, {"K": K})
    return jb.simulate(scene, START, duration=0.02, save="end", engine="lanes")


def _best():
    how = dict(vary={"d": (0.09, 0.11)}, maximise="speed", iterations=2)
    return jb.optimise_gait(RIGID, **how)


def _loaded():
    with tempfile.TemporaryDirectory() as folder:
        jb.save(f"{folder}/gait.npz", jb.find_gait(RIGID))
        return jb.load(f"{folder}/gait.npz").measures


CALLS = {
    "simulate": lambda: _walk().state,
    "simulate to an error": lambda: (
        jb.simulate(SCENE, START, duration=0.02, accuracy=1e-3, save="end").final
    ),
    "simulate to a section": lambda: jb.simulate(
        SCENE, START, duration=0.5, save=jb.HeelStrike(), accuracy="draft"
    ).arrivals.t[:1],
    "redundant": lambda: (
        jb.simulate(
            jb.RedundantScene(SCENE), START, duration=0.02, save="end", engine="lanes"
        ).final
    ),
    "vmap": lambda: jax.vmap(lambda K: _of_stiffness(K).final)(jnp.asarray([1e6, 2e6])),
    "a lane that fails": lambda: jax.vmap(lambda K: _of_stiffness(K).ending)(
        jnp.asarray([1e6, -1.0])
    ),
    "footsteps": lambda: _numbers_of(jb.footsteps(SCENE, _walk())),
    "energy_ledger": lambda: jb.measure.energy_ledger(SCENE, _walk()),
    "trajectory_dataset": lambda: jb.measure.trajectory_dataset(SCENE, _walk()).hip_x.values,
    "view": lambda: len(jb.plot.view(SCENE, _walk()).html()) > 0,
    "rigid_walk": lambda: _rolled().state,
    "rigid_ledger": lambda: jb.measure.rigid_ledger(RIGID, _rolled()),
    "return_map": lambda: jb.return_map(RIGID, ROLLING),
    "its derivative": lambda: jax.jacfwd(
        lambda w: jb.return_map(RIGID, ROLLING._replace(omega_1=w)).time
    )(ROLLING.omega_1),
    "find_gait": lambda: jb.find_gait(RIGID).measures,
    "find_gait to an error": lambda: jb.find_gait(RIGID, accuracy=1e-4).measures,
    "find_gaits": lambda: jb.find_gaits(RIGID, jb.gait.rolling_starts(RIGID, 2)).reached,
    "labelling": lambda: jb.labelling(RIGID)(_many(ROLLING)).label,
    "sweep": lambda: (
        jb.sweep(
            jb.labelling(RIGID), jb.starts.grid(RIGID, {"omega_swing": [0.0, 1.0]})
        ).label.values
    ),
    "gait_sweep": lambda: jb.gait_sweep(RIGID, {"slope": [0.02, 0.021]}).period.values,
    "continue_gait": lambda: jb.continue_gait(RIGID, "slope", bounds=(0.0199, 0.0201)).values,
    "fit_gait": lambda: (
        jb.fit_gait(
            jb.with_parameters(RIGID, {"J": 0.0097}),
            ("J",),
            jb.identify.MeasuredGait({"period": (0.44378, 1e-4)}),
        ).estimates
    ),
    "optimise_gait": lambda: _best().variables,
    "certify": lambda: jb.optimise.certify(_best(), starts=4).optimality,
    "nearest_bifurcation": lambda: jb.continuation.nearest_bifurcation(
        RIGID, jb.find_gait(RIGID), "slope"
    ),
    "a mechanism": lambda: (
        jb.simulate(
            TORSO, start_of("torso", TORSO), duration=0.02, save="end", accuracy="draft"
        ).final
    ),
    "locking knees": lambda: jb.simulate(KNEED, BENT, footsteps=1).final,
    "their derivative": lambda: jax.jacfwd(
        lambda slope: (
            jb.simulate(jb.with_parameters(KNEED, {"slope": slope}), BENT, footsteps=1).final
        )
    )(jnp.asarray(0.0504)),
    "save and load": _loaded,
    "swing": _pendulum,
}


def _alike(a, b):
    words = np.asarray(a).dtype.kind == "U"  # names of legs
    return np.array_equal(a, b) if words else np.allclose(a, b, equal_nan=True)


@pytest.mark.parametrize("name", CALLS)
def test_switches_change_nothing(name):
    call = CALLS[name]
    plain = call()
    with contextlib.ExitStack() as on:
        for switch, value in SWITCHES.items():
            on.enter_context(getattr(jax, switch)(value))
        found = call()
    assert jax.tree.all(jax.tree.map(_alike, found, plain))


def test_the_user_s_own_code_is_still_looked_at():
    with jax.debug_nans(True), pytest.raises(FloatingPointError):
        jnp.log(-jb.find_gait(RIGID).measures.period).block_until_ready()
    assert eqx.tree_equal(jb.find_gait(RIGID).measures, CALLS["find_gait"]())
