"""Collocated steps, against the conditions of Radau's rule, dense algebra and a known motion."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped.variational._collocated_step import (
    RADAU,
    KnownStep,
    Order,
    Rows,
    Stages,
    collocate_step,
    linearise_about,
    order_of,
)

NODES = np.append(np.sort(np.roots([10.0, -8.0, 1.0])), 1.0)
"""Radau's, right of three: zeros of the second derivative of x² (x − 1)³ over x − 1."""


def step_of(start=0.7, span=0.3, switched=0.2, **more):
    known = dict(before=jnp.zeros(1), after=jnp.zeros(1), fresh=False, crossed=False)
    return KnownStep(
        start=jnp.asarray(start), span=jnp.asarray(span), switched=switched, **known | more
    )


def test_powers_up_to_the_third_are_integrated_exactly():
    for power in range(3):
        np.testing.assert_allclose(RADAU @ NODES**power, NODES ** (power + 1) / (power + 1))


def test_points_lie_evenly_in_the_root_of_the_time_since_the_last_switch():
    part, share = step_of().clock()
    roots = np.sqrt(0.5) + (np.sqrt(0.8) - np.sqrt(0.5)) * NODES
    np.testing.assert_allclose(0.3 * part, roots**2 - 0.5, rtol=1e-12)
    np.testing.assert_allclose(share, 2.0 * roots * (np.sqrt(0.8) - np.sqrt(0.5)), rtol=1e-12)
    # By shares of the time the rule finds the time itself.
    np.testing.assert_allclose((RADAU * share) @ np.ones(3), 0.3 * part, rtol=1e-12)
    for nothing in step_of(span=0.0).clock() + step_of(span=0.0, switched=0.7).clock():
        np.testing.assert_array_equal(nothing, 0.0)


ORDERS = {"none led": Order((2, 0, 1), 0), "one led": Order((1, 2, 0), 1)}
ORDERS["two led"] = Order((3, 0, 1, 4, 2), 2)


@pytest.mark.parametrize("name", ORDERS)
def test_stages_solve_the_dense_equations_and_their_transpose(name):
    order = ORDERS[name]
    c, d, rng = len(order.every), order.direct, np.random.default_rng(3)
    k, share = c - d, np.array([0.05, 0.1, 0.15])
    kept_rates = rng.normal(size=(3, k, c))
    led = np.zeros((3, d, c))
    led[:, np.arange(d), d + np.arange(d)] = 1.0
    rates = np.concatenate([led, kept_rates], axis=1)
    weights = RADAU * share
    dense = np.eye(3 * c) - np.einsum("ij,jab->iajb", weights, rates).reshape(3 * c, 3 * c)
    right, forcing, u = (rng.normal(size=(3, size)) for size in (c, k, c))
    tangents = rng.normal(size=(2, c))

    @jax.jit
    def by_stages(share, kept_rates):
        stages = Stages.of(order, share, kept_rates)
        return stages.solve(right, forcing), stages.carried(tangents), stages.pulled(u)

    solved, every, (by_start, by_forcing) = by_stages(share, kept_rates)
    forced = right + weights @ np.concatenate([np.zeros((3, d)), forcing], axis=1)
    expected = np.linalg.solve(dense, forced.reshape(-1)).reshape(3, c)
    np.testing.assert_allclose(solved, expected, rtol=1e-10)
    for start, carried in zip(tangents, every, strict=True):
        expected = np.linalg.solve(dense, np.tile(start, 3)).reshape(3, c)
        np.testing.assert_allclose(carried, expected, rtol=1e-10)
    pulled = np.linalg.solve(dense.T, u.reshape(-1)).reshape(3, c)
    np.testing.assert_allclose(by_start, pulled.sum(axis=0), rtol=1e-10)
    np.testing.assert_allclose(by_forcing, (weights.T @ pulled)[:, d:], rtol=1e-10)


def pendulum(y, parameters):
    (stiffness,) = parameters
    return [y[1], -stiffness * y[0] - 0.5 * y[1] ** 2]


def test_an_order_begins_with_components_whose_rates_are_components():
    y = [jnp.asarray(0.3), jnp.asarray(-0.6)]
    order = order_of(pendulum, y, [jnp.asarray(2.0)])
    assert order == Order((0, 1), 1)
    behind = order_of(lambda y, q: pendulum(y[::-1], q)[::-1], y[::-1], [jnp.asarray(2.0)])
    assert (behind.every, behind.direct, behind.kept) == ((1, 0), 1, (0,))
    vector = jnp.asarray([5.0, 7.0])
    np.testing.assert_array_equal(behind.sorted(vector), [7.0, 5.0])
    three = Order((2, 0, 1), 0)
    np.testing.assert_array_equal(three.sorted(jnp.arange(3.0)), [2.0, 0.0, 1.0])
    np.testing.assert_array_equal(three.restored(three.sorted(jnp.arange(3.0))), np.arange(3.0))


def test_a_step_of_an_oscillator_and_the_field_about_it():
    """Its velocity is the first component. A step that ends on a switch stops short of it."""
    stiffness, span = 4.0, 0.05
    sides = span * jnp.asarray([-0.2, -0.1, 0.1, 0.2])

    def field(y, parameters):
        return [-parameters[0] * y[1], y[0]]

    def at(time):
        swing = 2.0 * np.asarray(time)
        return np.stack([-2.0 * np.sin(swing) + np.cos(swing), np.cos(swing) + 0.5 * np.sin(swing)])

    rows = Rows(field, Order((1, 0), 1), [jnp.asarray(stiffness)])

    @jax.jit
    def collocated(step):
        points, share, begins = collocate_step(rows, step)
        ends = step.before, step.after
        linear = linearise_about(rows, *ends, points, share, jnp.asarray(False), sides)
        return points, share, begins, linear, linear.stages.carried(jnp.eye(2))

    before, after = jnp.asarray(at(0.0)), jnp.asarray(at(span))
    for crossed in (False, True):
        step = step_of(span=span, switched=0.6, before=before, after=after, crossed=crossed)
        points, share, begins, linear, carried = collocated(step)
        np.testing.assert_allclose(begins, [-stiffness, 1.0])
        part, expected_share = step.clock()
        np.testing.assert_allclose(share, expected_share)
        np.testing.assert_allclose(points, at(span * part).T, atol=4e-6)
        rates = np.stack([-stiffness * points[:, 1], points[:, 0]], axis=1)
        left = points - before - (RADAU * share) @ rates
        np.testing.assert_allclose(left[:2], 0.0, atol=1e-9 if crossed else 1e-14)
        np.testing.assert_allclose(left[2], 0.0, atol=1e-7 if crossed else 1e-14)
        off = float(jnp.max(jnp.abs(points[2] - after)))
        assert (0.0 < off < 1e-9) if crossed else (1e-9 < off < 1e-7)
        np.testing.assert_allclose(linear.at_start, [[-stiffness, 0.0, -before[1]]], atol=1e-12)
        np.testing.assert_allclose(linear.by_parameter[:, 0, 0], -points[:, 1], rtol=1e-12)
        np.testing.assert_allclose(linear.velocity, [before[0], -stiffness * before[1]])
        np.testing.assert_array_equal(linear.jump, 0.0)
        cosine, sine = np.cos(2.0 * span), np.sin(2.0 * span)
        expected = [[cosine, -2.0 * sine], [0.5 * sine, cosine]]
        np.testing.assert_allclose(carried[:, 2], expected, atol=1e-7)
