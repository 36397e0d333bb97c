"""Explanation of a search, against a gait that grazes a switch."""

import warnings

import equinox as eqx
import jax.numpy as jnp
import pytest

import jaxbiped as jb
from jaxbiped.gait._search_provenance import warn_of_grazing

pytestmark = pytest.mark.slow


def test_a_gait_that_grazes_a_switch_is_told():
    scene = jb.ladder()["rigid"]
    gait = jb.find_gait(scene, parameters=(), radius_sensitivities=False)
    assert int(gait.grazes) == 0
    assert "grazes" not in jb.gait.explain_search(scene, gait)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_grazing(gait)
    grazing = eqx.tree_at(lambda each: each.grazes, gait, jnp.asarray(2))
    assert "the gait grazes a switch 2 times" in jb.gait.explain_search(scene, grazing)
    with pytest.warns(RuntimeWarning, match="its sensitivities not known"):
        warn_of_grazing(grazing)
