"""Tables: a result as a labelled dataset, whose rows are a data frame, CSV or LaTeX.

Variables carry words, SI unit and, by CF's `ancillary_variables`, the name of their error bars.
"""

import abc
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from jaxbiped._quantity import Quantity
from jaxbiped._table_rows import to_csv, to_dataframe, to_latex

if TYPE_CHECKING:
    import pandas
    import xarray


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
        if entry.errors is not None:
            bars = entry.errors if isinstance(entry.errors, str) else f"{name}_error"
            attributes["ancillary_variables"] = bars
        if entry.errors is not None and not isinstance(entry.errors, str):
            own = {"long_name": f"error of {entry.quantity.words or name}"}
            own["units"] = entry.quantity.unit
            variables[bars] = (entry.dims, np.asarray(entry.errors, float), own)
        variables[name] = (entry.dims, np.asarray(entry.values), attributes)
    return variables
