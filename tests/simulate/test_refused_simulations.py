"""Simulations that are not allowed, against one sentence before anything is compiled."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.linkages import hanging, one_leg, pinned_pendulum
from tests.rigid_walkers import rigid_seed

SCENE, STATE = jb.seed_scene(), jb.seed_state()
ROLLING = jb.dynamics.rigid_state(STATE)
STILL = hanging(0.5, rates=(0.0,))
START = hanging(0.5, -0.8, rates=(1.0, 2.0))
SEVERAL = jb.dynamics.LinkageScene(pinned_pendulum(), jb.constraints.Standard())


BY_HALVES = diffrax.HalfSolver(diffrax.Tsit5())
"""A solver that no program of lanes steps as."""


def walked(**how):
    return jb.simulate(SCENE, STATE, **{"duration": 1.0, **how})


def in_legs(**how):
    return jb.simulate(jb.RedundantScene(SCENE), STATE, duration=1.0, **how)


def rolled(**how):
    return jb.rigid_walk(rigid_seed(), ROLLING, **{"duration": 1.0, **how})


def swung(state=STILL, **how):
    scene = jb.dynamics.LinkageScene(one_leg(), jb.constraints.Index1())
    return jb.swing(scene, state, **{"times": [0.0, 3.0], **how})


def swung_by_euler(state=START, **how):
    times = jnp.linspace(0.0, 2.0, 201)
    return jb.swing(SEVERAL, state, **{"times": times, "solver": "euler", "dt": 1e-3, **how})


OF_EITHER_KIND = [
    (dict(duration=-1.0), "duration = -1 is not allowed: it must be a finite number above 0"),
    (dict(duration=np.nan), "duration = nan is not allowed"),
    (dict(duration=np.inf), "duration = inf is not allowed: it must be a finite number"),
    (dict(duration="1"), "duration = '1' is not a number"),
    (dict(duration=None), "duration = None and footsteps = None: give one of them"),
    (dict(footsteps=0), "footsteps = 0 is not allowed: it must be a whole number above 0"),
    (dict(footsteps=1.5), "footsteps = 1.5 is not allowed: it must be a whole number above 0"),
    (dict(footsteps="3"), "footsteps = '3' is not a number"),
    (dict(footsteps=True), "footsteps = True is not a number"),
    (dict(rtol=0.0), "rtol = 0 is not allowed"),
    (dict(max_solver_steps=0), "max_solver_steps = 0 is not allowed"),
    (dict(max_solver_steps=9.5), "max_solver_steps = 9.5 is not allowed: it must be a whole"),
    (dict(engine="gpu"), "engine = 'gpu' is not known: choose one of auto, xla, lanes"),
    (dict(accuracy="fine"), "accuracy = 'fine' is not known: choose one of draft, balanced, tight"),
    (dict(accuracy=0.0), "accuracy = 0 is not allowed"),
    (dict(accuracy=float("nan")), "accuracy = nan is not allowed"),
    (dict(accuracy=True), "accuracy = True is not a number"),
    (dict(accuracy=1e-3, rtol=1e-6), "rtol = 1e-06 is not allowed beside accuracy = 0.001"),
]
CASES = [
    *((door, how, said) for door in (walked, rolled) for how, said in OF_EITHER_KIND),
    (
        walked,
        dict(solver="euler9"),
        "solver = 'euler9' is not known: choose one of rodas3p, rodas4",
    ),
    (walked, dict(atol=-1e-9), "atol = -1e-09 is not allowed"),
    (walked, dict(max_arrivals=0), "max_arrivals = 0 is not allowed"),
    (walked, dict(save=jb.MidStance(), max_arrivals=0), "max_arrivals = 0 is not allowed"),
    (
        walked,
        dict(watch=("falls",)),
        "watch = 'falls' is not known: choose one of fall, stop, stumble",
    ),
    (walked, dict(save="last"), "save = 'last' is not known: choose one of steps, end"),
    (walked, dict(save=jnp.array([0.2, 0.1])), "save"),
    (walked, dict(save=jnp.array([0.1, 0.3, 0.2])), "must be increasing times from 0 to 1"),
    (walked, dict(save=jnp.array([-0.1, 0.3])), "must be increasing times from 0 to 1"),
    (walked, dict(save=jnp.array([[0.1, 0.3]])), "must be increasing times from 0 to 1"),
    (walked, dict(save=jnp.array([0.5, 1.5])), "must be increasing times from 0 to 1"),
    (walked, dict(save=jb.MidStance(), engine="fast"), "choose one of auto, xla, lanes"),
    (walked, dict(engine="lanes", solver=BY_HALVES), "HalfSolver is not one of its solvers"),
    (walked, dict(engine="lanes", adjoint=diffrax.ForwardMode()), "an adjoint is diffrax's"),
    (walked, dict(save=jb.HeelStrike(), solver=BY_HALVES), "HalfSolver is not one"),
    (walked, dict(accuracy=1e-3, dt=1e-6), "dt = 1e-06 is not allowed beside accuracy"),
    (in_legs, dict(solver="euler"), "dt = None is not allowed for solver = euler"),
    (in_legs, dict(dt=0.0), "dt = 0 is not allowed"),
    (in_legs, dict(dt=1e-9), "more than max_solver_steps = 65536"),
    (in_legs, dict(engine="lanes", solver=BY_HALVES), "HalfSolver is not one of its solvers"),
    (swung, dict(times=3.0), "times = 3"),
    (swung, dict(times=[]), "1 or more increasing numbers"),
    (swung, dict(times=[2.0, 1.0, 3.0]), "increasing numbers"),
    (swung, dict(times=[-1.0, 3.0]), "times = -1"),
    (swung, dict(times=[1.0, np.nan]), "times = nan"),
    (swung, dict(state=STILL._replace(q=(5.0, 5.0, 0.5))), "7.1 m off its joints"),
    (
        swung,
        dict(state=STILL._replace(q=(0.0, 0.0))),
        "state.q has 2 entries: this linkage has 3 coordinates",
    ),
    (
        swung,
        dict(state=STILL._replace(q=(0.0,) * 4)),
        "state.q has 4 entries: this linkage has 3 coordinates",
    ),
    (swung_by_euler, dict(dt=None), "dt = None is not allowed for solver = euler"),
    (swung_by_euler, dict(dt=-1e-3), "dt = -0.001 is not allowed"),
    (swung_by_euler, dict(dt=1e-9), "more than max_solver_steps"),
    (
        swung_by_euler,
        dict(state=jb.dynamics.LinkageState((0.0,), (0.0,))),
        "this linkage has 6 coordinates",
    ),
]


@pytest.mark.parametrize(("simulation", "how", "said"), CASES)
def test_what_is_not_allowed_is_one_sentence(simulation, how, said):
    with pytest.raises(jb.ArgumentError) as refused:
        simulation(**how)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


NOSE = jb.MidStance(body="nose")


@pytest.mark.parametrize(
    ("scene", "state", "how", "said"),
    [
        (rigid_seed(), ROLLING, dict(solver="kvaerno5"), "choose one of bosh3, tsit5, dopri5"),
        (rigid_seed(), ROLLING, dict(solver=3), "solver = 3 is not allowed for a RigidScene"),
        (
            rigid_seed(),
            ROLLING,
            dict(solver="euler"),
            "dt = None is not allowed for solver = euler",
        ),
        (rigid_seed(), ROLLING, dict(atol=jnp.ones(2)), "is not allowed for a Rigid"),
        (rigid_seed(), ROLLING, dict(dt=jnp.ones(2), duration=0.1), "dt has the shape (2,)"),
        (rigid_seed(), ROLLING, dict(dt=-1e-3, duration=0.1), "dt = -0.001 is not allowed"),
        (rigid_seed(), ROLLING, dict(dt=1e-7, duration=0.1), "are more than max_solver_steps"),
        (
            rigid_seed(),
            ROLLING,
            dict(watch=("falls",), duration=0.1),
            "watch = 'falls' is not known",
        ),
        (rigid_seed(), ROLLING, dict(save=NOSE, duration=0.1), "section.body = 'nose'"),
        (SCENE, STATE, dict(save=NOSE, duration=0.1), "section.body = 'nose'"),
        (SEVERAL, START, dict(save=[1.0], footsteps=3), "footsteps = 3 is not allowed for a Link"),
        (SEVERAL, START, dict(), "duration = None and footsteps = None: give one of them"),
        (SEVERAL, START, dict(save=jb.MidStance(), duration=1.0), "give a Section"),
        (SCENE, STATE, dict(save=[[0.1], [0.2, 0.3]]), "save = [[0.1], [0.2, 0.3]] is not allowed"),
        (SCENE, STATE, dict(save=["soon", "late"]), "save = ['soon', 'late'] is not allowed"),
    ],
)
def test_options_of_other_kinds_of_scene_are_refused(scene, state, how, said):
    with pytest.raises(jb.ArgumentError) as refused:
        jb.simulate(scene, state, **how)
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("door", "scene", "state", "how", "kind"),
    [
        (jb.rigid_walk, SCENE, STATE, dict(duration=0.01), "RigidScene"),
        (jb.rigid_walk, SEVERAL, START, dict(duration=0.01), "RigidScene"),
        (jb.swing, SCENE, STATE, dict(times=[0.01]), "LinkageScene"),
        (jb.swing, rigid_seed(), ROLLING, dict(times=[0.01]), "LinkageScene"),
    ],
)
def test_doors_of_one_kind_of_scene_refuse_the_others(door, scene, state, how, kind):
    with pytest.raises(jb.ArgumentError, match=rf"^scene = .*: it must be a {kind}\.$"):
        door(scene, state, **how)


@pytest.mark.parametrize(("walk", "start"), [(jb.simulate, STATE), (jb.rigid_walk, ROLLING)])
def test_an_accuracy_by_a_number_is_refused_where_nothing_is_known_yet(walk, start):
    scene = SCENE if walk is jb.simulate else rigid_seed()

    def walked(angle):
        return walk(scene, start._replace(theta_1=angle), footsteps=1, accuracy=1e-3).t

    with pytest.raises(jb.ArgumentError, match="under jit, vmap or differentiation"):
        jax.jit(walked)(-0.25)


@pytest.mark.parametrize("times", [[0.0, 1.0], [0.5, 0.5], [1.0], []])
def test_times_from_the_first_to_the_last_moment_are_allowed(times):
    jb.Simulation.prepare(SCENE, STATE, duration=1.0, save=jnp.array(times))
