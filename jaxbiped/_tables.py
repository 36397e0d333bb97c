"""Tables: a result as a labelled dataset, and rows of any dataset as a data frame, CSV or LaTeX.

Variables carry words, SI unit and, by CF's `ancillary_variables`, the name of their error bars.

In LaTeX, values have their error bars in the notation of siunitx: a bar has two digits, and its
value as many decimals. 0.441032 ± 0.000012 is 0.441032(12), which the versions 2 and 3 of siunitx
read and set as value ± bar.
"""

import abc
import csv
import io
import math
import re
from collections.abc import Mapping, Sequence
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._files import check_writable_file
from jaxbiped._quantity import Quantity

if TYPE_CHECKING:
    import pandas
    import xarray

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


Along: TypeAlias = str | Sequence[str] | None
"""A dimension whose places are rows, several, or none for one row."""


class Column(NamedTuple):
    """A column of n rows: its name, words and unit, values (n,), and error bars (n,) or None.

    `error_name` is that of a column of the error bars alone.
    """

    name: str
    words: str
    unit: str
    values: np.ndarray
    errors: np.ndarray | None
    error_name: str


def columns_of(dataset: "xarray.Dataset", along: Along) -> list[Column]:
    """Variables along some dimensions, coordinates first.

    Those with one more dimension, whose places have no labels, have a column for each place.
    """
    dims = (along,) if isinstance(along, str) and along else tuple(along or ())
    for each in dims:
        check_choice("along", each, tuple(map(str, dataset.dims)))
    are_bars = {each.attrs.get("ancillary_variables") for each in dataset.data_vars.values()}
    found: list[Column] = []
    for name in (*dataset.coords, *dataset.data_vars):
        own = dataset[name]
        more = [each for each in own.dims if each not in dims]
        labelled = any(each in dataset.coords for each in more)
        # Along several dimensions a coordinate has but one of them.
        partial = name in dataset.coords and set(own.dims) < set(dims) and own.dims
        whole = set(dims) <= set(own.dims) and len(more) <= 1 and not labelled
        if name in are_bars or not (partial or whole):
            continue
        error = own.attrs.get("ancillary_variables")
        values = _rows(dataset, str(name), dims, more)
        errors = None if error is None else _rows(dataset, error, dims, more)
        words = str(own.attrs.get("long_name", str(name).replace("_", " ")))
        for k in range(values.shape[1]):
            number, place = (f"_{k + 1}", f" {k + 1}") if more else ("", "")
            told = f"{name}{number}", f"{words}{place}", str(own.attrs.get("units", ""))
            bars = None if errors is None else errors[:, k]
            found.append(Column(*told, values[:, k], bars, f"{error}{number}"))
    return found


def _rows(
    dataset: "xarray.Dataset", name: str, dims: tuple[str, ...], more: Sequence[Any]
) -> np.ndarray:
    """Of a variable, shape (n, places of one more dimension); codes in words."""
    own = dataset[name]
    missing = {each: dataset.sizes[each] for each in dims if each not in own.dims}
    shape = [math.prod(dataset.sizes[each] for each in group) for group in (dims, more)]
    table = own.expand_dims(missing).transpose(*dims, *more).values.reshape(shape)
    meanings = str(own.attrs.get("flag_meanings", "")).split()
    if not meanings or "flag_values" not in own.attrs:
        return np.asarray(table)
    codes = np.atleast_1d(own.attrs["flag_values"]).tolist()
    known = dict(zip(codes, (each.replace("_", " ") for each in meanings), strict=True))
    return np.vectorize(lambda code: known.get(code, ""), otypes=[object])(table)


def to_dataframe(dataset: "xarray.Dataset", along: Along) -> "pandas.DataFrame":
    """Rows of a dataset as a data frame (see `Tabular.to_dataframe`).

    Args:
        dataset: one of jaxbiped's, as of a trajectory or a sweep, or any other with units.
        along: the dimension whose places are the rows; several for all their combinations; "" for
            a single row of what has no dimension.

    Returns:
        The data frame.

    Raises:
        ArgumentError: a dimension that the dataset does not have.
    """
    import pandas

    flat = _flat(columns_of(dataset, along))
    frame = pandas.DataFrame({name: values for name, (_, values) in flat.items()})
    frame.attrs["units"] = {name: unit for name, (unit, values) in flat.items() if unit is not None}
    return frame


def _flat(columns: Sequence[Column]) -> dict[str, tuple[str | None, np.ndarray]]:
    """Unit and values by name, error bars behind what they belong to; no unit for words."""
    found: dict[str, tuple[str | None, np.ndarray]] = {}
    for each in columns:
        is_number = each.values.dtype.kind in "fiu"
        found[each.name] = (each.unit if is_number else None, each.values)
        if each.errors is not None:
            found[each.error_name] = (each.unit, each.errors)
    return found


def to_csv(dataset: "xarray.Dataset", along: Along, path: str | Path | None = None) -> str:
    """Rows of a dataset as comma-separated values (see `Tabular.to_csv`).

    Args:
        dataset, along: as for `to_dataframe`.
        path: file to write; none if omitted.

    Returns:
        The text; cells of numbers that are not known are empty.

    Raises:
        ArgumentError: a file that cannot be written, or a dimension that the dataset does not have.
    """
    flat = _flat(columns_of(dataset, along))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(n if unit is None else f"{n} [{unit or 1}]" for n, (unit, _) in flat.items())
    cells = (
        ["" if isinstance(x, float) and math.isnan(x) else x for x in values.tolist()]
        for _, values in flat.values()
    )
    writer.writerows(zip(*cells, strict=True))
    return _written(text.getvalue(), path)


def to_latex(
    dataset: "xarray.Dataset",
    along: Along,
    path: str | Path | None = None,
    *,
    columns: Sequence[str] | Mapping[str, str] | None = None,
) -> str:
    """Rows of a dataset as a LaTeX `tabular` with siunitx's columns (see `Tabular.to_latex`).

    Args:
        dataset, along: as for `to_dataframe`.
        path: file to write; none if omitted.
        columns: names of the variables to show, in order, or their headings (LaTeX) by name; all
            if omitted.

    Returns:
        The text.

    Raises:
        ArgumentError: a file that cannot be written, or a dimension or a column that the dataset
            does not have.
    """
    known = {each.name: each for each in columns_of(dataset, along)}
    if isinstance(columns, str):
        raise ArgumentError(f"columns = {columns!r} is not allowed: give a list of names.")
    for name in columns or ():
        check_choice("columns", name, tuple(known))
    chosen = known if columns is None else {name: known[name] for name in columns}
    headings = columns if isinstance(columns, Mapping) else {}
    return _written(latex_table(list(chosen.values()), headings, upright=not along), path)


def _written(text: str, path: str | Path | None) -> str:
    if path is not None:
        check_writable_file("path", path).write_text(text, encoding="utf-8")
    return text


class Tabular(abc.ABC):
    """A result that is also a table: as a dataset, a data frame, CSV or LaTeX.

    Attributes:
        rows: the dimension of the dataset along which a table has its rows by default;
            empty for a single row. A property of the class.
    """

    rows: ClassVar[str] = ""

    @abc.abstractmethod
    def to_dataset(self) -> "xarray.Dataset":
        """The result as a labelled dataset, in SI units, for `to_netcdf` or `to_zarr`."""

    def to_dataframe(self, along: str | None = None) -> "pandas.DataFrame":
        """The rows as a data frame.

        Args:
            along: dimension of `to_dataset()` whose places are the rows; the result's own (`rows`)
                if omitted.

        Returns:
            A column for each variable, and `NAME_error` behind one with error bars; the SI units by
            column in `attrs["units"]`.

        Raises:
            ArgumentError: a dimension that the dataset does not have.
        """
        return to_dataframe(self.to_dataset(), self.rows if along is None else along)

    def to_csv(self, path: str | Path | None = None, along: str | None = None) -> str:
        """The rows as comma-separated values, under headers with units, such as "period [s]".

        Args:
            path: file to write; none if omitted.
            along: as for `to_dataframe`.

        Returns:
            The text. Its numbers have all their digits.

        Raises:
            ArgumentError: a file that cannot be written, or a dimension that the dataset does not
                have.
        """
        return to_csv(self.to_dataset(), self.rows if along is None else along, path)

    def to_latex(
        self,
        path: str | Path | None = None,
        along: str | None = None,
        columns: Sequence[str] | Mapping[str, str] | None = None,
    ) -> str:
        r"""The rows as a LaTeX `tabular` for the packages booktabs and siunitx.

        Numbers stand in siunitx's `S` columns: value ± error bar, the bar with two digits; a number
        without a bar with six. A single row is set upright: a line for each quantity.

        Args:
            path: file to write; none if omitted.
            along: as for `to_dataframe`.
            columns: names of the variables to show, in order, or their headings (LaTeX) by name;
                all if omitted.

        Returns:
            The text.

        Raises:
            ArgumentError: a file that cannot be written, or a dimension or a column that the
                dataset does not have.
        """
        dataset = self.to_dataset()
        return to_latex(dataset, self.rows if along is None else along, path, columns=columns)


class Entry(NamedTuple):
    """A variable of a dataset before it is one.

    Attributes:
        dims: its dimensions.
        values: of their shape.
        quantity: words and SI unit.
        errors: error bars of the same shape, or the name of the entry that has them; None for none.
        flags: what its whole numbers mean, in words.
    """

    dims: tuple[str, ...]
    values: npt.ArrayLike
    quantity: Quantity = Quantity("")
    errors: npt.ArrayLike | str | None = None
    flags: Mapping[int, str] | None = None


def variables_of(entries: Mapping[str, Entry]) -> dict[str, Any]:
    """Variables for `xarray.Dataset`, the error bars of NAME as NAME_error."""
    variables: dict[str, Any] = {}
    for name, entry in entries.items():
        attributes: dict[str, Any] = {}
        if entry.quantity.words:
            attributes["long_name"] = entry.quantity.words
        if entry.flags is not None:
            attributes["flag_values"] = list(entry.flags)
            words = (each.replace(" ", "_") for each in entry.flags.values())
            attributes["flag_meanings"] = " ".join(words)
        elif np.asarray(entry.values).dtype.kind in "bfiu":
            attributes["units"] = entry.quantity.unit
        if isinstance(entry.errors, str):
            attributes["ancillary_variables"] = entry.errors
        elif entry.errors is not None:
            bars = attributes["ancillary_variables"] = f"{name}_error"
            own = entry.quantity._replace(words=f"error of {entry.quantity.words or name}")
            variables[bars] = (entry.dims, np.asarray(entry.errors, float), own.attributes)
        variables[name] = (entry.dims, np.asarray(entry.values), attributes)
    return variables
