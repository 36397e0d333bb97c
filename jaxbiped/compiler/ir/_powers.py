"""Powers, and elementary functions where the usual formulae do not hold, as parts of a graph.

Zero, subnormal, negative and infinite numbers, NaN, and overflow are as IEEE 754 and C have it, for
devices without a C library.
"""

import math
from collections.abc import Callable
from typing import TypeVar

from jaxbiped.compiler.ir._elementary_functions import (
    LN2_HIGH,
    LN2_LOW,
    TINIEST_NORMAL,
    Arithmetic,
    exponential,
    logarithm,
    normal_logarithm,
    split_exponent,
    turned,
    within_quarter,
)
from jaxbiped.compiler.ir._graph import Kind, Value

_T = TypeVar("_T")
_TWO_THIRDS = (0.6666666666666666, 3.700743415417188e-17)
_ATANH_TAIL = tuple(2.0 / k for k in range(23, 4, -2))
_LIFT = 54
"""Binary exponent by which subnormal numbers are lifted among the normal ones."""
_SIGN = -(1 << 63)
_MOST = 1e4
"""Of an exponent, far beyond where powers of e overflow."""


def whole_power(
    a: _T,
    exponent: int,
    multiply: Callable[[_T, _T], _T],
    divide: Callable[[_T, _T], _T],
    one_like: Callable[[_T], _T],
) -> _T:
    """A whole power by repeated multiplication, as XLA takes it."""
    result, base, left = None, a, abs(exponent)
    while left:
        if left & 1:
            result = base if result is None else multiply(result, base)
        left >>= 1
        if left:
            base = multiply(base, base)
    one = one_like(a)
    result = one if result is None else result
    return result if exponent >= 0 else divide(one, result)


def power(m: Arithmetic, x: Value, y: Value) -> Value:
    """x ** y; what is not above zero, normal and finite by the C library."""
    high, low = precise_logarithm(m, x)
    product = m.mul(y, high)
    rest = m.fma(y, low, m.fma(y, high, m.neg(product)))
    value = exponential(m, product, rest)
    normal = m.both(m.compare("oge", x, TINIEST_NORMAL), m.compare("olt", x, math.inf))
    bounded = m.compare("olt", m.abs(product), 1e4)
    rare = m.block.add("not", m.both(normal, bounded))
    return m.where_rare(rare, value, lambda inside: inside.per_lane("pow", x, y, rare))


def power_of_root(m: Arithmetic, x: Value, y: Value) -> Value:
    """exp(y log x), which for y = 3/2 is x √x."""
    rare = m.block.add("not", m.compare("oeq", y, 1.5))
    root = m.block.add("sqrt", x)
    return m.where_rare(
        rare,
        m.mul(x, root),
        lambda inside: exponential(inside, inside.mul(y, logarithm(inside, x))),
    )


def precise_logarithm(m: Arithmetic, x: Value) -> tuple[Value, Value]:
    """log x in two parts, to about 2⁻⁶⁴ of itself, for x above zero and finite."""
    k, f = split_exponent(m, x)
    total = m.add(f, 2.0)
    lost = m.sub(f, m.sub(total, 2.0))
    s = m.div(f, total)
    s_low = m.div(m.fma(m.neg(s), lost, m.fma(m.neg(s), total, f)), total)
    z = m.mul(s, s)
    z_low = m.fma(m.add(s, s), s_low, m.fma(s, s, m.neg(z)))
    cube = m.mul(s, z)
    cube_low = m.fma(s, z_low, m.fma(s_low, z, m.fma(s, z, m.neg(cube))))
    third = m.mul(cube, _TWO_THIRDS[0])
    third_low = m.fma(cube, _TWO_THIRDS[0], m.neg(third))
    third_low = m.fma(cube_low, _TWO_THIRDS[0], m.fma(cube, _TWO_THIRDS[1], third_low))
    tail = m.mul(m.mul(cube, z), m.series(z, _ATANH_TAIL))
    high, low = m.add(s, s), m.add(s_low, s_low)
    high, low = sum_in_two(m, high, m.add(low, m.add(third_low, tail)), third)
    shifted, shifted_low = sum_in_two(m, m.mul(k, LN2_HIGH), low, high)
    return sum_in_two(m, shifted, m.fma(k, LN2_LOW, shifted_low), m.real(0.0))


def sum_in_two(m: Arithmetic, a: Value, low: Value, b: Value) -> tuple[Value, Value]:
    """a + b + low in two parts, the second below the first's last place."""
    total = m.add(a, b)
    part = m.sub(total, a)
    rest = m.add(m.sub(a, m.sub(total, part)), m.sub(b, part))
    rest = m.add(rest, low)
    high = m.add(total, rest)
    return high, m.add(m.sub(total, high), rest)


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
