"""Fused multiply-add in software against exact arithmetic."""

import math
from fractions import Fraction

import numpy as np
import pytest

from jaxbiped.compiler.runtime._web_assembly import with_software_fma
from tests.compiler.one_shot import loaded

_MODULE = """\
declare double @llvm.fma.f64(double, double, double)
define double @fused(double %a, double %b, double %c) {
  %r = call double @llvm.fma.f64(double %a, double %b, double %c)
  ret double %r
}
"""


@pytest.fixture(scope="module")
def fused():
    return loaded(with_software_fma(_MODULE), "fused", 3)


def exact(a, b, c):
    return float(Fraction(a) * Fraction(b) + Fraction(c))


def numbers(count):
    """Factors and summands that cancel, tie, or lie far apart."""
    rng = np.random.default_rng(1)
    a, b = (rng.normal(size=count) * 2.0 ** rng.integers(-60, 60, count) for _ in range(2))
    near = -a * b * (1.0 + rng.integers(-4, 5, count) * 2.0**-52)
    far = a * b * 2.0 ** rng.integers(-120, 120, count) * rng.choice([-1.0, 1.0], count)
    # Few digits: the sums lie halfway between two numbers, but for a last bit far below.
    short = np.round(rng.normal(size=count) * 2**10)
    half = 2.0 ** rng.integers(50, 56, count) + short
    tiny = 1.0 + rng.integers(-3, 4, count) * 2.0**-52
    yield from zip(a, b, near, strict=True)
    yield from zip(a, b, far, strict=True)
    yield from zip(short * 0.5 + 2.0**-30, tiny, half, strict=True)


def test_it_rounds_once(fused):
    plain = 0
    for a, b, c in ((float(x), float(y), float(z)) for x, y, z in numbers(4000)):
        assert fused(a, b, c) == exact(a, b, c), (a.hex(), b.hex(), c.hex())
        plain += a * b + c != exact(a, b, c)
    assert plain > 3000


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ((0.0, -3.0, 0.0), 0.0),
        ((0.0, -3.0, -0.0), -0.0),
        ((2.0, 3.0, -6.0), 0.0),
        ((math.inf, 2.0, 1.0), math.inf),
        ((1.0, 2.0, -math.inf), -math.inf),
        ((1e300, 1e300, 1.0), math.inf),
        ((1e305, 0.5, 1.0), 5e304),
    ],
)
def test_zeros_infinities_and_large_numbers(fused, given, expected):
    found = fused(*given)
    assert found == expected
    assert math.copysign(1.0, found) == math.copysign(1.0, expected)


def test_what_is_no_number_stays_none(fused):
    assert math.isnan(fused(math.nan, 1.0, 1.0))
    assert math.isnan(fused(math.inf, 0.0, 1.0))


def test_a_module_without_any_stays_as_it_is():
    assert with_software_fma("define void @nothing() {\n") == "define void @nothing() {\n"
