"""Errors of labels by capture and recapture, against made-up labels whose errors are known."""

import warnings

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.basins._labels import Seen, estimate_label_errors


def _seen(random, wrong, recalls, starts=10_000):
    a, b = (random.uniform(size=wrong) < recall for recall in recalls)
    return Seen(starts, 0, 0, 0, int(a.sum()), int(b.sum()), int((a & b).sum()))


def test_chapmans_own_example_of_marked_animals():
    """Of 10 marked and 15 caught later 5 were marked: 28.3 animals in all, 20 of them seen."""
    found = estimate_label_errors(Seen(1000, 0, 0, 0, 10, 15, 5), wanted=1.0, rtol=1e-6)
    assert found.wrong * 1000 == pytest.approx(11 * 16 / 6 - 1 - 20)


@pytest.mark.parametrize("recalls", [(0.3, 0.7), (0.6, 0.6)])
def test_independent_witnesses_tell_how_many_they_overlooked(recalls):
    random = np.random.default_rng(0)
    within, off = [], []
    for _ in range(400):
        wrong = int(random.integers(0, 60))
        seen = _seen(random, wrong, recalls)
        left = wrong - (seen.looser + seen.other - seen.both)
        found = estimate_label_errors(seen, wanted=1e-3, rtol=1e-6)
        within.append(left <= 10_000 * found.wrong_high)
        off.append(10_000 * found.wrong - left)
    assert np.mean(within) >= 0.95
    assert abs(np.mean(off)) < 1.0


def test_nothing_seen_is_not_certain_and_an_excess_is_warned_of():
    none = estimate_label_errors(Seen(1000), wanted=1e-2, rtol=1e-6)
    assert (none.wrong, none.met) == (0.0, True)
    assert none.wrong_high == pytest.approx(np.exp(1.96 * np.sqrt(np.log(2.0))) * 1e-3)
    few = estimate_label_errors(Seen(1000), wanted=1e-4, rtol=1e-6)
    assert (few.wrong, few.met) == (0.0, False)
    with pytest.warns(RuntimeWarning, match=f"fewer than {few.fewest} starts cannot confirm it"):
        few.warn()
    enough = estimate_label_errors(Seen(few.fewest), wanted=1e-4, rtol=1e-6)
    assert enough.met
    assert not estimate_label_errors(Seen(few.fewest - 1), wanted=1e-4, rtol=1e-6).met
    many = estimate_label_errors(Seen(1000, 9, 8, 1, 4, 4, 0), wanted=1e-3, rtol=1e-6)
    assert not many.met
    assert many.wrong == pytest.approx(16e-3)
    with pytest.warns(RuntimeWarning, match="accuracy = 0.001 is not met: 9 of 1000 labels were"):
        many.warn()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        none.warn()
    assert jb.basins.LabelErrors(**many.numbers()) == many
