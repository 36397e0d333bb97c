"""Names of a body that is turned into itself, against angles that are a part of a turn larger."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped import Body, Foot, Mechanism
from jaxbiped.dynamics._equivalent_states import _turned


class Wheel(NamedTuple):
    """A wheel's orientation by Euler parameters and their rates."""

    cos_half_wheel: float
    sin_half_wheel: float
    cos_rate_wheel: float
    sin_rate_wheel: float


def wheel(angle, rate):
    """cos θ/2 and sin θ/2, and how they change."""
    cosine, sine = np.cos(0.5 * angle), np.sin(0.5 * angle)
    return Wheel(cosine, sine, -0.5 * rate * sine, 0.5 * rate * cosine)


@pytest.mark.parametrize("times", [0, 1, 3, -2])
def test_a_wheel_that_is_turned_has_the_euler_parameters_of_the_larger_angle(times):
    ends = [(0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 0.0)]
    mechanism = Mechanism(
        bodies=(Body("wheel", mass=1.0, inertia=0.5, centre=0.0),),
        feet=[Foot("wheel", centre=end, leg=f"spoke_{k}") for k, end in enumerate(ends)],
        turn={"wheel": 4},
    )
    state = Wheel(*map(jnp.asarray, wheel(0.3, -1.7)))
    found = _turned(mechanism.structure, state, times)
    expected = wheel(0.3 + times * 0.5 * np.pi, -1.7)._asdict()
    assert {name: float(value) for name, value in found.items()} == pytest.approx(expected)
