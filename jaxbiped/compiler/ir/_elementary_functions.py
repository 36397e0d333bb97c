"""Elementary functions and powers from plain arithmetic, as parts of a graph.

Every function holds over all 64-bit numbers, infinities and NaN included, as IEEE 754 and C have
it, for devices without a C library too. The tests measure errors in units in the last place.
"""

import math
from collections.abc import Callable, Sequence
from typing import TypeVar

from jaxbiped._trigonometry import COSINE_SERIES, SINE_SERIES
from jaxbiped.compiler.ir._graph import Block, Kind, Value


class Arithmetic:
    """64-bit arithmetic in a block. Plain numbers stand for constants."""

    def __init__(self, block: Block) -> None:
        self.block = block

    def real(self, x: Value | float) -> Value:
        return x if isinstance(x, Value) else self.block.const(x, Kind.F64)

    def whole(self, x: Value | int) -> Value:
        return x if isinstance(x, Value) else self.block.const(x, Kind.I64)

    def add(self, a: Value | float, b: Value | float) -> Value:
        return self.block.add("fadd", self.real(a), self.real(b))

    def sub(self, a: Value | float, b: Value | float) -> Value:
        return self.block.add("fsub", self.real(a), self.real(b))

    def mul(self, a: Value | float, b: Value | float) -> Value:
        return self.block.add("fmul", self.real(a), self.real(b))

    def div(self, a: Value | float, b: Value | float) -> Value:
        return self.block.add("fdiv", self.real(a), self.real(b))

    def fma(self, a: Value | float, b: Value | float, c: Value | float) -> Value:
        """a b + c, rounded once."""
        return self.block.add("fma", self.real(a), self.real(b), self.real(c))

    def neg(self, a: Value) -> Value:
        return self.block.add("fneg", a)

    def abs(self, a: Value) -> Value:
        return self.block.add("fabs", a)

    def rint(self, a: Value) -> Value:
        return self.block.add("rint", a)

    def compare(self, how: str, a: Value, b: Value | float) -> Value:
        return self.block.add(f"fcmp {how}", a, self.real(b), kind=Kind.BOOL)

    def choose(self, condition: Value, a: Value | float, b: Value | float) -> Value:
        return self.block.add("select", condition, self.real(a), self.real(b), kind=Kind.F64)

    def both(self, a: Value, b: Value) -> Value:
        return self.block.add("and", a, b)

    def integer(self, op: str, a: Value, b: Value | int) -> Value:
        return self.block.add(op, a, self.whole(b))

    def bits(self, a: Value) -> Value:
        return self.block.add("bitcast", a, kind=Kind.I64)

    def from_bits(self, a: Value) -> Value:
        return self.block.add("bitcast", a, kind=Kind.F64)

    def truncated(self, a: Value) -> Value:
        """A whole number below 2⁶³; anything for any other."""
        return self.block.add("to_int", a, kind=Kind.I64)

    def floated(self, a: Value) -> Value:
        return self.block.add("to_float", a, kind=Kind.F64)

    def series(self, x: Value, coefficients: Sequence[float]) -> Value:
        """A polynomial, highest power first, by halves (Estrin): its parts need not wait."""
        terms: list[Value | float] = list(reversed(coefficients))
        while len(terms) > 1:
            pairs = [
                self.fma(terms[i + 1], x, terms[i]) if i + 1 < len(terms) else terms[i]
                for i in range(0, len(terms), 2)
            ]
            terms, x = [*pairs], self.mul(x, x)
        return self.real(terms[0])

    def scaled(self, x: Value, exponent: Value) -> Value:
        """x 2ⁿ for a whole number n, rounded once."""
        return self.block.add("ldexp", x, exponent)

    def where_rare(
        self, rare: Value, value: Value, other: "Callable[[Arithmetic], Value]"
    ) -> Value:
        """`value`, but in the lanes that are `rare` another, computed only where there are any."""
        inside = Block(self.block, rare=True)
        found = other(Arithmetic(inside))
        results = self.block.region("if", (rare, inside, (found,), (value,)), [found.kind])
        return results[0]

    def per_lane(self, name: str, *args: Value) -> Value:
        """The C library's function of all but the last; lane by lane, where the last holds."""
        return self.block.add(f"libm {name}", *args, kind=Kind.F64)


LN2_HIGH, LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
"""Two parts of ln 2: the first has 33 bits, so that its product with an exponent is exact."""
_EXP_SERIES = (
    2.510038319586702e-08,
    2.7620085455018414e-07,
    2.7557268464831627e-06,
    2.4801521302241082e-05,
    0.00019841269863050506,
    0.001388888891720967,
    0.008333333333330063,
    0.041666666666624136,
    0.16666666666666669,
    0.5000000000000001,
)
"""(exp r − 1 − r)/r² through its values at Chebyshev's points of |r| ≤ 0.3466; off by 1.7e-17."""
_EXP_IS_ZERO = -746.0
"""Below it exp x is less than half the smallest number."""
_LOG_SERIES = (
    1.479819860511658591e-01,
    1.531383769920937332e-01,
    1.818357216161805012e-01,
    2.222219843214978396e-01,
    2.857142874366239149e-01,
    3.999999999940941908e-01,
    6.666666666666735130e-01,
)
"""Minimax coefficients of log((1 + s)/(1 − s)) (FreeBSD's msun, e_log.c), highest power first."""
_SQRT_HALF_BITS = 0x3FE6A09E667F3BCD
_ONE_BITS = 0x3FF0000000000000
TINIEST_NORMAL = 2.2250738585072014e-308


def exponential(m: Arithmetic, x: Value, low: Value | float = 0.0) -> Value:
    """exp(x + low), `low` a small correction."""
    clamped = m.choose(m.compare("ogt", x, 800.0), 800.0, x)
    # A product that falls below all numbers takes a CPU many times as long as any other.
    nothing = m.compare("olt", x, _EXP_IS_ZERO)
    clamped = m.choose(nothing, 0.0, clamped)
    n = m.rint(m.mul(clamped, 1.0 / math.log(2.0)))
    minus = m.neg(n)
    r = m.fma(minus, LN2_LOW, m.fma(minus, LN2_HIGH, clamped))
    r = m.add(r, low)
    value = m.add(m.fma(m.mul(r, r), m.series(r, _EXP_SERIES), r), 1.0)
    return m.choose(nothing, 0.0, m.scaled(value, n))


def split_exponent(m: Arithmetic, x: Value) -> tuple[Value, Value]:
    """k and f with x = 2^k (1 + f), 1 + f in [√½, √2); for x above zero, normal and finite."""
    moved = m.integer("add", m.bits(x), _ONE_BITS - _SQRT_HALF_BITS)
    exponent = m.integer("sub", m.integer("lshr", moved, 52), 1023)
    fraction = m.integer("add", m.integer("and", moved, (1 << 52) - 1), _SQRT_HALF_BITS)
    return m.floated(exponent), m.sub(m.from_bits(fraction), 1.0)


def normal_logarithm(m: Arithmetic, x: Value) -> Value:
    """log x for x above zero, normal and finite (FreeBSD's msun, e_log.c)."""
    k, f = split_exponent(m, x)
    s = m.div(f, m.add(f, 2.0))
    z = m.mul(s, s)
    series = m.mul(z, m.series(z, _LOG_SERIES))
    half = m.mul(m.mul(f, f), 0.5)
    inner = m.fma(s, m.add(half, series), m.mul(k, LN2_LOW))
    return m.sub(m.mul(k, LN2_HIGH), m.sub(m.sub(half, inner), f))


def logarithm(m: Arithmetic, x: Value) -> Value:
    value = normal_logarithm(m, x)
    normal = m.both(m.compare("oge", x, TINIEST_NORMAL), m.compare("olt", x, math.inf))
    rare = m.block.add("not", normal)
    return m.where_rare(rare, value, lambda inside: inside.per_lane("log", x, rare))


HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591833e-33)
"""π/2 in three parts."""
LARGE_ANGLE = 2.0**20


def _quarter_turns(m: Arithmetic, x: Value) -> tuple[Value, Value, Value]:
    """Quadrant, sine and cosine of the angle that is left."""
    q = m.rint(m.mul(x, 2.0 / math.pi))
    minus = m.neg(q)
    first = m.fma(minus, HALF_PI[0], x)
    rest = m.fma(minus, HALF_PI[1], first)
    low = m.fma(minus, HALF_PI[2], m.fma(minus, HALF_PI[1], m.sub(first, rest)))
    sine, cosine = within_quarter(m, rest, low)
    return m.truncated(q), sine, cosine


def within_quarter(m: Arithmetic, rest: Value, low: Value) -> tuple[Value, Value]:
    """Sine and cosine of `rest` + `low`, at most π/4 and a little."""
    z = m.mul(rest, rest)
    cubed = m.mul(m.mul(rest, z), m.series(z, SINE_SERIES))
    half = m.mul(z, 0.5)
    near = m.sub(1.0, half)
    lost = m.sub(m.sub(1.0, near), half)
    curved = m.fma(m.mul(z, z), m.series(z, COSINE_SERIES), lost)
    cosine = m.add(near, m.fma(m.neg(rest), low, curved))
    return m.add(rest, m.fma(low, near, cubed)), cosine


def turned(m: Arithmetic, number: Value, quarter: int, sine: Value, cosine: Value) -> Value:
    """Sine, or cosine one `quarter` on, of an angle after a `number` of quarter turns."""
    number = m.integer("add", number, quarter)
    odd = m.block.add("icmp ne", m.integer("and", number, 1), m.whole(0), kind=Kind.BOOL)
    back = m.block.add("icmp ne", m.integer("and", number, 2), m.whole(0), kind=Kind.BOOL)
    value = m.choose(odd, cosine, sine)
    return m.choose(back, m.neg(value), value)


def _sine_or_cosine(name: str, quarter: int) -> Callable[[Arithmetic, Value], Value]:
    def function(m: Arithmetic, x: Value) -> Value:
        number, sine, cosine = _quarter_turns(m, x)
        value = turned(m, number, quarter, sine, cosine)
        if quarter == 0:
            value = _near_zero(m, x, value)
        large = m.block.add("not", m.compare("olt", m.abs(x), LARGE_ANGLE))
        return m.where_rare(large, value, lambda inside: inside.per_lane(name, x, large))

    return function


sine = _sine_or_cosine("sin", 0)
cosine = _sine_or_cosine("cos", 1)

_TANH_ABOVE = (-9.64399179425052238628e-1, -9.92877231001918586564e1, -1.61468768441708447952e3)
_TANH_BELOW = (1.0, 1.12811678491632931402e2, 2.23548839060100448583e3, 4.84406305325125486048e3)
"""Rational approximation of (tanh x / x − 1)/x² below 0.625 (Cephes, tanh.c)."""


def hyperbolic_tangent(m: Arithmetic, x: Value) -> Value:
    z = m.mul(x, x)
    ratio = m.div(m.series(z, _TANH_ABOVE), m.series(z, _TANH_BELOW))
    small = m.fma(m.mul(x, z), ratio, x)
    size = m.abs(x)
    power = exponential(m, m.add(size, size))
    large = m.sub(1.0, m.div(2.0, m.add(power, 1.0)))
    large = m.choose(m.compare("olt", x, 0.0), m.neg(large), large)
    return _near_zero(m, x, m.choose(m.compare("ogt", size, 0.625), large, small))


def _near_zero(m: Arithmetic, x: Value, value: Value) -> Value:
    """`value`, but where it is x itself to the last place x: the sign of zero stays."""
    return m.choose(m.compare("olt", m.abs(x), 2.0**-27), x, value)


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
