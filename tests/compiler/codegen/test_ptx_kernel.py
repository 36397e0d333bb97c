"""PTX of a small program, against what the driver is told and how numbers are rounded."""

import re

import jax
import jax.numpy as jnp
import pytest

from jaxbiped.compiler import ARCHITECTURES, Program, ptx_text
from jaxbiped.compiler.codegen._ptx_kernel import THREADS, architecture_of, device_target
from jaxbiped.compiler.runtime._kernel import Kernel
from tests.compiler.assembler import assembled

NUMBER = jax.ShapeDtypeStruct((), jnp.float64)


def kernel():
    """Newton's method for x eˣ sin x = a, until it moves no more."""

    def attempt(a, x):
        value, slope = jax.value_and_grad(lambda x: x * jnp.exp(x) * jnp.sin(x) + x**a - a)(x)
        return x - value / slope, jnp.abs(value) < 1e-12

    return Kernel.of_program(Program(lambda a: a, attempt, lambda a, x: x), NUMBER)


@pytest.mark.parametrize("architecture", ARCHITECTURES.values(), ids=lambda each: each.name)
def test_it_assembles_without_spills(architecture):
    found = assembled(kernel().ptx(architecture), architecture)
    assert found["registers"] <= 255
    assert found["spill_stores"] == found["spill_loads"] == 0


def test_sums_and_products_are_rounded_one_by_one():
    ptx = ptx_text(kernel().device_text(), ARCHITECTURES[9, 0])
    operations = re.findall(r"\b(?:add|sub|mul|fma|div|rcp|sqrt)\.?\w*\.f64", ptx)
    assert len(operations) > 50
    assert all(".rn." in each for each in operations)


def test_the_driver_knows_the_size_of_blocks():
    ptx = ptx_text(kernel().device_text(), ARCHITECTURES[8, 0])
    assert f".maxntid {THREADS}" in ptx
    assert ".minnctapersm 1" in ptx
    assert ".target sm_80" in ptx
    other = ptx_text(kernel().device_text(128, 3), ARCHITECTURES[8, 0])
    assert ".maxntid 128" in other
    assert ".minnctapersm 3" in other


@pytest.mark.parametrize(
    ("capability", "version"), [((8, 0), "7.0"), ((9, 0), "7.8"), ((10, 0), "8.6")]
)
def test_the_text_is_in_the_first_ptx_that_knows_the_architecture(capability, version):
    """So that drivers as old as the device read it. NVIDIA's notes on releases of PTX say which."""
    lines = ptx_text(kernel().device_text(), ARCHITECTURES[capability]).splitlines()
    assert f".version {version}" in lines
    assert f".target sm_{10 * capability[0]}" in lines


def test_a_warp_refills_together():
    ptx = ptx_text(kernel().device_text(), ARCHITECTURES[9, 0])
    # Whether to stop, whether any is done, whether any is left.
    assert len(re.findall(r"vote\.sync\.any|vote\.any", ptx)) == 3
    assert device_target().width == 1


@pytest.mark.parametrize(
    ("capability", "name"),
    [((7, 5), None), ((8, 0), "sm_80"), ((8, 9), "sm_80"), ((9, 0), "sm_90"), ((12, 1), "sm_100")],
)
def test_devices_run_the_newest_that_they_know(capability, name):
    found = architecture_of(capability)
    assert (found and found.name) == name
