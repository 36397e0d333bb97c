"""Compiled code on disk, against compiling it again; damage is `test_disk_cache.py`'s."""

import gc
import os

import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped.compiler.runtime import _machine_code
from jaxbiped.compiler.runtime._machine_code import foreign_machine, optimised_module
from tests.compiler.one_shot import compiled

POINTS = np.linspace(-1.0, 1.0, 5)


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("JAXBIPED_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "lanes"


def _run(scale=3.0):
    gc.collect()  # code goes with its program
    program = compiled(lambda x: jnp.exp(x) * scale, ())
    np.testing.assert_allclose(program.run([POINTS]).outputs, np.exp(POINTS) * scale)


def test_compiled_code_is_stored_once_and_read_again(cache, tmp_path):
    """What is compiled is written into a new file, and what is read is younger than it was."""
    _run()
    (stored,) = cache.iterdir()
    os.link(stored, tmp_path / "first")
    os.utime(stored, (0.0, 0.0))
    _run()
    assert list(cache.iterdir()) == [stored]
    assert stored.samefile(tmp_path / "first")
    assert stored.stat().st_mtime > 0.0


def test_other_programs_have_code_of_their_own(cache):
    _run()
    _run(4.0)
    assert len(list(cache.iterdir())) == 2


def test_code_that_is_made_with_less_effort_has_a_name_of_its_own_and_the_same_bits(
    cache, monkeypatch
):
    """The first tiers run such code, and the nightly tests what users run."""
    program = lambda: compiled(lambda x: jnp.sin(3.0 * x) / (jnp.exp(x) - 0.4) + x**5, ())
    best = program().run([POINTS]).outputs
    monkeypatch.setattr(_machine_code, "EFFORT", 0)
    quick = program().run([POINTS]).outputs
    np.testing.assert_array_equal(quick, best)
    first, second = (each.stat().st_size for each in cache.iterdir())
    assert first != second


@pytest.mark.parametrize(("features", "fused"), [("", False), ("+fma", True)])
def test_code_for_another_machine_has_the_instructions_that_it_is_said_to_have(features, fused):
    text = """
    declare double @llvm.fma.f64(double, double, double)
    define double @f(double %x) {
      %y = call double @llvm.fma.f64(double %x, double %x, double %x)
      ret double %y
    }"""
    triple = "x86_64-unknown-linux-gnu"
    machine = foreign_machine(triple, cpu="x86-64", features=features)
    assembly = str(machine.emit_assembly(optimised_module(text, machine, triple=triple)))
    assert ("vfmadd" in assembly) is fused
