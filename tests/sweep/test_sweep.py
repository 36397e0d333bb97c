"""Sweeps, against the same ones cut otherwise; gaits met on the way."""

import importlib
import json

import numpy as np
import pytest

import jaxbiped as jb
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker
from tests.sweep.walkers import gaitless, killed_at, same_results, simplest_grid

pytestmark = pytest.mark.slow

SWEEP = importlib.import_module("jaxbiped.sweep._sweep")
SCENE = simplest_walker(0.009)
LABELLING = gaitless(SCENE, simplest_state(*STABLE))
STARTS = simplest_grid(SCENE)


def _none_met(labelling, starts):
    """No start is looked at beforehand, so that gaits are found from unresolved ones at last."""
    return labelling


@pytest.mark.parametrize("late", [False, True])
def test_labels_do_not_depend_on_the_chunks(late, monkeypatch):
    if late:
        monkeypatch.setattr(SWEEP, "with_gaits_met", _none_met)
    whole = jb.sweep(LABELLING, STARTS)
    assert whole.label.dims == ("theta_stance", "omega_stance")
    assert set(np.unique(whole.label)) == {0, 1, 2}
    (gait,) = json.loads(whole.attrs["gaits"])[0]["gaits"]
    assert gait["cycle_footsteps"] == 1
    assert gait["point"][1] == pytest.approx(STABLE[0], abs=1e-8)
    for chunk in (1, 3, 16):
        same_results(jb.sweep(LABELLING, STARTS, chunk=chunk), whole)
    if not late:
        known = jb.labels.with_gaits_met(LABELLING, STARTS)
        batch = STARTS.batch(known, 0, STARTS.size)
        found = known(batch.states)
        np.testing.assert_array_equal(found.label, whole.label.values.ravel())
        np.testing.assert_array_equal(found.rate, whole.rate.values.ravel())


def test_starts_keep_their_numbers_in_the_results():
    starts = jb.starts.sample(SCENE, {"theta_stance": (0.15, 0.25)}, 12, method="halton", seed=4)
    found = jb.sweep(LABELLING, starts, chunk=5, look_for_gaits=False)
    expected = starts.batch(LABELLING, 0, 12).columns["theta_stance"]
    np.testing.assert_array_equal(found.start_theta_stance, expected)
    given = jb.starts.GivenStarts(starts.batch(LABELLING, 0, 12).states)
    again = jb.sweep(LABELLING, given, chunk=7, look_for_gaits=False)
    np.testing.assert_array_equal(again.start_theta_2, expected)
    np.testing.assert_array_equal(again.time, found.time)


@pytest.mark.parametrize("writes", [0, 1])
def test_killed_while_gaits_found_late_are_labelled(tmp_path, monkeypatch, writes):
    """After the labels comes a second round; wherever it is cut off, the results are the same."""
    path = tmp_path / "store"
    monkeypatch.setattr(SWEEP, "with_gaits_met", _none_met)
    expected = jb.sweep(LABELLING, STARTS, chunk=8)
    assert jb.basins.Label.WALKING in expected.label
    assert len(json.loads(expected.attrs["gaits"])[0]["gaits"]) == 1
    with killed_at(monkeypatch, 9 + writes):
        jb.sweep(LABELLING, STARTS, store=path, chunk=8)
    same_results(jb.sweep(LABELLING, STARTS, store=path, chunk=8), expected)


def test_positions_of_gaits_follow_when_more_are_met():
    def gait(length):
        return jb.labels.Attractor(length, *[np.zeros(0)] * 10)

    rows = ((),), ((gait(1),), (gait(2),)), ((gait(1), gait(1)), (gait(2),))
    few, one, two = (LABELLING.family._replace(rows=each) for each in rows)
    assert one.cycles == (1, 2)
    assert two.cycles == (1, 1, 2)
    np.testing.assert_array_equal(one.places_in(two), [0, 2])
    np.testing.assert_array_equal(few.places_in(one), [0])
