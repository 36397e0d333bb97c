"""The Illinois method, against chords that are drawn by hand."""

import jax.numpy as jnp
import pytest

from jaxbiped.solve import _recorders
from jaxbiped.solve._recorders import arrival_time

CURVES = {
    "the upper end stays": (lambda x: x * x - 0.25, 2.0),
    "the lower end stays": (lambda x: 0.25 - (2.0 - x) ** 2, 0.0),
}
"""A curve over [0, 2], and the end on whose side no chord meets zero."""


def chord(t, value, end, value_there):
    """Where the line through two points is zero."""
    return t - value * (end - t) / (value_there - value)


@pytest.mark.parametrize("name", CURVES)
def test_an_end_that_stays_twice_counts_half(name, monkeypatch):
    """Dowell and Jarratt, "A modified regula falsi method", BIT 11 (1971) 168."""
    curve, end = CURVES[name]
    near = 2.0 - end
    for count, share in enumerate((1.0, 1.0, 0.5, 0.25), 1):
        near = chord(near, curve(near), end, share * curve(end))
        monkeypatch.setattr(_recorders, "_SECANTS", count)
        found = arrival_time(curve, jnp.asarray(0.0), jnp.asarray(2.0))
        assert float(found) == pytest.approx(near, rel=1e-14)
