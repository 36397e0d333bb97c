"""Sweeps by a number, against the same labels cut anyhow, killed and tightened."""

import importlib
import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.basins._labels import estimate_label_errors
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker
from tests.sweep.walkers import gaitless, killed_at, same_results, simplest_grid

pytestmark = pytest.mark.slow

TIGHTER = importlib.import_module("jaxbiped.sweep._sweep")
SCENE = simplest_walker(0.009)
LABELLING = gaitless(SCENE, simplest_state(*STABLE), accuracy=1e-2)
STARTS = simplest_grid(SCENE)


def _never_met(seen, *, wanted, rtol):
    """As if many were wrong at the first tolerance."""
    found = estimate_label_errors(seen, wanted=wanted, rtol=rtol)
    return found if rtol < 1e-5 else found._replace(met=False, wrong=0.5)


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
    monkeypatch.setattr(TIGHTER, "estimate_label_errors", _never_met)
    whole = jb.sweep(LABELLING, STARTS)
    assert jb.basins.label_errors(whole).rtol == pytest.approx(3e-6)
    np.testing.assert_allclose(json.loads(whole.attrs["label_tolerances"]), [3e-5, 3e-6])
    with ThreadPoolExecutor(2) as pool:
        same_results(jb.sweep(LABELLING, STARTS, chunk=16, executor=pool, workers=2), whole)
    path = tmp_path / "store"
    with killed_at(monkeypatch, 12) as marks:  # amid the second round
        jb.sweep(LABELLING, STARTS, store=path, chunk=8)
    assert marks[-1] == 3
    again = jb.sweep(LABELLING, STARTS, store=path, chunk=8)
    same_results(again, whole)
    assert jb.basins.label_errors(again) == jb.basins.label_errors(whole)
    # What is complete is not labelled again.
    same_results(jb.sweep(LABELLING, STARTS, store=path, chunk=8), whole)
    with pytest.raises(jb.ArgumentError, match="made with other settings"):
        jb.sweep(gaitless(SCENE, simplest_state(*STABLE), accuracy="draft"), STARTS, store=path)
