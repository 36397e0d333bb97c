"""PTX kernel: the lanes' kernel for graphics devices, one simulation a thread, and its assembly.

A warp of 32 threads is to it what a vector of 32 lanes is on a CPU: where any of its threads is
done, all go through the refill together, in which those that are not keep what they have.

What kernels call of the C library on a CPU is LLVM's text of its own here. They call it only where
their own formulae do not hold, which is hardly ever.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

from jaxbiped.caching._caches import bounded_cache
from jaxbiped.compiler.codegen._kernel_target import OWN_LIBRARY, WARP_ANY, KernelTarget
from jaxbiped.compiler.codegen._llvm_from_graph import GraphWriter
from jaxbiped.compiler.codegen._llvm_function import literal
from jaxbiped.compiler.codegen._llvm_lane_loop import ENTRY
from jaxbiped.compiler.ir._elementary_functions import (
    HALF_PI,
    Arithmetic,
    any_logarithm,
    any_power,
    circular_within,
)
from jaxbiped.compiler.ir._graph import Block, Kind, Value
from jaxbiped.compiler.ir._liveness import Liveness
from jaxbiped.compiler.runtime._machine_code import foreign_machine, optimised_module

THREADS, BLOCKS = 64, 1
"""Threads of a block, and blocks of one multiprocessor that there must be registers for: few, so
that hardly anything is spilt to memory. Unless it is told a number of blocks, `ptxas` saves
registers in the longest programs."""
_TRIPLE = "nvptx64-nvidia-cuda"
_VOTE = f"""
define internal i1 @{WARP_ANY}(i1 %x) alwaysinline convergent {{
  %any = call i1 @llvm.nvvm.vote.any.sync(i32 -1, i1 %x)
  ret i1 %any
}}
"""
_VOTE_DECLARED = "declare i1 @llvm.nvvm.vote.any.sync(i32, i1)"
_SCALAR = KernelTarget(1, 1, scales=False)
_F64, _ANGLE = Kind.F64, (Kind.F64, Kind.F64, Kind.I64)
_WORDS, _LEADING = 24, 64
"""64-bit words of 2/π, the first of them zero: so many binary places come before its own."""
_DECLARED = (
    "declare i64 @llvm.fshl.i64(i64, i64, i64)",
    "declare i128 @llvm.ctlz.i128(i128, i1)",
    "declare double @llvm.fma.f64(double, double, double)",
)


class Architecture(NamedTuple):
    """A kind of device: its name, and the oldest PTX that knows it, as LLVM has them."""

    name: str
    features: str


ARCHITECTURES = {
    (8, 0): Architecture("sm_80", "+ptx70"),
    (9, 0): Architecture("sm_90", "+ptx78"),
    (10, 0): Architecture("sm_100", "+ptx86"),
}
"""By compute capability from which on. A driver assembles PTX for newer devices, too."""


def architecture_of(capability: tuple[int, int]) -> Architecture | None:
    """The newest that a device of this compute capability can run; None where there is none."""
    known = [each for each in ARCHITECTURES if each <= capability]
    return ARCHITECTURES[max(known)] if known else None


@bounded_cache(8)
def device_target(threads: int = THREADS, blocks: int = BLOCKS) -> KernelTarget:
    """Devices that run blocks of so many threads.

    Args:
        threads: of a block; whole warps.
        blocks: for how many at once on one multiprocessor there are to be registers.
    """
    library, declared = library_text()
    annotations = f"""!nvvm.annotations = !{{!1, !2}}
!1 = !{{ptr @{ENTRY}, !"maxntidx", i32 {threads}}}
!2 = !{{ptr @{ENTRY}, !"minctasm", i32 {blocks}}}"""
    own = frozenset(OWN_LIBRARY + name for name in ("log", "pow", "sin", "cos"))
    return KernelTarget(
        width=1,
        inner=1,
        scales=False,
        convention="ptx_kernel ",
        votes=True,
        library=OWN_LIBRARY,
        rest=f"{library}\n{_VOTE}{annotations}\n",
        declared=declared | {_VOTE_DECLARED},
        defined=own | {WARP_ANY},
    )


def ptx_text(text: str, architecture: Architecture) -> str:
    """A module's PTX.

    Sums and products are rounded one by one (`.rn`), so that no assembler fuses them anew.
    """
    machine = foreign_machine(_TRIPLE, cpu=architecture.name, features=architecture.features)
    return str(machine.emit_assembly(optimised_module(text, machine, triple=_TRIPLE)))


@bounded_cache(1)
def library_text() -> tuple[str, frozenset[str]]:
    """Functions log, pow, sin and cos behind `OWN_LIBRARY`; and what they declare."""
    makes: list[tuple[str, Sequence[Kind], Callable[..., Value]]] = [
        (f"{OWN_LIBRARY}log", (_F64,), any_logarithm),
        (f"{OWN_LIBRARY}pow", (_F64, _F64), any_power),
        ("reduced_sin", _ANGLE, partial(circular_within, quarter=0)),
        ("reduced_cos", _ANGLE, partial(circular_within, quarter=1)),
    ]
    parts, declarations = [_table_text(), _reduction_text()], set(_DECLARED)
    for name, kinds, make in makes:
        text, declared = _function_text(name, kinds, make)
        parts.append(text)
        declarations |= declared
    parts += [_sine_or_cosine_text(name) for name in ("sin", "cos")]
    return "\n".join(parts), frozenset(declarations)


def _function_text(
    name: str, kinds: Sequence[Kind], make: Callable[..., Value]
) -> tuple[str, set[str]]:
    """A function of numbers as LLVM's text, and its declarations."""
    block = Block()
    given = [Value("input", (), kind, block) for kind in kinds]
    result = make(Arithmetic(block), *given)
    writer = GraphWriter(_SCALAR, Liveness([result]))
    for k, value in enumerate(given):
        writer.name(value, f"%x{k}")
    writer.write(block)
    writer.text.line(f"ret {result.kind.value} {writer.use(result)}")
    taken = ", ".join(f"{kind.value} %x{k}" for k, kind in enumerate(kinds))
    head = f"define internal {result.kind.value} @{name}({taken}) noinline {{\nentry:"
    return "\n".join([head, *writer.text.lines, "}"]), writer.text.declarations


def _two_over_pi(places: int) -> int:
    """2/π 2ⁿ for n = `places`, rounded down but for the last place or two."""
    more = places + 64
    one = 1 << more

    def arctangent(inverse: int) -> int:
        power, total, k = one // inverse, 0, 1
        while power:
            total += (power // k) * (1 if k % 4 == 1 else -1)
            power, k = power // inverse**2, k + 2
        return total

    pi = 4 * (4 * arctangent(5) - arctangent(239))
    return (2 * one * one // pi) >> (more - places)


def _table_text() -> str:
    whole = _two_over_pi(64 * _WORDS - _LEADING)
    words = [(whole >> (64 * k)) & ((1 << 64) - 1) for k in reversed(range(_WORDS))]
    listed = ", ".join(f"i64 {word}" for word in words)
    return f"@two_over_pi = internal constant [{_WORDS} x i64] [{listed}]"


def _reduction_text() -> str:
    """Payne and Hanek's reduction of an angle of at least `LARGE_ANGLE`.

    Of x 2/π modulo 4, in 192 bits, what is left of the nearest whole number times π/2, in two
    parts, and that number. (Payne, Hanek 1983, SIGNUM Newsletter 18.)
    """
    words = "\n".join(
        f"""  %a{k} = add i64 %word, {k}
  %p{k} = getelementptr [{_WORDS} x i64], ptr @two_over_pi, i64 0, i64 %a{k}
  %t{k} = load i64, ptr %p{k}"""
        for k in range(4)
    )
    shifted = "\n".join(
        f"""  %w{k} = call i64 @llvm.fshl.i64(i64 %t{k}, i64 %t{k + 1}, i64 %shift)
  %v{k} = zext i64 %w{k} to i128
  %m{k} = mul i128 %wide, %v{k}"""
        for k in range(3)
    )
    first, second = (literal(part, Kind.F64) for part in HALF_PI[:2])
    return f"""define internal {{double, double, i64}} @reduce_angle(double %x) noinline {{
  %bits = bitcast double %x to i64
  %raised = lshr i64 %bits, 52
  %exponent = and i64 %raised, 2047
  %fraction = and i64 %bits, {(1 << 52) - 1}
  %mantissa = or i64 %fraction, {1 << 52}
  %place = sub i64 %exponent, 1013
  %word = lshr i64 %place, 6
  %shift = and i64 %place, 63
{words}
  %wide = zext i64 %mantissa to i128
{shifted}
  %c2 = lshr i128 %m2, 64
  %s1 = add i128 %m1, %c2
  %c1 = lshr i128 %s1, 64
  %s0 = add i128 %m0, %c1
  %h = trunc i128 %s0 to i64
  %near = add i64 %h, {1 << 61}
  %number = lshr i64 %near, 62
  %back = shl i64 %number, 62
  %left = sub i64 %h, %back
  %left.wide = sext i64 %left to i128
  %left.up = shl i128 %left.wide, 64
  %mid = and i128 %s1, {(1 << 64) - 1}
  %signed = or i128 %left.up, %mid
  %under = icmp slt i64 %left, 0
  %minus = sub i128 0, %signed
  %size = select i1 %under, i128 %minus, i128 %signed
  %some = or i128 %size, 1
  %zeros.wide = call i128 @llvm.ctlz.i128(i128 %some, i1 false)
  %zeros = trunc i128 %zeros.wide to i64
  %normal = shl i128 %some, %zeros.wide
  %top.wide = lshr i128 %normal, 75
  %top = trunc i128 %top.wide to i64
  %bottom.wide = lshr i128 %normal, 11
  %bottom = trunc i128 %bottom.wide to i64
  %top.real = uitofp i64 %top to double
  %bottom.real = uitofp i64 %bottom to double
  %top.power = sub i64 972, %zeros
  %top.bits = shl i64 %top.power, 52
  %top.scale = bitcast i64 %top.bits to double
  %bottom.power = sub i64 908, %zeros
  %bottom.bits = shl i64 %bottom.power, 52
  %bottom.scale = bitcast i64 %bottom.bits to double
  %f1 = fmul double %top.real, %top.scale
  %f2 = fmul double %bottom.real, %bottom.scale
  %r = fmul double %f1, {first}
  %r.minus = fneg double %r
  %l0 = call double @llvm.fma.f64(double %f1, double {first}, double %r.minus)
  %l1 = call double @llvm.fma.f64(double %f1, double {second}, double %l0)
  %l2 = call double @llvm.fma.f64(double %f2, double {first}, double %l1)
  %rest = fadd double %r, %l2
  %lost = fsub double %r, %rest
  %low = fadd double %lost, %l2
  %negative = icmp slt i64 %bits, 0
  %turns = xor i1 %negative, %under
  %rest.minus = fneg double %rest
  %low.minus = fneg double %low
  %rest.signed = select i1 %turns, double %rest.minus, double %rest
  %low.signed = select i1 %turns, double %low.minus, double %low
  %number.minus = sub i64 0, %number
  %number.signed = select i1 %negative, i64 %number.minus, i64 %number
  %nothing = fsub double %x, %x
  %known = fadd double %rest.signed, %nothing
  %o1 = insertvalue {{double, double, i64}} poison, double %known, 0
  %o2 = insertvalue {{double, double, i64}} %o1, double %low.signed, 1
  %o3 = insertvalue {{double, double, i64}} %o2, i64 %number.signed, 2
  ret {{double, double, i64}} %o3
}}"""


def _sine_or_cosine_text(name: str) -> str:
    return f"""define internal double @{OWN_LIBRARY}{name}(double %x) noinline {{
  %angle = call {{double, double, i64}} @reduce_angle(double %x)
  %rest = extractvalue {{double, double, i64}} %angle, 0
  %low = extractvalue {{double, double, i64}} %angle, 1
  %number = extractvalue {{double, double, i64}} %angle, 2
  %found = call double @reduced_{name}(double %rest, double %low, i64 %number)
  ret double %found
}}"""
