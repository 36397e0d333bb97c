"""Stores, against what was labelled and cut: opened by anybody, continued, never mixed."""

import errno
import json
import math
import os
import warnings
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import zarr
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb
from jaxbiped._identity import provenance
from jaxbiped.sweep._store import DOUBT_FIELDS, FIELDS, Layout, Store, fields_of
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker
from tests.sweep.walkers import (
    ByFormula,
    Killed,
    as_kind,
    gaitless,
    same_results,
    simplest_grid,
    stacked,
)

SCENE, STATE = simplest_walker(0.009), simplest_state(*STABLE)
LABELLING = as_kind(ByFormula, gaitless(SCENE, STATE))
MOVED = as_kind(ByFormula, gaitless(simplest_walker(0.01), STATE))


def grid(low=0.1, high=0.3, count=6, omegas=(-1.2, -1.0), **options):
    axes = {"theta_stance": np.linspace(low, high, count), "omega_stance": omegas}
    return jb.starts.grid(SCENE, axes, **options)


def swept(path=None, starts=None, *, labelling=LABELLING, chunk=4, look=False, **options):
    starts = grid() if starts is None else starts
    return jb.sweep(labelling, starts, store=path, chunk=chunk, look_for_gaits=look, **options)


def test_of_labels_that_were_in_doubt_it_is_kept_which_ones(by_formula):
    starts = grid()
    batch = starts.batch(LABELLING, 0, 3)
    certain = LABELLING(batch.states)
    marks = {name: np.arange(3, dtype=np.int8) + k for k, name in enumerate(DOUBT_FIELDS)}
    for found, names in ((certain, set()), (certain._replace(**marks), set(DOUBT_FIELDS))):
        kept = fields_of(starts, found, batch)
        assert kept.keys() & (FIELDS.keys() | DOUBT_FIELDS.keys()) == FIELDS.keys() | names
        for name in FIELDS.keys() | names:
            np.testing.assert_array_equal(kept[name], getattr(found, name))


@pytest.mark.parametrize("on_disk", [False, True])
def test_what_is_written_is_read_and_in_the_dataset(on_disk, tmp_path):
    layout, writer = Layout.of(simplest_grid(SCENE), 16), provenance(SCENE)
    store = Store.of(tmp_path / "store" if on_disk else None, layout, {}, writer)
    label = np.arange(16, dtype=np.int8) % 7
    assert list(store.behind()) == list(range(layout.chunks))
    store.write(1, {"label": label})
    read = store.read(1, ("label", "cycle_footsteps"))
    np.testing.assert_array_equal(read["label"], label)
    read["label"][:] = 3
    np.testing.assert_array_equal(store.read(1, ("label",))["label"], label)
    found = store.dataset()
    assert set(FIELDS) <= set(found.data_vars)
    np.testing.assert_array_equal(found.label.values[layout.region(1)].ravel(), label)
    assert int((found.label.values == int(jb.basins.Label.PENDING)).sum()) == 64 - 16
    assert store.noted("gait_guesses") is None
    store.note({"gait_guesses": "{}", "wall_s": 0.5})
    assert store.noted("gait_guesses") == "{}"
    assert store.dataset().attrs["wall_s"] == 0.5


def test_a_store_opens_plainly_says_what_made_it_and_is_filled_once(tmp_path, by_formula):
    path = tmp_path / "new" / "basin"
    swept(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = xr.open_zarr(path, chunks=None)
    theta = np.linspace(0.1, 0.3, 6)
    expected = np.repeat(np.where(theta > 0.2, 2, 4)[:, None], 2, axis=1)
    np.testing.assert_array_equal(found.label, expected)
    np.testing.assert_allclose(found.distance, np.repeat(10.0 * theta[:, None], 2, axis=1))
    np.testing.assert_array_equal(found.theta_stance, theta)
    units = [found[name].attrs["units"] for name in ("theta_stance", "omega_stance", "time")]
    assert units == ["rad", "rad/s", "s"]
    assert found.label.dtype == np.int8
    assert found.label.dims == ("theta_stance", "omega_stance")
    assert found.label.attrs["flag_meanings"].split()[0] == "walking"
    stated = json.loads(found.attrs["settings"])
    assert stated["scene"]["slope"] == 0.009
    effort = stated["effort"]
    assert (effort["rtol"], effort["footsteps"], effort["solver"]) == (1e-6, 12, "Rodas4")
    for name in ("version_jaxbiped", "version_jax", "version_python", "git_revision"):
        assert found.attrs[name]
    assert sum(by_formula) == 12
    again = swept(path)
    assert sum(by_formula) == 12
    assert (again.attrs["labelled_in_this_run"], again.attrs["chunks_found_complete"]) == (0, 3)
    same_results(again, swept())


@pytest.mark.parametrize("field", ["label", "gait", "closest", "attempted"])
@pytest.mark.parametrize("damage", [None, b"garbage"])
def test_a_lost_or_damaged_chunk_is_labelled_anew(tmp_path, by_formula, field, damage):
    whole = swept(tmp_path / "a").load()
    assert by_formula == [4, 4, 4]
    chunk = tmp_path / "a" / field / "c" / "2" / "0"
    chunk.unlink() if damage is None else chunk.write_bytes(damage)
    with pytest.warns(RuntimeWarning, match="1 of its chunks were lost or damaged"):
        again = swept(tmp_path / "a")
    assert by_formula == [4] * 4
    assert again.load().drop_attrs().identical(whole.drop_attrs())
    swept(tmp_path / "a")
    assert by_formula == [4] * 4


def test_a_chunk_that_was_begun_is_labelled_again(tmp_path, by_formula):
    swept(tmp_path / "a")
    group = zarr.open_group(str(tmp_path / "a"), mode="r+", use_consolidated=False)
    group["done"][1], group["label"][2:4] = 0, 8
    before = sum(by_formula)
    found = swept(tmp_path / "a")
    assert sum(by_formula) - before == 4
    assert sorted(set(found.label.values.ravel().tolist())) == [2, 4]


def test_two_clients_begin_one_store(tmp_path, by_formula, monkeypatch):
    """The other one makes the same store while this one writes its own."""
    plain, inner = zarr.create_group, []

    def create(*given, **options):
        if not inner:
            inner.append(1)
            swept(tmp_path / "a")
        return plain(*given, **options)

    monkeypatch.setattr(zarr, "create_group", create)
    found = swept(tmp_path / "a")
    assert (found.label.values >= 0).all()
    assert [each.name for each in tmp_path.iterdir()] == ["a"]
    assert swept(tmp_path / "a").attrs["labelled_in_this_run"] == 0


def test_a_store_in_the_home_folder(tmp_path, by_formula, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    swept("~/a")
    assert [each.name for each in tmp_path.iterdir()] == ["a"]


STEPS = [(zarr, "create_group"), (zarr.Group, "create_array"), (zarr, "consolidate_metadata")]


@pytest.mark.parametrize(("owner", "step"), STEPS, ids=[step for _, step in STEPS])
@pytest.mark.parametrize("after", [False, True])
def test_killed_before_the_first_chunk(tmp_path, monkeypatch, by_formula, owner, step, after):
    """Cut off before or after each step of a store's making, the same call makes it all."""
    path, own = tmp_path / "store", getattr(owner, step)

    def cut(*told, **options):
        if after:
            own(*told, **options)
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(owner, step, cut)
        with pytest.raises(KeyboardInterrupt):
            swept(path)
    same_results(swept(path), swept())


def place(scene, states):
    return states


def sample(high=0.3, **options):
    return jb.starts.sample(SCENE, {"theta_stance": (0.1, high)}, 8, **options)


GIVEN = [jb.starts.GivenStarts(stacked([simplest_state(angle, -0.2)] * 2)) for angle in (0.2, 0.21)]


@pytest.mark.parametrize(
    ("first", "other", "difference"),
    [
        (grid(), grid(high=0.31), "starts"),
        (grid(), grid(count=7), r"starts.grid.theta_stance = \["),
        (grid(), grid(omegas=(-1.2, -1.1)), "starts"),
        (grid(), grid(place=True), "starts"),
        (grid(), grid(follow=place), "starts"),
        (grid(), sample(), "starts.sample is not in"),
        (sample(), sample(high=0.31), "starts"),
        (sample(), sample(seed=1), "starts"),
        (sample(), sample(method="halton"), "starts"),
        (*GIVEN, "starts"),
        (None, dict(labelling=gaitless(SCENE, STATE, rtol=1e-5)), "effort.rtol = 1e-06 there, 1e-"),
        (None, dict(labelling=gaitless(SCENE, STATE, footsteps=9)), "footsteps = 12 there, 9 here"),
        (None, dict(labelling=gaitless(SCENE, STATE, solver="rodas5p")), "effort"),
        (None, dict(labelling=MOVED), "scene.slope = 0.009 there, 0.01 here"),
        (None, dict(chunk=2), r"chunk_shape\[0\] = 2 there, 1 here"),
    ],
)
def test_other_settings_are_refused_by_name(first, other, difference, tmp_path, by_formula):
    swept(tmp_path / "a", first)
    with pytest.raises(jb.ArgumentError, match=f"was made with other settings: .*{difference}"):
        swept(tmp_path / "a", **(other if first is None else {"starts": other}))


def test_what_cannot_be_continued_is_refused_before_gaits_are_sought(tmp_path, by_formula):
    swept(tmp_path / "a")
    labelled = len(by_formula)
    with pytest.raises(jb.ArgumentError, match="other settings"):
        swept(tmp_path / "a", labelling=MOVED, look=True)
    zarr.open_group(str(tmp_path / "a"), mode="r+").attrs.update({"git_revision": "other"})
    with pytest.raises(jb.ArgumentError, match="another version"):
        swept(tmp_path / "a", look=True)
    assert len(by_formula) == labelled


@pytest.mark.parametrize("name", ["version_jaxbiped", "git_revision", "user_code"])
def test_a_store_of_another_version_is_refused_unless_asked_for(tmp_path, by_formula, name):
    path = tmp_path / "store"
    first = swept(path)
    group = zarr.open_group(str(path), mode="r+")
    own = group.attrs[name]
    group.attrs.update({name: "another"})
    with pytest.raises(jb.ArgumentError, match=f'{name} = "another" there, .*any_version=True'):
        swept(path)
    found = swept(path, any_version=True)
    same_results(found, first)
    assert found.attrs[name] == "another"
    (other,) = json.loads(found.attrs["also_written_by"])
    assert other[name] == own
    with pytest.raises(jb.ArgumentError, match="was written by another version"):
        swept(path)


def test_a_store_of_other_fields_is_refused_though_any_version_may_continue(tmp_path, by_formula):
    """As one of 0.1.0, whose settings named no fields and whose cycles were called periods."""
    swept(tmp_path / "store")
    group = zarr.open_group(str(tmp_path / "store"), mode="r+")
    settings = json.loads(group.attrs["settings"])
    del settings["fields"]
    group.attrs.update({"settings": json.dumps(settings)})
    with pytest.raises(jb.ArgumentError, match="other settings: fields is not in the store"):
        swept(tmp_path / "store", any_version=True)


def test_a_directory_of_something_else_is_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(jb.ArgumentError, match="holds something else"):
        swept(tmp_path)
    assert [each.name for each in tmp_path.iterdir()] == ["notes.txt"]
    with pytest.raises(jb.ArgumentError, match="is a file: it must be a directory"):
        swept(tmp_path / "notes.txt")
    foreign = tmp_path / "foreign"
    xr.Dataset({"a": ("x", np.arange(3))}).to_zarr(foreign, consolidated=False)
    with pytest.raises(jb.ArgumentError, match="holds something else"):
        swept(foreign)


def test_a_creation_that_was_cut_off_is_begun_anew(tmp_path, by_formula):
    half = tmp_path / ".store.ab12.unfinished"
    (half / "label").mkdir(parents=True)
    (half / "zarr.json").write_text('{"zarr_form')
    os.utime(half, (0.0, 0.0))  # long ago
    (tmp_path / "store").mkdir()
    same_results(swept(tmp_path / "store"), swept())
    assert not half.exists()


def _full(*_, **__):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_full_disk_is_told_and_what_is_complete_stays(tmp_path, by_formula, monkeypatch):
    path, write, marked = tmp_path / "store", zarr.Array.__setitem__, []

    def filling(self, *place_and_value):
        marked.extend(["done"] if self.basename == "done" else [])
        (_full if len(marked) > 3 else write)(self, *place_and_value)

    with monkeypatch.context() as patched:
        patched.setattr(zarr.Array, "__setitem__", filling)
        with pytest.raises(jb.ResourceError) as raised:
            swept(path)
    sentence = str(raised.value)
    assert f"store = {str(path)!r} cannot be written (no space left on device)" in sentence
    assert sentence.endswith("the chunks that are complete stay.")
    assert "\n" not in sentence
    found = swept(path)
    assert found.attrs["chunks_found_complete"] == 2
    same_results(found, swept())


def test_a_disk_too_full_to_begin_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(zarr.Group, "create_array", _full)
    with pytest.raises(jb.ResourceError, match=r"cannot be written \(no space left"):
        swept(tmp_path / "store")
    assert list(tmp_path.iterdir()) == []


def test_a_directory_without_permission_is_told(tmp_path, monkeypatch):
    closed = tmp_path / "closed"
    closed.mkdir()
    if os.geteuid() == 0:  # whom permissions do not stop
        denied, make = PermissionError(errno.EACCES, os.strerror(errno.EACCES)), Path.mkdir

        def denying(self, *arguments, **options):
            if closed in self.parents:
                raise denied
            make(self, *arguments, **options)

        monkeypatch.setattr(Path, "mkdir", denying)
    else:
        closed.chmod(0o500)
    with pytest.raises(jb.ArgumentError, match=r"cannot be written \(permission denied\)"):
        swept(closed / "store")


class Three(ByFormula):
    """Labels three times."""

    def __call__(self, states, *, parameters=None):
        if len(self.asked) == 3:
            raise Killed
        return super().__call__(states, parameters=parameters)


def test_memory_is_bounded_by_the_chunk(tmp_path, by_formula):
    """A grid of 400 million starts: what is made of it at once, and what a store of it takes."""
    starts = grid(count=20_000, omegas=np.linspace(-0.3, -0.1, 20_000))
    path = tmp_path / "store"
    with pytest.raises(Killed):
        swept(path, starts, labelling=as_kind(Three, LABELLING), chunk=512)
    assert by_formula == [512] * 3
    written = sum(each.stat().st_size for each in path.rglob("*") if each.is_file())
    assert written < 3_000_000


NAMES = ("theta_stance", "theta_swing", "omega_stance", "omega_swing")


def _grid(shape):
    axes = {name: np.linspace(0.0, 1.0, size) for name, size in zip(NAMES, shape, strict=False)}
    return jb.starts.grid(jb.seed_scene(), axes)


@given(st.lists(st.integers(1, 6), min_size=1, max_size=4), st.integers(1, 300))
@settings(max_examples=60, deadline=None)
def test_chunks_cover_every_start_once(shape, chunk):
    starts = _grid(shape)
    layout = Layout.of(starts, chunk)
    numbers = np.arange(starts.size).reshape(shape)
    seen = []
    sizes = layout.sizes
    assert len(sizes) == layout.chunks
    for i in range(layout.chunks):
        first, last = layout.numbers(i)
        assert sizes[i] == last - first <= chunk
        assert math.prod(layout.shape_of(i)) == last - first
        part = numbers[layout.region(i)]
        np.testing.assert_array_equal(part.ravel(), np.arange(first, last))
        # A chunk of the store's arrays is written by one chunk of the sweep alone.
        whole = zip(layout.region(i), layout.chunk_shape, strict=True)
        assert all(place.start % size == 0 for place, size in whole)
        seen += range(first, last)
    assert seen == list(range(starts.size))


def test_a_chunk_of_a_large_grid_is_small():
    starts = _grid((1000, 1000, 1000, 10))
    layout = Layout.of(starts, 16384)
    assert layout.chunk_shape == (1, 1, 1000, 10)
    first, last = layout.numbers(layout.chunks - 1)
    assert (last, last - first) == (10**10, 10**4)
