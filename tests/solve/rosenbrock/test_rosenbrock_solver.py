"""Rosenbrock solvers in diffrax, against closed forms: gradients, events, batches."""

from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest

import jaxbiped as jb

CONTROLLER = diffrax.PIDController(rtol=1e-8, atol=1e-8)
END = 1.5
SPRING = 4.0


class Oscillator(NamedTuple):
    x: Any
    v: Any


def spring(t, y, k):
    return Oscillator(y.v, -k * y.x)


START = Oscillator(jnp.asarray(1.0), jnp.asarray(0.0))


def _exact(t, k=SPRING):
    w = np.sqrt(k)
    return Oscillator(np.cos(w * t), -w * np.sin(w * t))


def _solve(
    y0=START, k=SPRING, t0=0.0, t1=END, *, field=spring, dt0=0.01, controller=CONTROLLER, **options
):
    dt0 = dt0 if t1 > t0 else -dt0
    how = dict(stepsize_controller=controller, max_steps=256) | options
    term, solver = diffrax.ODETerm(field), jb.solvers.Rodas4()
    return diffrax.diffeqsolve(term, solver, t0, t1, dt0, y0, jnp.asarray(k), **how)


def _assert_close(mine, truth, tolerance=2e-7):
    for a, b in zip(mine, truth, strict=True):
        np.testing.assert_allclose(a, b, rtol=tolerance, atol=tolerance)


# Every adjoint against x(T) = x0 cos(√k T), for both the start x0 and the stiffness k.

TRUE_GRADIENT = (
    np.cos(np.sqrt(SPRING) * END),
    -END / (2.0 * np.sqrt(SPRING)) * np.sin(np.sqrt(SPRING) * END),
)


def _final_x(adjoint):
    def final(x0, k):
        return _solve(Oscillator(x0, jnp.zeros_like(x0)), k, adjoint=adjoint).ys.x[0]

    return final


POINT = (jnp.asarray(1.0), jnp.asarray(SPRING))


BACKSOLVE = diffrax.BacksolveAdjoint(solver=jb.solvers.Rodas4(), stepsize_controller=CONTROLLER)


@pytest.mark.parametrize(
    ("transform", "adjoint"),
    [
        *(
            pytest.param(jax.grad, each, marks=pytest.mark.slow)
            for each in (diffrax.RecursiveCheckpointAdjoint(), BACKSOLVE)
        ),
        (jax.jacfwd, diffrax.ForwardMode()),
    ],
    ids=lambda each: getattr(each, "__name__", type(each).__name__),
)
def test_derivatives_by_every_adjoint(transform, adjoint):
    found = jax.jit(transform(_final_x(adjoint), argnums=(0, 1)))(*POINT)
    np.testing.assert_allclose(found, TRUE_GRADIENT, rtol=1e-6)


# What is saved.


@pytest.fixture(scope="module")
def saved():
    """Everything saved at once: given times, every step, dense output."""
    times = jnp.linspace(0.02, END, 37)
    subs = {
        "ts": diffrax.SubSaveAt(ts=times),
        "steps": diffrax.SubSaveAt(t0=True, steps=True),
        "end": diffrax.SubSaveAt(t1=True),
    }
    return eqx.filter_jit(_solve)(saveat=diffrax.SaveAt(subs=subs, dense=True))


def test_saved_at_times_and_steps(saved):
    _assert_close(saved.ys["ts"], _exact(np.asarray(saved.ts["ts"])))
    number = int(saved.stats["num_accepted_steps"]) + 1
    times = np.asarray(saved.ts["steps"])
    assert np.isfinite(times).sum() == number > 20
    _assert_close([y[:number] for y in saved.ys["steps"]], _exact(times[:number]))
    assert saved.ts["end"][0] == END


def test_dense_output(saved):
    """Equal to SaveAt(ts) and continuous from step to step."""
    dense = jax.vmap(saved.evaluate)(saved.ts["ts"])
    _assert_close(dense, saved.ys["ts"], 1e-14)
    steps = saved.ts["steps"][1:20]
    left, right = (jax.vmap(lambda t, s=s: saved.evaluate(t, left=s))(steps) for s in (True, False))
    _assert_close(left, right, 1e-14)
    _assert_close(left, [y[1:20] for y in saved.ys["steps"]], 1e-14)


def _interpolation(t0, t1, *values):
    return jb.solvers.RosenbrockInterpolation(
        t0=jnp.asarray(t0),
        t1=jnp.asarray(t1),
        y0=(jnp.asarray(values[0]),),
        y1=(jnp.asarray(values[1]),),
        coefficients=tuple((jnp.asarray(value),) for value in values[2:]),
    )


def test_interpolation_by_hand():
    """y0 = 2, y1 = 5, k = (3, 7, 11) at θ = 1/4: 6/4 + (5 + 3/4 (3 + 1/4 (7 + 11/4)))/4."""
    interpolation = _interpolation(1.0, 3.0, 2.0, 5.0, 3.0, 7.0, 11.0)
    value = 1.5 + 0.25 * (5.0 + 0.75 * (3.0 + 0.25 * (7.0 + 0.25 * 11.0)))
    _assert_close(interpolation.evaluate(jnp.asarray(1.5)), (value,), 1e-15)
    difference = interpolation.evaluate(jnp.asarray(1.0), jnp.asarray(1.5))
    _assert_close(difference, (value - 2.0,), 1e-15)
    _assert_close(_interpolation(1.0, 1.0, 2.0, 2.0, 0.0).evaluate(jnp.asarray(1.0)), (2.0,), 0.0)


def test_backwards_in_time():
    times = np.array([1.2, 0.7, 0.1])
    start = Oscillator(*map(jnp.asarray, _exact(END)))
    solution = _solve(start, t0=END, t1=0.0, saveat=diffrax.SaveAt(ts=times, t1=True))
    _assert_close(solution.ys, _exact(np.append(times, 0.0)))


def test_a_driving_force_forwards_and_backwards():
    """y' = −2 (y − cos t): backwards, the time derivative's sign must follow."""

    def exact(t):
        return (4.0 * jnp.cos(t) + 2.0 * jnp.sin(t)) / 5.0

    def field(t, y, _):
        return -2.0 * (y - jnp.cos(t))

    how = dict(field=field, dt0=1.0 / 64.0, controller=diffrax.ConstantStepSize())
    for t0, t1 in ((0.0, 1.0), (1.0, 0.0)):
        end = _solve(exact(jnp.asarray(t0)), t0=t0, t1=t1, **how).ys[0]
        np.testing.assert_allclose(end, exact(t1), atol=2e-9)


# Events.


def test_an_event_and_the_gradient_of_its_time():
    """x = cos √k t is zero first at t = π / (2 √k), where v = −√k."""

    def time(k):
        event = diffrax.Event(lambda t, y, args, **_: y.x, optx.Newton(1e-10, 1e-10))
        solution = _solve(k=k, event=event, adjoint=diffrax.ForwardMode())
        return solution.ts[0], solution

    slope, solution = jax.jacfwd(time, has_aux=True)(jnp.asarray(SPRING))
    assert solution.result == diffrax.RESULTS.event_occurred
    np.testing.assert_allclose(solution.ts[0], np.pi / 4.0, rtol=1e-7)
    _assert_close([y[0] for y in solution.ys], (0.0, -2.0))
    np.testing.assert_allclose(slope, -np.pi / 4.0 * SPRING**-1.5, rtol=1e-6)


# Types and batches.


def test_32_bits():
    x0, v0, k, t0, t1, dt0 = (
        jnp.asarray(x, jnp.float32) for x in (1.0, 0.0, SPRING, 0.0, END, 0.01)
    )
    solution = _solve(
        Oscillator(x0, v0),
        k,
        t0,
        t1,
        dt0=dt0,
        controller=diffrax.PIDController(rtol=1e-4, atol=1e-4),
        saveat=diffrax.SaveAt(ts=jnp.linspace(0.1, 1.4, 9, dtype=jnp.float32)),
    )
    assert {leaf.dtype for leaf in solution.ys} == {np.dtype("float32")}
    _assert_close(solution.ys, _exact(np.asarray(solution.ts, np.float64)), 1e-3)


def _lane(x0, k):
    solution = _solve(
        Oscillator(x0, jnp.zeros_like(x0)),
        k,
        max_steps=1024,
        controller=diffrax.PIDController(rtol=1e-8, atol=1e-8, dtmin=1e-12, force_dtmin=False),
        throw=False,
    )
    return solution.ys, solution.stats["num_steps"], solution.result


_one, _batch = jax.jit(_lane), jax.jit(jax.vmap(_lane))
X0, K = jnp.array([1.0, -0.3, 2.0, 0.7]), jnp.array([0.1, 4.0, 30.0, 100.0])


def test_a_batch_equals_its_members():
    ys, steps, results = _batch(X0, K)
    assert jnp.all(results == diffrax.RESULTS.successful)
    assert len(set(steps.tolist())) == 4
    for i in range(4):
        alone, alone_steps, _ = _one(X0[i], K[i])
        assert alone_steps == steps[i]
        _assert_close([y[i] for y in ys], alone, 1e-12)
    truth = np.asarray(X0) * np.cos(np.sqrt(np.asarray(K)) * END)
    np.testing.assert_allclose(ys.x[:, 0], truth, atol=5e-6)


@pytest.mark.parametrize("where", ["field", "start"])
def test_a_lane_of_nan_fails_alone(where):
    """Rates that are no numbers shrink the step to dtmin.

    A start that is none makes diffrax's controller take steps of NaN, up to max_steps.
    """
    x0, k = (X0.at[2].set(jnp.nan), K) if where == "start" else (X0, K.at[2].set(jnp.nan))
    clean, clean_steps, _ = _batch(X0, K)
    ys, steps, results = _batch(x0, k)
    others = np.array([0, 1, 3])
    assert not (results == diffrax.RESULTS.successful)[2]
    assert (results == diffrax.RESULTS.successful)[others].all()
    if where == "field":
        assert (results == diffrax.RESULTS.dt_min_reached)[2]
        assert steps[2] < 30
    assert np.array_equal(steps[others], clean_steps[others])
    for y, truth in zip(ys, clean, strict=True):
        assert np.array_equal(y[others], truth[others])
