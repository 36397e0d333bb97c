"""Columns through a switch that resets the state, against a ball that bounces, known exactly."""

import functools
import types

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped.hybrid import Switch
from jaxbiped.solve._switch_resets import reset_at_switch
from jaxbiped.solve._watch import Watch
from jaxbiped.variational._saltation import at_fixed_time, behind_reset, meet, meeting_at
from jaxbiped.variational._tangents import Seeded

G = 9.8
LEVEL, BOUNCE = 0.5, 0.8
SIZES = np.array([1.0, 2.0])
"""By how much the columns of level and bounce move these."""


def field(t, y, args):
    return y[1], -G + 0.0 * y[1]


def bounced(args, y, which):
    _, bounce = args
    return y[0], -bounce * y[1]


WATCH = Watch(
    field=field,
    switches=lambda args, y: (Switch(y[0] - args[0], True, resets=True),),
    reset=bounced,
)


def exact(y, v, level, bounce, time):
    """Height and speed so long after a start above the level."""
    speed = -jnp.sqrt(v * v + 2.0 * G * (y - level))
    rest, after = time - (v - speed) / G, -bounce * speed
    return jnp.stack([level + after * rest - 0.5 * G * rest**2, after - G * rest])


@jax.jit
def through_the_bounce(state, by_state, met, past=0.0):
    args = Seeded((jnp.asarray(LEVEL), jnp.asarray(BOUNCE)), jnp.eye(2), jnp.ones(2), (0, 1))
    columns, shifts = (by_state, jnp.zeros((2, 2))), (jnp.zeros(2), jnp.zeros(2))
    meeting = meeting_at(WATCH, state, args, jnp.asarray(1))
    columns, shifts = meet(meeting, columns, shifts, jnp.asarray(SIZES))
    passed = types.SimpleNamespace(crossed_field=jnp.asarray(1), past=jnp.asarray(past))
    reset = functools.partial(behind_reset, WATCH, args, jnp.asarray(SIZES))
    end = jnp.zeros(()), state, columns, None
    _, after, columns, _ = reset_at_switch(WATCH, args.args, passed, met, *end, reset)
    return after, at_fixed_time(field(0.0, after, args.args), columns, shifts)


def test_a_bounce_carries_the_columns_of_the_exact_motion():
    """With respect to the start, to the level and to how much speed is left."""
    y, v = 1.0, -0.5
    speed = -np.sqrt(v * v + 2.0 * G * (y - LEVEL))
    fall = (v - speed) / G
    state, by_state = (jnp.asarray(LEVEL), jnp.asarray(speed)), jnp.array([[1.0, 0.0], [fall, 1.0]])
    after, columns = through_the_bounce(state, by_state, True)
    slopes = np.stack(jax.jacfwd(exact, argnums=(0, 1, 2, 3))(y, v, LEVEL, BOUNCE, fall))
    slopes[2:] *= SIZES[:, None]
    np.testing.assert_allclose(np.concatenate(columns), slopes, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(after, (LEVEL, -BOUNCE * speed), rtol=1e-15)
    np.testing.assert_array_equal(through_the_bounce(state, by_state, False)[0], state)
    late = 1e-11
    past_level = state[0] + late * state[1], state[1] - late * G
    on_level, _ = through_the_bounce(past_level, by_state, True, late)
    np.testing.assert_allclose(on_level, after, rtol=0.0, atol=1e-15)
