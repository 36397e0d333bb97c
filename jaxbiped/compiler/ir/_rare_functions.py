"""Elementary functions where the usual formulae do not hold, for devices without a C library.

Zero, subnormal, negative and infinite numbers, NaN, and overflow; as IEEE 754 and C have it.
"""

import math

from jaxbiped.compiler.ir._elementary_functions import (
    LN2_HIGH,
    LN2_LOW,
    TINIEST_NORMAL,
    Arithmetic,
    exponential,
    normal_logarithm,
    turned,
    within_quarter,
)
from jaxbiped.compiler.ir._graph import Kind, Value
from jaxbiped.compiler.ir._powers import precise_logarithm, sum_in_two

_LIFT = 54
"""Binary exponent by which subnormal numbers are lifted among the normal ones."""
_SIGN = -(1 << 63)
_MOST = 1e4
"""Of an exponent, far beyond where powers of e overflow."""


def any_logarithm(m: Arithmetic, x: Value) -> Value:
    """log x of any number."""
    lifted, lift = _lifted(m, x)
    value = m.sub(normal_logarithm(m, lifted), m.mul(lift, math.log(2.0)))
    value = m.choose(m.compare("oeq", x, 0.0), -math.inf, value)
    # Infinity and NaN are their own logarithms.
    value = m.choose(m.compare("olt", x, math.inf), value, x)
    return m.choose(m.compare("olt", x, 0.0), math.nan, value)


def any_power(m: Arithmetic, x: Value, y: Value) -> Value:
    """x ** y of any numbers."""
    size, y_size = m.abs(x), m.abs(y)
    value = _power_of_size(m, size, y)
    half = m.mul(y, 0.5)
    whole = m.both(_is_whole(m, y), m.compare("olt", y_size, math.inf))
    odd = m.both(whole, m.block.add("not", _is_whole(m, half)))
    negative = m.block.add("icmp slt", m.bits(x), m.whole(0), kind=Kind.BOOL)
    signed = m.from_bits(m.integer("xor", m.bits(value), _SIGN))
    value = m.choose(m.both(negative, odd), signed, value)
    finite = m.both(m.compare("olt", x, 0.0), m.compare("olt", size, math.inf))
    broken = m.both(m.compare("olt", y_size, math.inf), m.block.add("not", whole))
    value = m.choose(m.both(finite, broken), math.nan, value)
    value = m.choose(m.compare("uno", x, y), math.nan, value)
    value = m.choose(m.compare("oeq", x, 1.0), 1.0, value)
    return m.choose(m.compare("oeq", y, 0.0), 1.0, value)


def _power_of_size(m: Arithmetic, size: Value, y: Value) -> Value:
    """size ** y where `size` has no sign; both may be zero or infinite."""
    lifted, lift = _lifted(m, size)
    minus = m.neg(lift)
    high, low = precise_logarithm(m, lifted)
    low = m.fma(minus, LN2_LOW, low)
    high, low = sum_in_two(m, high, low, m.mul(minus, LN2_HIGH))
    high = m.choose(m.compare("oeq", size, 0.0), -math.inf, high)
    high = m.choose(m.compare("oeq", size, math.inf), math.inf, high)
    product = m.mul(y, high)
    bounded = m.compare("olt", m.abs(product), _MOST)
    rest = m.fma(y, low, m.fma(y, high, m.neg(product)))
    beyond = m.choose(m.compare("ogt", product, 0.0), _MOST, -_MOST)
    value = exponential(m, m.choose(bounded, product, beyond), m.choose(bounded, rest, 0.0))
    # Of an infinite exponent: one stays one.
    return m.choose(m.compare("oeq", size, 1.0), 1.0, value)


def circular_within(m: Arithmetic, rest: Value, low: Value, number: Value, quarter: int) -> Value:
    """Sine, or cosine one `quarter` on, of an angle that is reduced to less than a quarter turn."""
    sine, cosine = within_quarter(m, rest, low)
    return turned(m, number, quarter, sine, cosine)


def _lifted(m: Arithmetic, x: Value) -> tuple[Value, Value]:
    """x 2ⁿ, normal where x is subnormal, and n."""
    low = m.compare("olt", x, TINIEST_NORMAL)
    lift = m.choose(low, float(_LIFT), 0.0)
    return m.choose(low, m.mul(x, 2.0**_LIFT), x), lift


def _is_whole(m: Arithmetic, x: Value) -> Value:
    return m.compare("oeq", m.block.add("floor", x), x)
