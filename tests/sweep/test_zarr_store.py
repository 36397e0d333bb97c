"""Results on disk, against those in memory: opened by anybody, continued, never mixed."""

import errno
import importlib
import json
import os
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import zarr

import jaxbiped as jb
from jaxbiped.sweep._store import Store
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker
from tests.sweep.walkers import gaitless, same_results, simplest_grid

pytestmark = pytest.mark.slow

SWEEP = importlib.import_module("jaxbiped.sweep._sweep")
SCENE = simplest_walker(0.009)
LABELLING = gaitless(SCENE, simplest_state(*STABLE))
STARTS = simplest_grid(SCENE)


def _swept(path=None, *, labelling=LABELLING, starts=STARTS, chunk=16):
    return jb.sweep(labelling, starts, store=path, chunk=chunk, look_for_gaits=False)


def test_a_store_opens_plainly_and_says_what_made_it(tmp_path):
    _swept(tmp_path / "new" / "basin")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = xr.open_zarr(tmp_path / "new" / "basin", chunks=None)
    expected = _swept()
    same_results(found, expected)
    assert found.label.dtype == np.int8
    assert found.label.dims == ("theta_stance", "omega_stance")
    np.testing.assert_array_equal(found.theta_stance, STARTS.values["theta_stance"])
    assert found.time.attrs["units"] == "s"
    assert found.label.attrs["flag_meanings"].split()[0] == "walking"
    stated = json.loads(found.attrs["settings"])
    assert stated["scene"]["slope"] == 0.009
    assert (stated["effort"]["rtol"], stated["effort"]["footsteps"]) == (1e-6, 12)
    assert stated["effort"]["solver"] == "Rodas4"
    for name in ("version_jaxbiped", "version_jax", "version_python", "git_revision"):
        assert found.attrs[name]


_RUN = """
import sys
from tests.sweep.test_store import LABELLING, SCENE
from tests.sweep.walkers import simplest_grid
import jaxbiped as jb
jb.sweep(LABELLING, simplest_grid(SCENE, 120), store=sys.argv[1], chunk=120, look_for_gaits=False)
"""


@pytest.mark.nightly
def test_a_killed_run_continues_where_it_was(tmp_path):
    path = tmp_path / "store"
    run = subprocess.Popen([sys.executable, "-c", _RUN, str(path)])
    done, deadline = np.zeros(1), time.monotonic() + 100.0
    while done.sum() < 5 and run.poll() is None and time.monotonic() < deadline:
        time.sleep(0.005)
        if path.exists():
            done = zarr.open_group(str(path), mode="r")["done"][:]
    run.send_signal(signal.SIGKILL)
    run.wait()
    complete = int(zarr.open_group(str(path), mode="r")["done"][:].sum())
    assert 5 <= complete < 120
    starts = simplest_grid(SCENE, 120)
    found = _swept(path, starts=starts, chunk=120)
    assert found.attrs["chunks_found_complete"] == complete
    assert found.attrs["labelled_in_this_run"] == (120 - complete) * 120
    same_results(found, _swept(starts=starts, chunk=100_000))


_SLOPE = simplest_walker(0.01)
_GUESS = simplest_state(*STABLE)


@pytest.mark.parametrize(
    ("other", "difference"),
    [
        (dict(labelling=gaitless(SCENE, _GUESS, rtol=1e-5)), "effort.rtol = 1e-06 there, 1e-05"),
        (dict(labelling=gaitless(SCENE, _GUESS, footsteps=9)), "footsteps = 12 there, 9 here"),
        (dict(labelling=gaitless(_SLOPE, _GUESS)), "scene.slope = 0.009 there, 0.01 here"),
        (dict(starts=simplest_grid(SCENE, 9)), r"starts.grid.theta_stance = \["),
        (
            dict(starts=jb.starts.sample(SCENE, {"theta_stance": (0.1, 0.2)}, 4)),
            "starts.sample is not in",
        ),
        (dict(chunk=8), r"chunk_shape\[0\] = 2 there, 1 here"),
    ],
)
def test_other_settings_are_refused_by_name(tmp_path, other, difference):
    _swept(tmp_path / "store")
    with pytest.raises(jb.ArgumentError, match=f"made with other settings: .*{difference}"):
        _swept(tmp_path / "store", **other)


def test_other_settings_are_refused_before_gaits_are_sought(tmp_path, monkeypatch):
    _swept(tmp_path / "store")
    monkeypatch.setattr(SWEEP, "with_gaits_met", None)
    with pytest.raises(jb.ArgumentError, match="other settings"):
        jb.sweep(gaitless(_SLOPE, _GUESS), STARTS, store=tmp_path / "store", chunk=16)


@pytest.mark.parametrize("name", ["version_jaxbiped", "git_revision", "user_code"])
def test_a_store_of_another_version_is_refused_unless_asked_for(tmp_path, name):
    path = tmp_path / "store"
    first = _swept(path)
    group = zarr.open_group(str(path), mode="r+")
    own = group.attrs[name]
    group.attrs.update({name: "another"})
    with pytest.raises(jb.ArgumentError, match=f'{name} = "another" there, .*any_version=True'):
        _swept(path)
    found = jb.sweep(
        LABELLING, STARTS, store=path, chunk=16, look_for_gaits=False, any_version=True
    )
    same_results(found, first)
    assert found.attrs[name] == "another"
    (other,) = json.loads(found.attrs["also_written_by"])
    assert other[name] == own
    with pytest.raises(jb.ArgumentError, match="was written by another version"):
        _swept(path)


def test_a_store_of_other_fields_is_refused_though_any_version_may_continue(tmp_path):
    """As one of 0.1.0, whose settings named no fields and whose cycles were called periods."""
    _swept(tmp_path / "store")
    group = zarr.open_group(str(tmp_path / "store"), mode="r+")
    settings = json.loads(group.attrs["settings"])
    del settings["fields"]
    group.attrs.update({"settings": json.dumps(settings)})
    with pytest.raises(jb.ArgumentError, match="other settings: fields is not in the store"):
        jb.sweep(LABELLING, STARTS, store=tmp_path / "store", chunk=16, any_version=True)


def test_another_version_is_refused_before_gaits_are_sought(tmp_path, monkeypatch):
    _swept(tmp_path / "store")
    zarr.open_group(str(tmp_path / "store"), mode="r+").attrs.update({"git_revision": "other"})
    monkeypatch.setattr(SWEEP, "with_gaits_met", None)
    with pytest.raises(jb.ArgumentError, match="another version"):
        jb.sweep(LABELLING, STARTS, store=tmp_path / "store", chunk=16)


def test_a_directory_of_something_else_is_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(jb.ArgumentError, match="holds something else"):
        _swept(tmp_path)
    assert [each.name for each in tmp_path.iterdir()] == ["notes.txt"]
    with pytest.raises(jb.ArgumentError, match="is a file: it must be a directory"):
        _swept(tmp_path / "notes.txt")
    foreign = tmp_path / "foreign"
    xr.Dataset({"a": ("x", np.arange(3))}).to_zarr(foreign, consolidated=False)
    with pytest.raises(jb.ArgumentError, match="holds something else"):
        _swept(foreign)


def test_a_creation_that_was_cut_off_is_begun_anew(tmp_path):
    half = tmp_path / ".store.ab12.unfinished"
    (half / "label").mkdir(parents=True)
    (half / "zarr.json").write_text('{"zarr_form')
    os.utime(half, (0.0, 0.0))  # long ago
    (tmp_path / "store").mkdir()
    same_results(_swept(tmp_path / "store"), _swept())
    assert not half.exists()


def _full(*_, **__):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_full_disk_is_told_and_what_is_complete_stays(tmp_path, monkeypatch):
    path, mark, marked = tmp_path / "store", Store._mark, []

    def filling(self, chunk, complete):
        marked.append(chunk)
        (_full if len(marked) > 2 else mark)(self, chunk, complete)

    with monkeypatch.context() as patched:
        patched.setattr(Store, "_mark", filling)
        with pytest.raises(jb.ResourceError) as raised:
            _swept(path)
    sentence = str(raised.value)
    assert f"store = {str(path)!r} cannot be written (no space left on device)" in sentence
    assert sentence.endswith("the chunks that are complete stay.")
    assert "\n" not in sentence
    found = _swept(path)
    assert found.attrs["chunks_found_complete"] == 2
    same_results(found, _swept())


def test_a_disk_too_full_to_begin_leaves_nothing(tmp_path, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(zarr.Group, "create_array", _full)
        with pytest.raises(jb.ResourceError, match=r"cannot be written \(no space left"):
            _swept(tmp_path / "store")
    assert list(tmp_path.iterdir()) == []


def test_a_directory_without_permission_is_told(tmp_path, monkeypatch):
    closed = tmp_path / "closed"
    closed.mkdir()
    if os.geteuid() == 0:  # whom permissions do not stop
        denied = PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        make = Path.mkdir

        def denying(self, *arguments, **options):
            if closed in self.parents:
                raise denied
            make(self, *arguments, **options)

        monkeypatch.setattr(Path, "mkdir", denying)
    else:
        closed.chmod(0o500)
    with pytest.raises(jb.ArgumentError, match=r"cannot be written \(permission denied\)"):
        _swept(closed / "store")


def test_memory_is_bounded_by_the_chunk(tmp_path, monkeypatch):
    """A grid of 400 million starts: what is made of it at once, and what a store of it takes."""
    axes = {
        "theta_stance": np.linspace(0.1, 0.3, 20_000),
        "omega_stance": np.linspace(-0.3, -0.1, 20_000),
    }
    starts, sizes = jb.starts.grid(SCENE, axes), []

    class Enough(BaseException):
        pass

    def counting(self, states, *, parameters=None):
        sizes.append(len(states.hip_x))
        if len(sizes) == 3:
            raise Enough
        return call(self, states, parameters=parameters)

    call = jb.Labelling.__call__
    monkeypatch.setattr(jb.Labelling, "__call__", counting)
    with pytest.raises(Enough):
        _swept(tmp_path / "store", starts=starts, chunk=512)
    assert sizes == [512] * 3
    written = sum(each.stat().st_size for each in (tmp_path / "store").rglob("*") if each.is_file())
    assert written < 3_000_000
