"""Linearised return map, against a damped oscillator's closed form."""

import math
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.gait.test_return_map import DOWN, Oscillator


class Spring(NamedTuple):
    omega: Any
    zeta: Any


START = (jnp.asarray(0.0), jnp.asarray(-1.5))


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["xla", "lanes"])
def test_a_damped_oscillator(engine):
    """From a crossing of x = 0 downwards to the next: v → v exp(−2π ζ/√(1−ζ²))."""
    omega, zeta = 2.0, 0.1
    found = jb.gait.linearise_return_map(
        Spring(omega, zeta),
        START,
        rtol=1e-9,
        tangent_rtol=1e-8,
        parameters=("zeta", "omega"),
        section=DOWN,
        system=Oscillator(),
        engine=engine,
    )
    root = math.sqrt(1.0 - zeta**2)
    factor, period = math.exp(-2 * math.pi * zeta / root), 2 * math.pi / (omega * root)
    assert float(found.recurring[1]) == pytest.approx(-1.5 * factor, rel=1e-7)
    assert float(found.period) == pytest.approx(period, rel=1e-7)
    by_zeta, by_omega = -2 * math.pi / root**3 * -1.5 * factor, 0.0
    ours = np.asarray(found.jacobian)[1, 1:]
    assert ours == pytest.approx([factor, zeta * by_zeta, omega * by_omega], rel=1e-5, abs=1e-6)
    times = np.asarray(found.period_row)[1:]
    assert times == pytest.approx([0.0, period * zeta**2 / root**2, -period], rel=1e-5, abs=1e-6)
    # Liouville: areas shrink by the field's divergence.
    area = np.linalg.det(np.asarray(found.monodromy)[:, :2])
    assert area == pytest.approx(math.exp(-2 * zeta * omega * period), rel=1e-5)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (dict(rtol=0.0), "rtol = 0 is not allowed"),
        (dict(tangent_rtol=-1.0), "tangent_rtol = -1 is not allowed"),
        (dict(parameters=("K2",)), "parameters = 'K2' is not known"),
        (dict(max_time=0.0), "max_time = 0 is not allowed"),
        (dict(footsteps=0), "footsteps = 0 is not allowed"),
        (dict(max_solver_steps=0), "max_solver_steps = 0 is not allowed"),
        (dict(args=jb.RedundantScene(jb.seed_scene())), "args = a RedundantScene"),
    ],
)
def test_what_is_not_allowed_is_one_sentence(change, said):
    how = dict(args=jb.seed_scene(), state=jb.seed_state(), rtol=1e-6, tangent_rtol=1e-5) | change
    with pytest.raises(jb.ArgumentError) as refused:
        jb.gait.linearise_return_map(how.pop("args"), how.pop("state"), **how)
    assert said in str(refused.value)
