"""Walks by every kind of stepper in lanes, against diffrax's and against finer ones."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.compliant_walkers import frictionless_walker

pytestmark = pytest.mark.slow

SOFT = frictionless_walker(K=1e4)
"""Its force is smooth enough, and so little stiff, that every method follows it."""
START = jb.seed_state()
TIMES = np.linspace(0.005, 0.095, 7)
ORDERS = {"euler": 1, "runge2": 2, "bosh3": 3, "tsit5": 5, "kvaerno3": 3, "kvaerno4": 4}


def walk(**how):
    return jb.simulate(SOFT, START, **{"duration": 0.1, "save": "end", "watch": ()} | how)


def apart(a, b):
    pairs = zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True)
    return max(float(np.max(np.abs(np.asarray(x - y)))) for x, y in pairs)


@pytest.fixture(scope="module")
def truth():
    return walk(solver="rodas5p", rtol=1e-12).final


@pytest.mark.filterwarnings("ignore:dt = :RuntimeWarning")
@pytest.mark.parametrize("solver", ORDERS)
def test_order_of_convergence(solver):
    """Off the ground, where the motion is smooth."""
    high = START._replace(hip_z=START.hip_z + 1.0)
    how = dict(duration=0.4, save="end", watch=(), rtol=1e-13)
    exact = jb.simulate(SOFT, high, solver="rodas5p", **how).final
    errors = [
        apart(jb.simulate(SOFT, high, solver=solver, dt=0.4 / count, **how).final, exact)
        for count in (8, 16)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(ORDERS[solver], abs=0.4)


@pytest.mark.parametrize("solver", ["tsit5", "dopri8", "kvaerno5"])
def test_error_control_meets_the_tolerance(truth, solver):
    found = walk(solver=solver, rtol=1e-9)
    assert found.engine == "lanes"
    assert apart(found.final, truth) < 1e-6


def test_every_step_and_the_states_between(truth):
    found = walk(solver="dopri8", rtol=1e-10, save="steps")
    at_times = walk(solver="dopri8", rtol=1e-10, save=jnp.asarray(TIMES))
    assert apart(found.at(TIMES), at_times.state) < 1e-15
    exact = walk(solver="rodas5p", rtol=1e-12, save=jnp.asarray(TIMES))
    assert apart(found.at(TIMES), exact.state) < 1e-7
    assert apart(found.final, truth) < 1e-7


@pytest.mark.nightly
@pytest.mark.parametrize("solver", ["rodas4p", "euler", "dopri8"])
def test_steps_of_one_size_are_diffraxs(solver):
    """To rounding, whatever else is asked for."""
    height = lambda scene, state: state.hip_z
    how = dict(solver=solver, dt=3e-4, footsteps=1, extremes=height, save="steps")
    lanes, xla = (walk(engine=engine, **how) for engine in ("lanes", "xla"))
    np.testing.assert_allclose(lanes.t, xla.t, rtol=1e-15)
    assert apart(lanes.state, xla.state) < 1e-11
    assert apart(lanes.at(TIMES), xla.at(TIMES)) < 1e-11
    assert apart((lanes.lowest, lanes.highest), (xla.lowest, xla.highest)) < 1e-11
    assert int(lanes.missed_contacts) == int(xla.missed_contacts)
    assert (lanes.outcome, int(lanes.accepted)) == (xla.outcome, int(xla.accepted))


@pytest.mark.parametrize("how", [{"dt": 3e-4}, {"solver": "kvaerno4"}])
def test_arrivals_by_every_stepper(how):
    """At the same times as by a finer walk."""
    section = jb.Section(lambda scene, state: state.hip_x - 0.03)
    found, finer = (walk(save=section, **each) for each in (how, {"rtol": 1e-11}))
    count = int(finer.arrivals.total)
    assert int(found.arrivals.total) == count > 0
    np.testing.assert_allclose(found.arrivals.t[:count], finer.arrivals.t[:count], atol=1e-5)


def test_a_fall_ends_steps_of_one_size_behind_it():
    slow = START._replace(hip_vx=jnp.asarray(0.0))
    how = dict(duration=2.0, save="end", watch=("fall",))
    found, exact = (jb.simulate(SOFT, slow, **how, **each) for each in ({"dt": 1e-3}, {}))
    assert found.outcome is exact.outcome
    assert str(exact.outcome).startswith("fell")
    assert 0.0 <= float(found.t[-1] - exact.t[-1]) < 2e-3
