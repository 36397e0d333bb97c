"""Saved scenes and results, against what was saved, bit by bit."""

import collections
import dataclasses
import datetime
import functools
import json
import math
import re
import subprocess
import sys
import zipfile

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
import xarray

import jaxbiped as jb
from jaxbiped.models import MODELS
from tests import mechanisms, saved_parts
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker

SCENES = {
    **jb.ladder(),
    **{f"model {name}": model.make() for name, model in MODELS.items()},
    **{name: mechanisms.scene_of(name) for name in mechanisms.WALKERS},
    "redundant": jb.RedundantScene(jb.seed_scene(), "augmented", "euler"),
    "bristles": dataclasses.replace(
        jb.seed_scene(),
        friction=jb.laws.friction_law_like("lugre", mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1e3),
    ),
    "driven": jb.Scene(
        jb.seed_scene().walker, jb.seed_scene().ground, jb.seed_scene().normal,
        jb.seed_scene().friction, actuation=jb.actuation.HipTorque(torque=0.1),
    ),
    "own law": dataclasses.replace(jb.seed_scene(), friction=saved_parts.Grip(5000.0)),
    "linkage": jb.dynamics.walker_linkage(jb.seed_scene().walker),
}  # fmt: skip


def same(one, other):
    """Whether two values have the same structure, types, and bits."""
    leaves, others = jax.tree.leaves(one), jax.tree.leaves(other)
    assert jax.tree.structure(one) == jax.tree.structure(other)
    for leaf, again in zip(leaves, others, strict=True):
        assert type(leaf) is type(again)
        own, there = np.asarray(leaf), np.asarray(again)
        assert (own.dtype, own.shape) == (there.dtype, there.shape)
        assert own.tobytes() == there.tobytes()
    return True


def again(path, value):
    jb.save(path / "it.npz", value)
    return jb.load(path / "it.npz")


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_is_the_same(tmp_path, name):
    scene = SCENES[name]
    assert same(again(tmp_path, scene), scene)


def test_a_walk_is_the_same_between_its_steps_too_and_belongs_to_its_scene(seed_walk, tmp_path):
    scene, walk = seed_walk
    held = again(tmp_path, {"scene": scene, "walk": walk})
    assert same(held["walk"], walk)
    times = np.linspace(0.0, float(walk.t[-1]), 7)
    assert same(held["walk"].at(times), walk.at(times))
    before, now = jb.footsteps(scene, walk), jb.footsteps(held["scene"], held["walk"])
    assert dataclasses.asdict(before).keys() == dataclasses.asdict(now).keys()
    np.testing.assert_array_equal(now.period_s, before.period_s)
    kept = again(tmp_path, now)
    np.testing.assert_array_equal(kept.period_s, now.period_s)
    assert kept.leg.tolist() == now.leg.tolist()
    dataset = jb.measure.trajectory_dataset(scene, walk)
    assert again(tmp_path, dataset).identical(dataset)


def test_a_walk_through_modes_is_the_same(tmp_path):
    model = MODELS["hsu-chen"]
    scene = model.make()
    start = scene.state(**next(iter(model.starts.values())))
    walk = jb.rigid_walk(scene, start, footsteps=2, max_arrivals=2, engine="lanes")
    read = again(tmp_path, walk)
    assert same(read, walk)
    assert read.modes == walk.modes


_READ = """
import sys, jaxbiped as jb, numpy as np
held = jb.load(sys.argv[1])
found = jb.find_gait(held["scene"], held["start"], parameters=("slope",))
assert found.measures.period == held["gait"].measures.period
print(held["gait"].to_csv(), end="")
"""


@pytest.mark.slow
def test_another_process_reads_the_same_numbers(tmp_path):
    scene, path = simplest_walker(0.009), tmp_path / "gait.npz"
    start = simplest_state(*STABLE)
    gait = jb.find_gait(scene, start, parameters=("slope",))
    jb.save(path, {"scene": scene, "start": start, "gait": gait})
    read = subprocess.run(
        [sys.executable, "-c", _READ, str(path)], capture_output=True, text=True, check=True
    )
    assert read.stdout == gait.to_csv()
    assert same(jb.load(path)["gait"], gait)


def test_what_else_values_are_made_of(tmp_path):
    value = {
        "numbers": [1, 1.5, float("nan"), -float("inf"), 1 + 2j, True, None, "words"],
        ("a", 1): (np.float32(2.5), np.int8(-3), np.array(["ä", "b"]), jnp.arange(3)),
        "note": saved_parts.Note(saved_parts.Side.LEFT, saved_parts.half),
        "ending": jb.Ending.STUMBLED,
        "kind": jb.State,
        "objects": np.array([["a", None]], object),
        "empty": {},
    }
    read = again(tmp_path, value)
    assert list(read) == list(value)
    assert repr(read) == repr(value)
    assert isinstance(read["numbers"][5], bool)
    assert read["note"].side is saved_parts.Side.LEFT
    assert read["note"].numbers is saved_parts.half
    masked = again(tmp_path, np.ma.array([1.0, 2.0], mask=[True, False]))
    assert masked.mask.tolist() == [True, False]
    assert masked[1] == 2.0


ARRAYS = {
    **{name: jnp.asarray([1, 2], name) for name in ("bfloat16", "float8_e4m3fn", "int4", "uint2")},
    "one of bfloat16": jnp.asarray(1.5, jnp.bfloat16),
    "scalar of bfloat16": np.asarray(jnp.asarray(1.5, jnp.bfloat16))[()],
    "turned": np.asarray(jnp.ones((2, 3), jnp.bfloat16)).T,
    "big-endian": np.arange(3, dtype=">f8"),
    "complex": np.array([1 + 2j, np.nan], ">c16"),
    "dates": np.array(["2020-01-01", "NaT"], "M8[ns]"),
    "duration": np.timedelta64(3, "s"),
    "fields": np.array([(1, [2.0, 3.0])], dtype=[("a", "i4"), ("b", "f8", (2,))]),
    "bytes": np.array([b"x"]),
    "nothing": np.zeros((0, 3), np.float16),
    "columns": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
    "masked": np.ma.array([1.0, 2.0], mask=[True, False], fill_value=7.0),
    "masked nowhere": np.ma.array([1, 2]),
}


@pytest.mark.parametrize("name", ARRAYS)
def test_an_array_of_any_type_is_the_same(tmp_path, name):
    array = ARRAYS[name]
    held = again(tmp_path, array)
    assert type(held) is type(array)
    assert (held.dtype, held.shape) == (array.dtype, array.shape)
    assert np.asarray(held).tobytes() == np.asarray(array).tobytes()
    assert repr(held) == repr(array)


def test_arrays_within_an_array_and_words_that_are_no_text_are_the_same(tmp_path):
    parts = np.empty(2, object)
    parts[0], parts[1] = np.arange(3), np.arange(3)
    held = again(tmp_path, {"parts": parts, "half a pair": "\ud800"})
    assert held["parts"].shape == (2,)
    np.testing.assert_array_equal(held["parts"][1], np.arange(3))
    assert held["half a pair"] == "\ud800"


class Whole(int):
    """A number with a type of its own."""


Renamed = collections.namedtuple("Other", "x")
LOOP = []
LOOP.append(LOOP)


@pytest.mark.parametrize(
    "value",
    [
        np.array([(1, None)], dtype=[("a", "i4"), ("b", object)]),
        np.rec.array([(1, 2.0)], dtype=[("a", int), ("b", float)]),
        jax.random.key(0), Whole(3), collections.OrderedDict(a=1), Renamed(1), math.sin, len, int,
        datetime.datetime(2020, 1, 1), b"x", xarray.DataArray([1.0]), pd.Series([1.0]),
        functools.partial(len), collections.Counter().update, LOOP,
    ],
    ids=lambda value: type(value).__name__,
)  # fmt: skip
def test_what_could_not_be_read_back_is_not_written(tmp_path, value):
    with pytest.raises(jb.ArgumentError, match=r"^value(\[0\])? is not allowed: "):
        jb.save(tmp_path / "it.npz", [value] if value is not LOOP else value)
    assert not list(tmp_path.iterdir())


def test_the_arrays_are_open_to_numpy_and_equal_contents_are_equal_files(tmp_path):
    for name in "ab":
        jb.save(tmp_path / name, [np.arange(3.0), jb.seed_scene()])
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    with np.load(tmp_path / "a") as arrays:
        np.testing.assert_array_equal(arrays["0"], np.arange(3.0))
    assert sorted(each.name for each in tmp_path.iterdir()) == ["a", "b"]


@pytest.mark.parametrize("cause", [KeyboardInterrupt, OSError(28, "No space left on device")])
def test_what_stops_amid_an_array_leaves_the_old_file_alone(tmp_path, monkeypatch, cause):
    jb.save(tmp_path / "it.npz", {"one": np.ones(3), "two": np.zeros(2)})
    write, written = np.lib.format.write_array, []

    def stop(*args, **options):
        written.append(write(*args, **options))
        if len(written) == 2:
            raise cause

    monkeypatch.setattr(np.lib.format, "write_array", stop)
    with pytest.raises((KeyboardInterrupt, jb.ResourceError)):
        jb.save(tmp_path / "it.npz", {"one": np.zeros(3), "two": np.ones(2)})
    assert len(written) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["it.npz"]
    assert jb.load(tmp_path / "it.npz")["one"].tolist() == [1.0, 1.0, 1.0]


def test_a_failure_without_a_number_is_told_in_its_own_words(tmp_path, monkeypatch):
    def stop(*args, **options):
        raise OSError("The line is dead")

    monkeypatch.setattr(np.lib.format, "write_array", stop)
    with pytest.raises((jb.ArgumentError, jb.ResourceError), match=r"\(the line is dead\)"):
        jb.save(tmp_path / "it.npz", np.zeros(3))


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ([0, lambda: 1], r"value\[1\] is not allowed: .*<lambda> has no import path"),
        ({"a": object()}, r"value\['a'\] is not allowed: objects of type object cannot be saved"),
        (saved_parts.Note(saved_parts.Side.LEFT, {1, 2}), "value.numbers is not .* of type set"),
    ],
)
def test_what_is_no_data_is_refused_by_its_place(tmp_path, value, said):
    with pytest.raises(jb.ArgumentError, match=said):
        jb.save(tmp_path / "it.npz", value)
    assert not list(tmp_path.iterdir())


def test_what_is_traced_is_refused(tmp_path):
    with pytest.raises(jb.ArgumentError, match="value is traced"):
        jax.jit(lambda x: jb.save(tmp_path / "it.npz", x))(1.0)


def rewritten(path, change):
    """A file with other contents."""
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    text = json.dumps(change(json.loads(parts["contents.json"])))
    with zipfile.ZipFile(path, "w") as archive:
        for name, part in (parts | {"contents.json": text}).items():
            archive.writestr(name, part)


def replace(old, new):
    return lambda contents: json.loads(json.dumps(contents).replace(old, new))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda held: held | {"jaxbiped": 2},
            "the file has format 2 of jaxbiped .* reads format 1",
        ),
        (replace("saved_parts:Grip", "saved_parts:Lost"), "needs Lost of the module tests.saved_p"),
        (
            replace("tests.saved_parts:", "no_such_module:"),
            "of the module no_such_module, which is",
        ),
        (replace("tests.saved_parts:Grip", "os:system"), "needs system of the module os, which is"),
        (replace('"grip"', '"grasp"'), "Grip has other fields here: grasp, grip"),
        (replace("jaxbiped:Ground", "jaxbiped:Floor"), "needs Floor of"),
        (lambda held: {"value": 1}, "must be a whole file of"),
        (replace('"jax": 0', '"jax": 99'), "must be a whole file of"),
        (replace('"jax": 0', '"pickle": 0'), "must be a whole file of"),
    ],
)
def test_another_file_is_one_sentence(tmp_path, change, said):
    path = tmp_path / "it.npz"
    jb.save(path, SCENES["own law"])
    rewritten(path, change)
    with pytest.raises(jb.ArgumentError, match=said):
        jb.load(path)


def test_another_version_is_named_where_it_made_other_classes(tmp_path):
    path = tmp_path / "it.npz"
    jb.save(path, jb.seed_scene())
    rewritten(path, replace("jaxbiped:Ground", "jaxbiped:Floor"))
    rewritten(path, lambda held: held | {
        "written_by": held["written_by"] | {"version_jaxbiped": "9.0"}
    })  # fmt: skip
    with pytest.raises(jb.ArgumentError, match=r"written by jaxbiped 9.0; this is \d"):
        jb.load(path)


def test_classes_may_move_within_the_package(tmp_path):
    path, scene = tmp_path / "it.npz", SCENES["own law"]
    jb.save(path, scene)
    with zipfile.ZipFile(path) as archive:
        text = archive.read("contents.json").decode()
    # By what users import, and never by a private module.
    assert "jaxbiped.scene.laws:StanceRotation" in text
    assert "._" not in "".join(re.findall(r'"(jaxbiped[.\w]*:\w+)"', text))
    # As files had it before.
    rewritten(path, replace("scene.laws:StanceRotation", "scene._no_such_module:StanceRotation"))
    assert jb.load(path).clearance == scene.clearance


def test_a_file_that_is_none_of_ours_is_one_sentence(tmp_path):
    path = tmp_path / "it.npz"
    with pytest.raises(jb.ArgumentError, match="cannot be read"):
        jb.load(path)
    path.write_text("words")
    with pytest.raises(jb.ArgumentError, match="must be a whole file of"):
        jb.load(path)
    np.savez(path, a=np.arange(2))
    with pytest.raises(jb.ArgumentError, match="must be a whole file of"):
        jb.load(path)
    jb.save(path, np.arange(1000.0))
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(jb.ArgumentError, match="must be a whole file of"):
        jb.load(path)
    with pytest.raises(jb.ArgumentError, match="cannot be written"):
        jb.save(tmp_path / "none" / "it.npz", 1)


def test_code_that_has_changed_is_told_and_the_numbers_are_the_same(tmp_path):
    path = tmp_path / "it.npz"
    jb.save(path, SCENES["own law"])

    def other(held):
        held["written_by"]["user_code"]["tests.saved_parts.Grip"] = "another"
        return held

    rewritten(path, other)
    with pytest.warns(RuntimeWarning, match=r"another source of tests\.saved_parts\.Grip: the num"):
        assert same(jb.load(path), SCENES["own law"])
