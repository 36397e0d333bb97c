"""Touchdown ahead, against steps in which a foot comes down and is rejected."""

import gc

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.dynamics import feet
from jaxbiped.hybrid._scales import units_of
from jaxbiped.solve.controllers import _step_size
from jaxbiped.solve.controllers._event_steps import TouchdownAhead
from jaxbiped.solve.controllers._step_size import ErrorControl

SCENE = jb.seed_scene()


def _falling(height, speed):
    """Both feet that far above the ground [m], coming down; foot 1 turns so that it may touch."""
    walker = SCENE.walker
    reach = float(walker.l - walker.r)
    state = jb.State(0.0, float(walker.r) + height + reach, 0.0, 0.0, 0.0, -speed, -0.1, 0.1)
    return jb.State(*map(jnp.asarray, state))


def _next_end(state, error, span=1e-3):
    control = ErrorControl(1e-6, 1e-8, units_of(SCENE, state))
    errors = jb.State(*(error * (1e-8 + 1e-6 * abs(leaf)) for leaf in state))
    times = jnp.asarray(0.25), jnp.asarray(0.25 + span)
    rest = (state, state, SCENE, errors, 4, jnp.asarray(False))
    plain = control.adapt_step_size(*times, *rest)
    ahead = TouchdownAhead(control, jb.hybrid.Walking()).adapt_step_size(*times, *rest)
    assert bool(plain[0]) is bool(ahead[0])
    assert plain[1] == ahead[1]
    return float(plain[2] - plain[1]), float(ahead[2] - ahead[1])


def test_the_next_attempt_ends_just_past_the_touchdown():
    state = _falling(1.5e-4, 0.3)
    assert feet(SCENE, state)[0].admitted
    plain, ahead = _next_end(state, 1e6)
    assert plain == pytest.approx(2e-4)
    assert ahead == pytest.approx(5e-4 + 0.03 * 5e-4, rel=1e-6)


@pytest.mark.parametrize(
    ("height", "speed", "error"),
    [(1.5e-4, 0.3, 0.5), (4e-4, 0.3, 1e6), (1.5e-4, -0.3, 1e6), (3e-5, 0.3, 1e6)],
    ids=["kept", "comes down later", "rises", "comes down before"],
)
def test_all_others_are_as_the_error_says(height, speed, error):
    plain, ahead = _next_end(_falling(height, speed), error)
    assert plain == pytest.approx(ahead, rel=1e-9)


def _forget_programs():
    """All, also those that jitted functions of other tests hold: they would be found again."""
    jb.clear_caches()
    jax.clear_caches()
    gc.collect()


@pytest.mark.slow
def test_touchdowns_cost_fewer_attempts_and_no_exactness(monkeypatch):
    starts = np.array([float(leaf) for leaf in jb.seed_state()])
    starts = starts * (1.0 + 1e-3 * np.random.default_rng(5).standard_normal((64, 8)))

    def walked(rtol, solver="rodas4p"):
        how = dict(duration=2.0, save="end", engine="lanes", solver=solver)

        def one(*leaves):
            walk = jb.simulate(SCENE, jb.State(*leaves), rtol=rtol, atol=1e-2 * rtol, **how)
            return jnp.stack(walk.final), walk.attempted

        ends, attempted = jax.vmap(one)(*map(jnp.asarray, starts.T))
        return np.asarray(ends), float(np.mean(attempted))

    exact, _ = walked(1e-11, "rodas5p")
    ends, attempted = walked(1e-5)
    with monkeypatch.context() as patched:
        patched.setattr(_step_size, "TouchdownAhead", lambda control, system: control)
        patched.setenv("JAXBIPED_CACHE", "")
        _forget_programs()
        plain_ends, plain = walked(1e-5)
    _forget_programs()
    assert attempted < 0.985 * plain
    error, plain_error = (np.median(np.abs(e - exact).max(1)) for e in (ends, plain_ends))
    assert error < 2.0 * plain_error < 2e-4
