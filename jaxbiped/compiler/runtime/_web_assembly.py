"""WebAssembly: a program's kernel as a module that a page runs, one simulation after the other.

What LLVM writes for one function is a module already, but for the export of that function: memory,
the pointer to its stack and the C library's functions for rare arguments are imports that the page
gives, and its constants lie at the start of the memory. So nothing has to be linked.
"""

import re
from collections.abc import Iterator

from jaxbiped.compiler.codegen._kernel_target import host_target
from jaxbiped.compiler.codegen._llvm_lane_loop import ENTRY, kernel_text
from jaxbiped.compiler.runtime._machine_code import Host, foreign_machine, optimised_module
from jaxbiped.compiler.runtime._program import Graph

_PAGE = Host("wasm32-unknown-unknown", "generic", "+bulk-memory", 1, False)
_CUSTOM, _IMPORT, _EXPORT = 0, 2, 7
_PLACES = {12: 9.5}
"""Sections stand by their numbers, but for the data's count."""
_CALL = re.compile(r"call double @llvm\.fma\.f64\(")
_DECLARATION = "declare double @llvm.fma.f64(double, double, double)\n"
_NAME = "software_fma"


def web_module(graph: Graph) -> bytes:
    """A module of WebAssembly whose export `jaxbiped_run` takes the address of a kernel's fields.

    Its results are those of the host's code to the last bit, but where the C library is asked, or
    where numbers are below the smallest normal one.

    Args:
        graph: of a program without maps over arrays.

    Returns:
        The module. Imports from `env`: memory, its stack's pointer, the C library's functions.
    """
    machine = foreign_machine(_PAGE.triple, cpu=_PAGE.cpu, features=_PAGE.features)
    text = with_software_fma(kernel_text(graph, host_target(1, _PAGE)))
    module = optimised_module(text, machine, triple=_PAGE.triple)
    return _exporting(bytes(machine.emit_object(module)), ENTRY)


def _exporting(written: bytes, name: str) -> bytes:
    """A module with its first own function exported, without what only a linker reads."""
    sections = [(kind, body) for kind, body in _sections(written) if kind != _CUSTOM]
    imports = next((body for kind, body in sections if kind == _IMPORT), b"\0")
    place = _imported_functions(imports)
    export = bytes([1, len(name)]) + name.encode() + b"\0" + _encoded(place)
    sections.append((_EXPORT, export))
    sections.sort(key=lambda section: _PLACES.get(section[0], section[0]))
    return written[:8] + b"".join(bytes([k]) + _encoded(len(b)) + b for k, b in sections)


def _sections(module: bytes) -> Iterator[tuple[int, bytes]]:
    place = 8
    while place < len(module):
        kind = module[place]
        size, place = _number(module, place + 1)
        yield kind, module[place : place + size]
        place += size


def _imported_functions(imports: bytes) -> int:
    """How many of the imports are functions: their indices come before a module's own."""
    many, place = _number(imports, 0)
    functions = 0
    for _ in range(many):
        for _ in range(2):  # the module's name and the import's
            size, place = _number(imports, place)
            place += size
        kind, place = imports[place], place + 1
        if kind == 0:
            functions, place = functions + 1, _number(imports, place)[1]
        elif kind == 3:
            place += 2
        else:
            place += kind == 1  # a table's type, then limits as a memory has them
            bounded, place = imports[place], place + 1
            for _ in range(1 + (bounded & 1)):
                place = _number(imports, place)[1]
    return functions


def _number(data: bytes, place: int) -> tuple[int, int]:
    """A number in seven bits a byte, and the place behind it."""
    value = shift = 0
    while True:
        byte = data[place]
        value, shift, place = value | (byte & 127) << shift, shift + 7, place + 1
        if byte < 128:
            return value, place


def _encoded(value: int) -> bytes:
    parts = []
    while value > 127:
        parts.append(value & 127 | 128)
        value >>= 7
    return bytes([*parts, value])


def with_software_fma(text: str) -> str:
    """A module's text, its scalar fused multiply-adds by a function of its own.

    For targets that have no such instruction. The product and the sum are taken in two parts each;
    what both leave is added by rounding to odd, so that the last sum rounds as if nothing had been
    rounded before. Exact wherever no part of the product is below the smallest normal number; what
    is not finite, or whose halves would not be, is multiplied and added. Source: S. Boldo and
    G. Melquiond, "Emulation of a FMA and correctly rounded sums", IEEE Transactions on Computers 57
    (2008), 462-471.
    """
    called = _CALL.sub(f"call double @{_NAME}(", text.replace(_DECLARATION, ""))
    return called if called == text else called + _FUNCTION


def _halves(x: str) -> str:
    """Two numbers of half as many digits, whose sum is x (Veltkamp)."""
    return f"""\
  %{x}_wide = fmul double %{x}, 134217729.0
  %{x}_over = fsub double %{x}_wide, %{x}
  %{x}_high = fsub double %{x}_wide, %{x}_over
  %{x}_low = fsub double %{x}, %{x}_high
"""


def _sum(stem: str, a: str, b: str) -> str:
    """The sum of two numbers and what it leaves (Knuth)."""
    return f"""\
  %{stem}_high = fadd double {a}, {b}
  %{stem}_part = fsub double %{stem}_high, {a}
  %{stem}_first = fsub double %{stem}_high, %{stem}_part
  %{stem}_left = fsub double {a}, %{stem}_first
  %{stem}_right = fsub double {b}, %{stem}_part
  %{stem}_low = fadd double %{stem}_left, %{stem}_right
"""


_FUNCTION = f"""
define internal double @{_NAME}(double %a, double %b, double %c) noinline {{
  %product = fmul double %a, %b
{_halves("a")}{_halves("b")}\
  %hh = fmul double %a_high, %b_high
  %hl = fmul double %a_high, %b_low
  %lh = fmul double %a_low, %b_high
  %ll = fmul double %a_low, %b_low
  %e1 = fsub double %hh, %product
  %e2 = fadd double %e1, %hl
  %e3 = fadd double %e2, %lh
  %rest = fadd double %e3, %ll
{_sum("t", "%c", "%rest")}{_sum("v", "%product", "%t_high")}{_sum("s", "%t_low", "%v_low")}\
  %bits = bitcast double %s_high to i64
  %odd = trunc i64 %bits to i1
  %inexact = fcmp une double %s_low, 0.0
  %up = fcmp ogt double %s_low, 0.0
  %positive = fcmp ogt double %s_high, 0.0
  %away = icmp eq i1 %up, %positive
  %further = select i1 %away, i64 1, i64 -1
  %even = xor i1 %odd, 1
  %moves = and i1 %even, %inexact
  %move = select i1 %moves, i64 %further, i64 0
  %moved = add i64 %bits, %move
  %tail = bitcast i64 %moved to double
  %exact = fadd double %v_high, %tail
  %nothing = fsub double %exact, %exact
  %finite = fcmp oeq double %nothing, 0.0
  %plain = fadd double %product, %c
  %zero = fcmp oeq double %exact, 0.0
  %unlike = xor i1 %finite, 1
  %signed = or i1 %zero, %unlike
  %result = select i1 %signed, double %plain, double %exact
  ret double %result
}}
"""
