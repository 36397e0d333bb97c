"""Sweeps, against the same ones cut otherwise; gaits met on the way."""

import json

import equinox as eqx
import numpy as np
import pytest
import zarr

import jaxbiped as jb
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker
from tests.sweep.walkers import as_kind, gaitless, killed_at, same_results, simplest_grid

pytestmark = pytest.mark.slow

SCENE = simplest_walker(0.009)
LABELLING = gaitless(SCENE, simplest_state(*STABLE))
STARTS = simplest_grid(SCENE)


class Overlooking(jb.labels.Labelling):
    """Sees no cycle in the starts that are looked at beforehand: gaits are met at last."""

    looked: list = eqx.field(static=True)

    def __call__(self, states, *, parameters=None):
        found = super().__call__(states, parameters=parameters)
        if self.looked:
            return found
        self.looked.append(True)
        return found._replace(cycle_footsteps=0 * found.cycle_footsteps)


def overlooking():
    return as_kind(Overlooking, LABELLING, [])


@pytest.mark.parametrize("make", [lambda: LABELLING, overlooking], ids=["early", "late"])
def test_labels_do_not_depend_on_the_chunks(make):
    whole = jb.sweep(make(), STARTS)
    assert whole.label.dims == ("theta_stance", "omega_stance")
    assert set(np.unique(whole.label)) == {0, 1, 2}
    (gait,) = json.loads(whole.attrs["gaits"])[0]["gaits"]
    assert gait["cycle_footsteps"] == 1
    assert gait["point"][1] == pytest.approx(STABLE[0], abs=1e-8)
    for chunk in (1, 3, 16):
        same_results(jb.sweep(make(), STARTS, chunk=chunk), whole)
    if make() is LABELLING:
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


@pytest.mark.parametrize("share", [0.1, 0.3, 0.6])
def test_killed_while_gaits_found_late_are_labelled(tmp_path, monkeypatch, share):
    """After the labels comes a second round; wherever it is cut off, the results are the same."""
    path = tmp_path / "store"
    expected = jb.sweep(overlooking(), STARTS, chunk=8)
    assert jb.basins.Label.WALKING in expected.label
    assert len(json.loads(expected.attrs["gaits"])[0]["gaits"]) == 1
    how = dict(chunk=8, look_for_gaits=False)
    with killed_at(monkeypatch) as first:
        jb.sweep(LABELLING, STARTS, store=tmp_path / "a", **how)
    with killed_at(monkeypatch, round((1.0 + share) * len(first))):
        jb.sweep(overlooking(), STARTS, store=path, chunk=8)
    assert len({0, 1, 2} & set(zarr.open_group(str(path))["done"][:])) > 1
    same_results(jb.sweep(overlooking(), STARTS, store=path, chunk=8), expected)


def test_positions_of_gaits_follow_when_more_are_met():
    def gait(length):
        return jb.labels.Attractor(length, *[np.zeros(0)] * 10)

    rows = ((),), ((gait(1),), (gait(2),)), ((gait(1), gait(1)), (gait(2),))
    few, one, two = (LABELLING.family._replace(rows=each) for each in rows)
    assert one.cycles == (1, 2)
    assert two.cycles == (1, 1, 2)
    np.testing.assert_array_equal(one.places_in(two), [0, 2])
    np.testing.assert_array_equal(few.places_in(one), [0])
