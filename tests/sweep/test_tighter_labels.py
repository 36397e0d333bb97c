"""Sweeps by a number, against the same labels cut anyhow, killed and tightened."""

import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import zarr

import jaxbiped as jb
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker
from tests.sweep.walkers import as_kind, gaitless, killed_at, same_results, simplest_grid

pytestmark = pytest.mark.slow

SCENE = simplest_walker(0.009)
LABELLING = gaitless(SCENE, simplest_state(*STABLE), accuracy=1e-2)
STARTS = simplest_grid(SCENE)


class Doubting(jb.labels.Labelling):
    """Half of all labels were changed at the first tolerance, where witnesses saw unlike errors."""

    def __call__(self, states, *, parameters=None):
        found = super().__call__(states, parameters=parameters)
        if self.effort.rtol < 1e-5:
            return found
        marks = (np.round(states.theta_2 * 1e6).astype(int) % 4).astype(np.int8)
        seen = np.isin(marks, (1, 2))
        return found._replace(doubt=seen.astype(np.int8), disagreed=marks * seen, changed=1 * seen)


def test_labels_are_those_of_a_tight_solve_whatever_the_chunks():
    whole = jb.sweep(LABELLING, STARTS)
    known = jb.labels.with_gaits_met(
        gaitless(SCENE, simplest_state(*STABLE), accuracy="tight"), STARTS
    )
    exact = known(STARTS.batch(known, 0, STARTS.size).states)
    certain = whole.doubt.values.ravel() != int(jb.basins.Doubt.REMAINS)
    np.testing.assert_array_equal(whole.label.values.ravel()[certain], exact.label[certain])
    assert whole.doubt.attrs["flag_meanings"] == "none settled remains"
    errors = jb.basins.label_errors(whole)
    # So few cannot tell it, and finer tolerances would not help.
    assert not errors.met
    assert errors.wrong <= 1e-2 < errors.wrong_high
    assert errors.starts < errors.fewest == 512
    assert (errors.starts, errors.wanted, errors.rtol) == (64, 1e-2, 3e-5)
    assert errors.relabelled == int((whole.disagreed > 0).sum())
    same_results(jb.sweep(LABELLING, STARTS, chunk=5), whole)


def test_all_starts_are_labelled_again_where_too_many_may_be_wrong(tmp_path, monkeypatch):
    doubting = as_kind(Doubting, jb.labels.with_gaits_met(LABELLING, STARTS))
    whole = jb.sweep(doubting, STARTS)
    assert jb.basins.label_errors(whole).rtol == pytest.approx(3e-6)
    np.testing.assert_allclose(json.loads(whole.attrs["label_tolerances"]), [3e-5, 3e-6])
    with ThreadPoolExecutor(2) as pool:
        same_results(jb.sweep(doubting, STARTS, chunk=16, executor=pool, workers=2), whole)
    path = tmp_path / "store"
    with killed_at(monkeypatch) as both:
        jb.sweep(doubting, STARTS, store=tmp_path / "a", chunk=8)
    with killed_at(monkeypatch, round(0.7 * len(both))):  # amid the second round
        jb.sweep(doubting, STARTS, store=path, chunk=8)
    assert {0, 3} <= set(zarr.open_group(str(path))["done"][:])
    again = jb.sweep(doubting, STARTS, store=path, chunk=8)
    same_results(again, whole)
    assert jb.basins.label_errors(again) == jb.basins.label_errors(whole)
    # What is complete is not labelled again.
    same_results(jb.sweep(doubting, STARTS, store=path, chunk=8), whole)
    with pytest.raises(jb.ArgumentError, match="made with other settings"):
        jb.sweep(gaitless(SCENE, simplest_state(*STABLE), accuracy="draft"), STARTS, store=path)
