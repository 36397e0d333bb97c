"""Tables in LaTeX: columns of siunitx, values with their error bars in its own notation.

A bar has two digits, and its value as many decimals: 0.441032 ± 0.000012 is 0.441032(12), which the
versions 2 and 3 of siunitx read and set as value ± bar.
"""

import math
import re
from collections.abc import Mapping, Sequence
from decimal import Decimal
from typing import Any

_SPECIAL = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}", **{each: f"\\{each}" for each in "_%&#$"},
}  # fmt: skip
_NUMBER = re.compile(r"(-?)(\d+)(?:\.(\d+))?(?:\((\d+)\))?(?:e(-?)(\d+))?")
_UNIT = re.compile(r"[A-Za-z]+(\^[\w.-]+)?([ /][A-Za-z]+(\^[\w.-]+)?)*|1/[A-Za-z]+(\^\w+)?")
_LARGE, _SMALL = 5, -3
"""Powers of ten from which on, and below which, numbers have an exponent."""
_HEAD = "% needs \\usepackage{booktabs} and \\usepackage{siunitx}\n"


def escape_latex(text: str) -> str:
    """A text as LaTeX sets it; what stands between dollars is mathematics and stays."""
    parts = re.split(r"(\$[^$]*\$)", text)
    return "".join(
        part if k % 2 else "".join(_SPECIAL.get(each, each) for each in part)
        for k, part in enumerate(parts)
    )


def latex_unit(unit: str) -> str:
    r"""A unit for siunitx, `\unit{N.s/m^2}`; another text as text, nothing for a pure number.

    "SI" is what has another unit in each row.
    """
    if unit in ("", "1", "SI"):
        return ""
    if not _UNIT.fullmatch(unit) or " per " in unit:
        return escape_latex(unit)
    return rf"\unit{{{unit.replace(' ', '.')}}}"


def latex_number(value: float, error: float | None) -> str:
    """A number in siunitx's notation; what is no number in braces, as it must be in its columns.

    A bar that is zero or unknown (NaN) is left out; an infinite one is said.
    """
    if not math.isfinite(value):
        return "{--}"
    if error is not None and math.isinf(error):
        return rf"{{${value:.6g} \pm \infty$}}"
    if error is None or math.isnan(error) or error == 0.0:
        mantissa, _, exponent = f"{value:.6g}".partition("e")
        return f"{mantissa}e{int(exponent)}" if exponent else mantissa
    # Powers of ten of the bar's second digit, after rounding, and of the whole.
    last = Decimal(f"{error:.1e}").adjusted() - 1
    whole = Decimal(value).adjusted() if value else last + 1
    whole = max(whole, last + 1)
    power = whole if whole >= _LARGE or whole < _SMALL or last > 0 else 0
    decimals = power - last
    bar = round(Decimal(error).scaleb(-last))
    text = f"{Decimal(value).scaleb(-power):z.{decimals}f}({bar})"
    return f"{text}e{power}" if power else text


def _column(cells: Sequence[str]) -> str:
    """The type of a column: siunitx's with room for all its numbers, or one of words."""
    found = [number.groups(default="") for each in cells if (number := _NUMBER.fullmatch(each))]
    if not found:
        return "l"
    signs, wholes, decimals, bars, power_signs, powers = zip(*found, strict=True)

    def widest(parts: Sequence[str]) -> int:
        return max(map(len, parts))

    room = "-" * any(signs) + f"{widest(wholes)}" + f".{widest(decimals)}" * any(decimals)
    room += f"({widest(bars)})" * any(bars)
    if any(powers):
        room += "e" + "-" * any(power_signs) + f"{widest(powers)}"
    # Aligned uncertainties would touch the values before them.
    uncertain = ", separate-uncertainty, table-align-uncertainty=false" if any(bars) else ""
    return f"S[table-format={room}{uncertain}]"


def _is_number(column: Any) -> bool:
    return column.values.dtype.kind in "fiu"


def _cells(column: Any) -> list[str]:
    """A column's cells; numbers bare, all else as text."""
    if not _is_number(column):
        text = latex_unit if column.name.endswith("unit") else escape_latex
        return [text(str(each)) for each in column.values.tolist()]
    errors = [None] * len(column.values) if column.errors is None else column.errors.tolist()
    pairs = zip(column.values.tolist(), errors, strict=True)
    return [latex_number(value, error) for value, error in pairs]


def latex_table(columns: Sequence[Any], headings: Mapping[str, str], *, upright: bool) -> str:
    r"""A `tabular` of columns.

    Args:
        columns: each with `name`, `words`, `unit`, `values` and `errors`.
        headings: in LaTeX, of columns by name; others are called by their words.
        upright: whether the first row is set as lines of quantity, value and unit.
    """
    heads = [headings.get(each.name, escape_latex(each.words)) for each in columns]
    units = [latex_unit(each.unit) for each in columns]
    cells = [_cells(each) for each in columns]
    if upright:
        pairs = zip(columns, cells, strict=True)
        values = [own[0] if _is_number(each) else f"{{{own[0]}}}" for each, own in pairs]
        kinds = ["l", _column(values), "l"]
        heads, cells = ["quantity", "{value}", "unit"], [heads, values, units]
    else:
        pairs = zip(columns, cells, strict=True)
        kinds = [_column(own) if _is_number(each) else "l" for each, own in pairs]
        full = [f"{h} ({u})" if u else h for h, u in zip(heads, units, strict=True)]
        heads = [f"{{{head}}}" for head in full]
    rows = [" & ".join(row) + r" \\" for row in zip(*cells, strict=True)]
    return _HEAD + "\n".join(
        [
            rf"\begin{{tabular}}{{{' '.join(kinds)}}}",
            r"\toprule",
            " & ".join(heads) + r" \\",
            r"\midrule",
            *rows,
            r"\bottomrule",
            r"\end{tabular}",
            "",
        ]
    )
