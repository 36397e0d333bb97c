"""Fused multiply-add in software, as LLVM's text: for targets that have no such instruction.

The product and the sum are taken in two parts each; what both leave is added by rounding to odd, so
that the last sum rounds as if nothing had been rounded before. Source: S. Boldo and G. Melquiond,
"Emulation of a FMA and correctly rounded sums", IEEE Transactions on Computers 57 (2008), 462-471.
Exact wherever no part of the product is below the smallest normal number; what is not finite, or
whose halves would not be, is multiplied and added.
"""

import re

_CALL = re.compile(r"call double @llvm\.fma\.f64\(")
_DECLARATION = "declare double @llvm.fma.f64(double, double, double)\n"
_NAME = "software_fma"


def with_software_fma(text: str) -> str:
    """A module's text, its scalar fused multiply-adds by a function of its own."""
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
