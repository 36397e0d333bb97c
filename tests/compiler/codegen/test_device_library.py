"""Functions that devices have of their own, run on the CPU, against exact values."""

import ctypes
import ctypes.util
import math

import mpmath
import numpy as np
import pytest

from jaxbiped.compiler.codegen._kernel_target import OWN_LIBRARY
from jaxbiped.compiler.codegen._ptx_kernel import library_text
from tests.compiler.one_shot import loaded

SPECIAL = [0.0, -0.0, 5e-324, 1e-310, 1.0, -1.0, 2.0, -3.0, 0.5, -2.5, 1e300]
SPECIAL += [math.inf, -math.inf, math.nan]


def _function(name, count):
    library, declared = library_text()
    given = ", ".join(f"double %x{k}" for k in range(count))
    text = f"""{chr(10).join(sorted(declared))}
{library}
define double @entry({given}) {{
  %found = call double @{OWN_LIBRARY}{name}({given})
  ret double %found
}}
"""
    return loaded(text, "entry", count)


def _ulps(found, true):
    return abs(float((mpmath.mpf(found) - true) / mpmath.mpf(math.ulp(float(true)))))


def _same(found, expected):
    if math.isnan(expected):
        return math.isnan(found)
    if math.isinf(expected) or expected == 0.0:
        return found == expected and math.copysign(1, found) == math.copysign(1, expected)
    return abs(found - expected) <= 2 * math.ulp(expected)


@pytest.mark.parametrize("name", ["sin", "cos"])
def test_circular_functions_of_large_angles_are_exact_to_the_last_place(name):
    own, truth = _function(name, 1), getattr(mpmath, name)
    random = np.random.default_rng(1)
    angles = [*(2.0 ** random.uniform(20, 1024, 200) * random.choice([-1, 1], 200)), 2.0**20]
    # The 64-bit number nearest to a multiple of π/2 of all, and the largest.
    angles += [6381956970095103.0 * 2.0**797, 1.7976931348623157e308]
    with mpmath.workprec(1400):
        assert max(_ulps(own(x), truth(mpmath.mpf(x))) for x in angles) < 1.5
    for x in (math.inf, -math.inf, math.nan):
        assert math.isnan(own(x))


def test_logarithm_of_any_number():
    own = _function("log", 1)
    with np.errstate(all="ignore"):
        for x in [*SPECIAL, 2e-308, 1.7e308, 3e-320]:
            assert _same(own(x), float(np.log(x))), x


def test_power_of_any_numbers():
    own = _function("pow", 2)
    library = ctypes.CDLL(ctypes.util.find_library("m")).pow
    library.argtypes, library.restype = [ctypes.c_double] * 2, ctypes.c_double
    for x in SPECIAL:
        for y in [*SPECIAL, 3.0, 1e-3, 4503599627370497.0, 9007199254740994.0, -1e5]:
            assert _same(own(x, y), library(x, y)), (x, y)
