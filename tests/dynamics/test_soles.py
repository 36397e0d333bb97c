"""Soles of a body, against the one of two that stands."""

import itertools

import jax.numpy as jnp
import pytest

from jaxbiped.dynamics._stance import Sole, either
from jaxbiped.scene._bodies import Point

ENTRIES = {"along": (0.3, 0.2), "ahead": (0.05, -0.1), "radius": (0.02, 0.01)}
KNOWN = list(itertools.product([True, False], repeat=2))
"""Whether the first sole has an entry, and whether the second one does: what is none is zero."""


def sole(which, known):
    numbers = {name: jnp.asarray(pair[which]) for name, pair in ENTRIES.items()}
    numbers |= {name: None for name, has in known.items() if not has[which]}
    return Sole(1, 3, Point(numbers["along"], numbers["ahead"]), numbers["radius"])


@pytest.mark.parametrize("first_stands", [True, False])
@pytest.mark.parametrize("ahead", KNOWN)
@pytest.mark.parametrize("radius", KNOWN)
def test_of_two_soles_the_entries_are_those_of_the_one_that_stands(ahead, radius, first_stands):
    known = {"along": (True, True), "ahead": ahead, "radius": radius}
    one, other = sole(0, known), sole(1, known)
    found = either(jnp.asarray(first_stands), one, other)
    stands = one if first_stands else other
    assert (found.leg, found.body) == (1, 3)
    for here, there in zip(
        (found.centre.along, found.centre.ahead, found.radius),
        (stands.centre.along, stands.centre.ahead, stands.radius),
        strict=True,
    ):
        assert float(0.0 if here is None else here) == float(0.0 if there is None else there)
