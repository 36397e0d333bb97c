"""Powers from plain arithmetic, as parts of a graph."""

import math

from jaxbiped.compiler.ir._elementary_functions import (
    LN2_HIGH,
    LN2_LOW,
    TINIEST_NORMAL,
    Arithmetic,
    exponential,
    logarithm,
    split_exponent,
)
from jaxbiped.compiler.ir._graph import Value


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


_TWO_THIRDS = (0.6666666666666666, 3.700743415417188e-17)


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


_ATANH_TAIL = tuple(2.0 / k for k in range(23, 4, -2))


def sum_in_two(m: Arithmetic, a: Value, low: Value, b: Value) -> tuple[Value, Value]:
    """a + b + low in two parts, the second below the first's last place."""
    total = m.add(a, b)
    part = m.sub(total, a)
    rest = m.add(m.sub(a, m.sub(total, part)), m.sub(b, part))
    rest = m.add(rest, low)
    high = m.add(total, rest)
    return high, m.add(m.sub(total, high), rest)
