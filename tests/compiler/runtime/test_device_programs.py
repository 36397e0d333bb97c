"""Programs of walks and labels on devices, against the lanes' bits; registers and spills."""

import jax.tree_util as jtu
import numpy as np
import pytest

from jaxbiped.compiler.codegen._ptx_kernel import ARCHITECTURES, ptx_text
from tests.compiler.assembler import assembled
from tests.compiler.device_programs import CASES
from tests.compiler.fake_driver import install

LANDING = ("end", "steps", "labels", "rigid")
"""One of each engine's programs that a change waits for; the others are run at night."""
MOST = {
    "end": (255, 752, 952),
    "steps": (255, 708, 1012),
    "times": (255, 816, 1080),
    "arrivals": (255, 788, 1072),
    "extremes": (255, 848, 1060),
    "tangents": (255, 6308, 11356),
    "labels": (255, 2472, 3960),
    "rigid": (236, 0, 0),
    "rigid_labels": (255, 636, 596),
}
"""Registers of a thread, bytes that are stored to and loaded from memory for want of them:
on sm_90, by `ptxas` 12.9."""
_SLACK = 1.25
"""For other devices, and other versions of LLVM and of the assembler."""


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow if name in LANDING else pytest.mark.nightly)
        for name in CASES
    ],
)
def test_lanes_bits_and_registers(monkeypatch, name):
    fake = install(monkeypatch, lanes=4, multiprocessors=1)
    found, expected = CASES[name]("cuda"), CASES[name]("lanes")
    assert fake.launches
    for a, b in zip(jtu.tree_leaves(found), jtu.tree_leaves(expected), strict=True):
        np.testing.assert_array_equal(a, b)
    # A gradient's programs are those of the end and of tangents.
    registers, stores, loads = MOST.get(name, (0, 0, 0))
    for text in fake.modules if name in MOST else ():
        for architecture in ARCHITECTURES.values():
            taken = assembled(ptx_text(text, architecture), architecture)
            print(name, architecture.name, taken)
            assert taken.registers <= max(registers, 255)
            assert taken.spill_stores <= _SLACK * stores + 64
            assert taken.spill_loads <= _SLACK * loads + 64
