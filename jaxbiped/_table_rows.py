"""Rows of a dataset: its variables along some dimensions as a data frame, CSV or LaTeX.

The one way from any dataset with units to a table: of results, trajectories and sweeps.
"""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._files import check_writable_file
from jaxbiped._latex import latex_table

if TYPE_CHECKING:
    import pandas
    import xarray

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
    bars = {each.attrs.get("ancillary_variables") for each in dataset.data_vars.values()}
    found: list[Column] = []
    for name in (*dataset.coords, *dataset.data_vars):
        own = dataset[name]
        more = [each for each in own.dims if each not in dims]
        labelled = any(each in dataset.coords for each in more)
        # Along several dimensions a coordinate has but one of them.
        partial = name in dataset.coords and set(own.dims) < set(dims) and own.dims
        whole = set(dims) <= set(own.dims) and len(more) <= 1 and not labelled
        if name in bars or not (partial or whole):
            continue
        error = own.attrs.get("ancillary_variables")
        values = _rows(dataset, str(name), dims, more)
        errors = None if error is None else _rows(dataset, error, dims, more)
        for k in range(values.shape[1]):
            number = f"_{k + 1}" if more else ""
            words = str(own.attrs.get("long_name", str(name).replace("_", " ")))
            found.append(
                Column(
                    name=f"{name}{number}",
                    words=f"{words} {k + 1}" if more else words,
                    unit=str(own.attrs.get("units", "")),
                    values=values[:, k],
                    errors=None if errors is None else errors[:, k],
                    error_name=f"{error}{number}",
                )
            )
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
    words = [[known.get(code, "") for code in row] for row in table.tolist()]
    return np.array(words, object).reshape(shape)


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
    writer.writerows(
        zip(*(map(_known, values.tolist()) for _, values in flat.values()), strict=True)
    )
    return _written(text.getvalue(), path)


def _known(value: Any) -> Any:
    """Nothing for a number that is not known."""
    return "" if isinstance(value, float) and math.isnan(value) else value


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
