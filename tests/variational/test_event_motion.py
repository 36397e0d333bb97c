"""Motion of an event, against a stone thrown upwards, whose flight is known exactly."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped.variational._tangents import Seeded, Tangents
from jaxbiped.variational._variational_solve import follow_event

GRAVITY, SPEED, TIME = 9.8, 5.0, 0.3


def passes(level, *, time=TIME, rtol=1e-6):
    """How a stone thrown from 0 passes a level, by its speed and by the level, at about `time`."""
    height, speed = SPEED * time - 0.5 * GRAVITY * time**2, SPEED - GRAVITY * time
    args = (jnp.asarray(level),)
    columns = jnp.array([[time, 0.0], [1.0, 0.0]])
    at = Tangents((jnp.asarray(height), jnp.asarray(speed)), columns)
    return follow_event(
        lambda a, y: y[0] - a[0],
        lambda a, y: (y[1], jnp.full_like(y[1], -GRAVITY)),
        at,
        Seeded(args, jnp.array([[0.0, 1.0]]), jnp.zeros(2), (0,)),
        rtol=rtol,
        unit=1.0,
    )


def arrives(speed, level):
    """When a stone passes the level, and how fast it then is."""
    then = jnp.sqrt(speed * speed - 2.0 * GRAVITY * level)
    return jnp.stack([(speed - then) / GRAVITY, level, then])


def test_time_and_state_move_as_the_closed_form_does():
    level = SPEED * TIME - 0.5 * GRAVITY * TIME**2
    found = passes(level)
    exact = np.stack(jax.jacfwd(arrives, argnums=(0, 1))(SPEED, level), axis=0)
    np.testing.assert_allclose(found.time, exact[:, 0], rtol=1e-12)
    np.testing.assert_allclose(found.state, exact[:, 1:], rtol=1e-12, atol=1e-12)
    assert float(found.delay) == pytest.approx(0.0, abs=1e-15)


def test_the_event_lies_a_little_later():
    level = SPEED * TIME - 0.5 * GRAVITY * TIME**2 + 1e-7
    assert float(passes(level).delay) == pytest.approx(1e-7 / (SPEED - GRAVITY * TIME), rel=1e-5)


@pytest.mark.parametrize(
    ("time", "off"), [(SPEED / GRAVITY - 1e-5, 0.0), (TIME, 0.1)], ids=["at the top", "far away"]
)
def test_what_grazes_or_is_not_near_is_not_a_number(time, off):
    level = SPEED * time - 0.5 * GRAVITY * time**2 + off
    found = passes(level, time=time)
    assert np.all(np.isnan(found.time))
    assert np.all(np.isnan(found.state))
