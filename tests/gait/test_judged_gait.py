"""Errors of a gait, against relative changes of one quantity after the other."""

from types import SimpleNamespace

import jax
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.gait import Measures, Search
from jaxbiped.gait._accurate_gait import judge_gait

SCENE = jb.with_parameters(jb.seed_scene(), {"hip_mass": 0.0, "slope": -0.02})
STATE = jax.tree.map(np.asarray, jb.seed_state())
NAMES = ("K", "hip_mass", "slope")
SIZES = np.array([1e6, 1.0, 0.02])
"""Absolute values of these; that of what is zero counts one."""


def gait(**changes):
    """Of 0.5 s, −0.2 m, −0.4 m/s and 100 N, its errors zero."""
    slopes = {"period": [1e-6, 2.0, -50.0], "step_length": [0.0, 0.4, 0.0]}
    row = lambda name: np.array(slopes.get(name, [1e-7, 0.1, 0.0]))
    measures = Measures(0.5, -0.2, -0.4, 100.0, 0.5, STATE)
    sensitivities = Measures(
        *map(row, Measures._fields[:-1]), jax.tree.map(lambda _: row(""), STATE)
    )
    zeros = lambda tree: jax.tree.map(np.zeros_like, tree)
    given = dict(
        outcome=Search.FOUND, parameters=NAMES, measures=measures, measure_errors=zeros(measures),
        multipliers=np.array([-0.5, 0.1]), multiplier_errors=np.zeros(2),
        sensitivities=sensitivities, sensitivity_errors=zeros(sensitivities),
    )  # fmt: skip
    return SimpleNamespace(**given | changes)


def measured(**changes):
    return gait(measures=gait().measures._replace(**changes))


def judged(one, other, radius=True):
    bars, relative, unknown = judge_gait(SCENE, one, other, radius)
    assert unknown == ""
    return bars, relative


def test_equal_gaits_without_estimates_have_no_error():
    bars, relative = judged(gait(), gait())
    assert relative == 0.0
    assert not any(np.any(leaf) for leaf in jax.tree.leaves(bars))


@pytest.mark.parametrize(
    ("name", "size"), [("step_length", 0.2), ("speed", 0.4), ("peak_normal", 100.0)]
)
@pytest.mark.parametrize("change", [0.01, -0.01])
def test_measures_are_relative_to_themselves(name, size, change):
    value = getattr(gait().measures, name)
    bars, relative = judged(gait(), measured(**{name: value + change}))
    bar = float(getattr(bars["measures"], name))
    assert 0.01 <= bar <= 0.1
    assert relative == pytest.approx(bar / size)
    estimates = gait().measure_errors._replace(**{name: np.asarray(0.003)})
    bars, relative = judged(gait(measure_errors=estimates), gait())
    assert relative == pytest.approx(float(getattr(bars["measures"], name)) / size)
    assert relative > 0.0


@pytest.mark.parametrize("largest", [0.5, 2.0])
def test_multipliers_are_relative_to_the_largest_or_to_one(largest):
    one = gait(multipliers=np.array([-largest, 0.1]))
    bars, relative = judged(one, gait(multipliers=np.array([-largest, 0.1 + 0.003j])))
    assert bars["multipliers"][0] == 0.0
    assert relative == pytest.approx(bars["multipliers"][1] / max(1.0, largest))
    assert relative > 1e-3


@pytest.mark.parametrize(("place", "name"), [(0, "period"), (1, "step_length"), (2, "speed")])
def test_a_measures_elasticities_are_relative_to_its_largest(place, name):
    own = gait().sensitivities
    moved = np.array(getattr(own, name))
    moved[place] += 1e-3 / SIZES[place]
    bars, relative = judged(gait(), gait(sensitivities=own._replace(**{name: moved})))
    largest = np.max(np.abs(np.asarray(getattr(own, name)) * SIZES))
    bar = np.asarray(getattr(bars["sensitivities"], name))
    assert np.count_nonzero(bar) == 1
    assert relative == pytest.approx(bar[place] * SIZES[place] / largest)
    assert relative > 1e-4


def test_the_radius_counts_where_it_is_asked_for_and_what_is_unknown_is_told():
    own = gait().sensitivities
    moved = own._replace(spectral_radius=np.asarray(own.spectral_radius) + 0.01 * np.eye(3)[1])
    assert judged(gait(), gait(sensitivities=moved))[1] > 1e-3
    assert judged(gait(), gait(sensitivities=moved), radius=False)[1] == 0.0
    unknown = own._replace(spectral_radius=np.full(3, np.nan), peak_normal=np.full(3, np.nan))
    _, relative, words = judge_gait(SCENE, gait(sensitivities=unknown), gait(), True)
    assert relative == np.inf
    assert words.startswith("derivatives of the peak normal and spectral radius are unknown")
    bare = judge_gait(SCENE, gait(parameters=(), sensitivities=unknown), gait(), True)
    assert bare[1:] == (0.0, "")
    lost = judge_gait(SCENE, gait(), gait(outcome=Search.NO_RETURN), True)
    assert lost[0] == {}
    assert lost[1] == np.inf
    assert "another method's search ended as" in lost[2]
