"""Compiled code on disk, against compiling it again; damage is `test_disk_cache.py`'s."""

import weakref

import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped.caching._disk_cache import CACHE_VARIABLE
from jaxbiped.compiler.runtime import _machine_code
from tests.compiler.one_shot import compiled

POINTS = np.linspace(-1.0, 1.0, 5)


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    monkeypatch.setattr(_machine_code, "_LOADED", weakref.WeakValueDictionary())
    return tmp_path / "lanes"


def _run(scale=3.0):
    _machine_code._LOADED.clear()
    program = compiled(lambda x: jnp.exp(x) * scale, ())
    np.testing.assert_allclose(program.run([POINTS]).outputs, np.exp(POINTS) * scale)


def test_compiled_code_is_stored_once_and_read_again(cache, monkeypatch):
    _run()
    (stored,) = cache.iterdir()
    monkeypatch.setattr(_machine_code, "_module", None)  # compiling would fail now
    _run()
    assert list(cache.iterdir()) == [stored]


def test_other_programs_have_code_of_their_own(cache):
    _run()
    _run(4.0)
    assert len(list(cache.iterdir())) == 2
