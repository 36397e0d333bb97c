"""Host CPU, against the same bits by vectors narrower than it has."""

import os
import subprocess
import sys

import pytest
from llvmlite import binding as llvm

from jaxbiped import ArgumentError
from jaxbiped.compiler import host

VECTOR_VARIABLE = "JAXBIPED_VECTOR_BITS"
_ASKED = """
import numpy as np
from jaxbiped.compiler.runtime._machine_code import host
from tests.compiler.ir.test_lower_jaxpr import CASES, POINTS
from tests.compiler.one_shot import evaluate
names = ("fused", "extremes", "powers", "derivative", "loop", "branches", "mapped", "arrays")
points = POINTS[np.isfinite(POINTS)]  # a NaN has many bits
print(host().width, *[evaluate(CASES[name], points).tobytes().hex() for name in names])
"""


def _asked(bits):
    environment = os.environ | {VECTOR_VARIABLE: bits}
    command = [sys.executable, "-c", _ASKED]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return done.stdout.split()


def _host():
    return host.__wrapped__()


@pytest.mark.parametrize("bits", ["64", "1e3", "many", "4096"])
def test_what_is_no_width_of_vectors_is_refused(monkeypatch, bits):
    monkeypatch.setenv(VECTOR_VARIABLE, bits)
    with pytest.raises(ArgumentError, match=f"{VECTOR_VARIABLE} = '{bits}' .* 128, 256 or 512"):
        _host()


def test_an_empty_width_of_vectors_changes_nothing(monkeypatch):
    monkeypatch.delenv(VECTOR_VARIABLE, raising=False)
    plain = _host()
    monkeypatch.setenv(VECTOR_VARIABLE, "")
    assert _host() == plain


def test_narrower_vectors_do_without_the_wider_ones_instructions(monkeypatch):
    monkeypatch.setenv(VECTOR_VARIABLE, "128")
    assert _host().width == 2
    assert _host().scales is False
    assert _host().features.endswith("-avx")


class _Features(dict):
    """What LLVM tells of a processor."""

    def flatten(self):
        return ",".join(f"+{name}" for name in self)


@pytest.mark.parametrize(
    ("features", "width"),
    [
        ("avx2 avx512f avx512dq", 8),
        ("avx2 avx512f", 4),
        ("avx2 avx512dq", 4),
        ("avx2", 4),
        ("sse2", 2),
    ],
)
def test_vectors_are_as_wide_as_all_their_instructions_allow(monkeypatch, features, width):
    """Of eight numbers those of both extensions: conversions of whole numbers are in the second."""
    monkeypatch.delenv(VECTOR_VARIABLE, raising=False)
    of = _Features(dict.fromkeys(features.split(), True))
    monkeypatch.setattr(llvm, "get_host_cpu_features", lambda: of)
    assert _host().width == width


@pytest.mark.slow
def test_all_widths_give_the_same_bits():
    (widest, *wanted), (narrow, *found) = _asked(""), _asked("128")
    assert (int(narrow), found) == (2, wanted)
    assert int(widest) >= 2
