"""What is left where something raises, against what was there before."""

import contextlib
import os
from pathlib import Path

import jax
import jax.numpy as jnp
import matplotlib as mpl
import pytest

from jaxbiped._checks import _RULES, traced_rules
from jaxbiped._jax_versions import trace_ctx, untraced
from jaxbiped._progress import _outermost, stage
from jaxbiped.caching._cached_jit import _without_noise
from jaxbiped.caching._disk_cache import read_entry, write_entry
from jaxbiped.compiler import without_barriers
from jaxbiped.compiler._fusion_barrier import _UP
from jaxbiped.plot import figure_style
from jaxbiped.plot._figure_style import _CHOSEN
from jaxbiped.sweep._store_files import create_store

CAUSES = [KeyboardInterrupt, OSError(28, "No space left on device"), ValueError("no")]
WITHIN = {
    "figure style": (lambda: figure_style("paper"), lambda: (_CHOSEN.get(), dict(mpl.rcParams))),
    "barriers": (without_barriers, _UP.get),
    "rules": (traced_rules, _RULES.get),
    "stage": (lambda: stage("walking", show=False), _outermost.get),
    "trace": (untraced, lambda: trace_ctx.axis_env),
    "noise": (_without_noise, lambda: (os.fstat(2).st_ino, len(os.listdir("/dev/fd")))),
}
"""By name: what is entered, and what it changes meanwhile."""


def raising(cause):
    def fail(*_, **__):
        raise cause

    return fail


@pytest.mark.parametrize("cause", CAUSES, ids=["interrupt", "disk", "value"])
@pytest.mark.parametrize("name", WITHIN)
def test_what_holds_within_ends_with_it(name, cause):
    enter, state = WITHIN[name]
    before = state()
    with contextlib.suppress(KeyboardInterrupt, OSError, ValueError), enter():
        if name != "trace":  # which is another one only within a trace
            assert state() != before
        raise cause
    assert state() == before


def test_what_is_entered_within_itself_ends_in_turn():
    with stage("walking", show=False) as outer:
        for words in ("first", "second"):
            with contextlib.suppress(ValueError), stage(words, show=False):
                assert outer.within.doing == words
                raise ValueError
            assert outer.within is None
    with traced_rules() as rules:
        with contextlib.suppress(ValueError), traced_rules() as inner:
            inner.append(jnp.asarray(True))
            raise ValueError
        assert len(rules) == 1  # doors within doors gather for both


def test_axes_of_a_trace_are_there_again_behind_what_is_untraced():
    def body(x):
        with contextlib.suppress(ValueError), untraced():
            raise ValueError
        return jax.lax.psum(x, "lane")

    assert jax.vmap(body, axis_name="lane")(jnp.ones(3)).tolist() == [3.0, 3.0, 3.0]


@pytest.mark.parametrize("step", ["replace", "fdopen"])
def test_an_entry_of_the_disk_is_whole_or_not_there(tmp_path, monkeypatch, step):
    monkeypatch.setenv("JAXBIPED_CACHE", str(tmp_path))
    write_entry("xla", "a", b"before")
    monkeypatch.setattr(os, step, raising(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        write_entry("xla", "a", b"after")
    monkeypatch.undo()
    monkeypatch.setenv("JAXBIPED_CACHE", str(tmp_path))
    assert [path.name for path in (tmp_path / "xla").iterdir()] == ["a"]
    assert read_entry("xla", "a") == b"before"


@pytest.mark.parametrize("cause", CAUSES, ids=["interrupt", "disk", "value"])
def test_a_store_that_is_not_complete_is_not_there(tmp_path, cause):
    def write(path: Path) -> None:
        path.mkdir()
        (path / "half").write_text("half")
        raise cause

    with pytest.raises(cause if isinstance(cause, type) else type(cause)):
        create_store(tmp_path / "store", write)
    assert list(tmp_path.iterdir()) == []
