"""Stores in memory and on a disk, against each other."""

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped._identity import provenance
from jaxbiped.sweep._store import Store
from jaxbiped.sweep._stored_fields import FIELDS, Layout
from tests.rigid_walkers import simplest_walker
from tests.sweep.walkers import simplest_grid

SCENE = simplest_walker(0.009)
LAYOUT = Layout.of(simplest_grid(SCENE), 16)


@pytest.fixture(params=["in memory", "on a disk"])
def store(request, tmp_path):
    writer = provenance(SCENE)
    if request.param == "in memory":
        return Store.in_memory(LAYOUT, {}, writer)
    return Store.open(tmp_path / "store", LAYOUT, {}, writer)


def test_what_is_written_is_read_and_in_the_dataset(store):
    label = np.arange(16, dtype=np.int8) % 7
    assert list(store.behind()) == list(range(LAYOUT.chunks))
    store.write(1, {"label": label})
    read = store.read(1, ("label", "cycle_footsteps"))
    np.testing.assert_array_equal(read["label"], label)
    read["label"][:] = 3
    np.testing.assert_array_equal(store.read(1, ("label",))["label"], label)
    found = store.dataset()
    assert set(FIELDS) <= set(found.data_vars)
    np.testing.assert_array_equal(found.label.values[LAYOUT.region(1)].ravel(), label)
    assert int((found.label.values == int(jb.basins.Label.PENDING)).sum()) == 64 - 16


def test_what_is_noted_is_an_attribute(store):
    assert store.noted("gait_guesses") is None
    store.note({"gait_guesses": "{}", "wall_s": 0.5})
    assert store.noted("gait_guesses") == "{}"
    assert store.dataset().attrs["wall_s"] == 0.5
