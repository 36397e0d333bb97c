"""Numbers and tables in LaTeX, against siunitx's notation and the numbers that it stands for."""

import math
import re
from decimal import Decimal

import hypothesis
import pytest
import xarray as xr
from hypothesis import strategies as st

from jaxbiped.measure import to_latex

NUMBER = re.compile(r"(-?\d+)(?:\.(\d+))?(?:\((\d+)\))?(?:e(-?\d+))?")
"""As siunitx's manual has it: decimals, an uncertainty in its last digits, an exponent."""
SIZES = st.floats(1e-12, 1e12)


def dataset_of(*columns, dims=("row",)):
    """A dataset of columns: names with values, error bars or none, and units."""
    variables = {}
    for name, values, errors, unit in (each + (None, "")[len(each) - 2 :] for each in columns):
        attributes = {"long_name": name, "units": unit}
        if errors is not None:
            attributes["ancillary_variables"] = f"bars of {name}"
            variables[f"bars of {name}"] = dims, errors
        variables[name] = dims, values, attributes
    return xr.Dataset(variables)


def lines_of(*columns):
    """Heading and rows of a table."""
    text = to_latex(dataset_of(*columns), "row")
    _, heading, rows = re.split(r"\\toprule\n|\\midrule\n", text)
    return [line.removesuffix(r" \\") for line in (heading + rows).splitlines()[:-2]]


def number_in(value, error):
    """A value with its bar, as a cell of a table has it."""
    return lines_of(("x", [value], None if error is None else [error]))[1]


def read(text):
    """Value and bar that a text stands for, and its last digit."""
    whole, decimals, bar, power = NUMBER.fullmatch(text).groups(default="")
    last = Decimal(1).scaleb(int(power or 0) - len(decimals))
    value = Decimal(f"{whole}.{decimals or 0}").scaleb(int(power or 0))
    return value, int(bar or 0) * last, last


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.44103217, 1.24e-5, "0.441032(12)"),
        (-1.5, 0.25, "-1.50(25)"),
        (1e6, 2.04e4, "1.000(20)e6"),
        (123456.0, 7.0, "1.234560(70)e5"),
        (0.0, 4.2e-6, "0.0(42)e-6"),
        (3.0, 99.6, "0.0(10)e2"),
        (-1e-12, 3.3e-10, "0.0(33)e-10"),
        (0.5, 0.0, "0.5"),
        (0.5, math.nan, "0.5"),
        (0.5, None, "0.5"),
        (1.0e-7, None, "1e-7"),
        (0.5, math.inf, r"{$0.5 \pm \infty$}"),
        (math.nan, 0.1, "{--}"),
    ],
)
def test_a_value_and_its_bar(value, error, text):
    assert number_in(value, error) == text


@hypothesis.settings(deadline=None)
@hypothesis.given(SIZES, SIZES, st.sampled_from([1.0, -1.0]))
def test_a_bar_has_two_digits_and_nothing_is_lost(size, error, sign):
    value, bar, last = read(number_in(sign * size, error))
    assert abs(value - Decimal(sign * size)) <= last / 2
    assert abs(bar - Decimal(error)) <= last / 2
    assert 10 <= bar / last <= 100


@pytest.mark.parametrize(
    ("unit", "text"),
    [
        ("", ""),
        ("1", ""),
        ("m/s", r"\unit{m/s}"),
        ("N s/m^2", r"\unit{N.s/m^2}"),
        ("N/m^n", r"\unit{N/m^n}"),
        ("1/s", r"\unit{1/s}"),
        ("N m/rad^1.5", r"\unit{N.m/rad^1.5}"),
        ("s per unit of the parameter", "s per unit of the parameter"),
    ],
)
def test_units(unit, text):
    (heading, _) = lines_of(("x", [1.0], None, unit))
    assert heading == (f"{{x ({text})}}" if text else "{x}")


def test_text_is_escaped_and_mathematics_is_not():
    assert lines_of((r"mu_k & 5 % $K_1$", [1.0]))[0] == r"{mu\_k \& 5 \% $K_1$}"


def test_columns_have_room_for_their_numbers():
    columns = [
        ("leg", ["1", "2"]),
        ("a_b", [0.1, -20.25], [1e-3, 0.5], "m"),
        ("plain", [1.0, math.nan]),
    ]
    mixed = to_latex(dataset_of(("mixed", [1.0, 22.5, -0.125])), "row")
    assert r"\begin{tabular}{S[table-format=-2.3]}" in mixed
    assert lines_of(*columns)[0] == r"{leg} & {a\_b (\unit{m})} & {plain}"
    headings = {"leg": "leg", "a_b": r"a\_b", "plain": "$x$"}
    text = to_latex(dataset_of(*columns), "row", columns=headings)
    assert (
        text.replace(", table-align-uncertainty=false", "")
        == r"""% needs \usepackage{booktabs} and \usepackage{siunitx}
\begin{tabular}{l S[table-format=-2.4(2), separate-uncertainty] S[table-format=1]}
\toprule
{leg} & {a\_b (\unit{m})} & {$x$} \\
\midrule
1 & 0.1000(10) & 1 \\
2 & -20.25(50) & {--} \\
\bottomrule
\end{tabular}
"""
    )


def test_one_row_is_set_upright():
    dataset = dataset_of(("ending", "found"), ("period", 0.44, 0.01, "s"), dims=())
    lines = to_latex(dataset, "").splitlines()
    look = "table-format=1.3(2), separate-uncertainty, table-align-uncertainty=false"
    assert lines[1] == rf"\begin{{tabular}}{{l S[{look}] l}}"
    assert lines[5:7] == [r"ending & {found} &  \\", r"period & 0.440(10) & \unit{s} \\"]
