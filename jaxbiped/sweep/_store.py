"""Store of a sweep's results: what a sweep asks of it, on a disk or in memory."""

import abc
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from jaxbiped.sweep._array_layout import Layout

if TYPE_CHECKING:
    import xarray


class AbstractStore(abc.ABC):
    """Fields of all starts, written and read a chunk at a time, and attributes of the whole.

    Attributes:
        layout: of the results.
    """

    layout: Layout

    @abc.abstractmethod
    def missing(self) -> np.ndarray:
        """Numbers of the chunks that are not complete."""

    @abc.abstractmethod
    def unsettled(self) -> np.ndarray:
        """Numbers of the chunks that were not written with all gaits known."""

    @abc.abstractmethod
    def write(self, chunk: int, fields: Mapping[str, np.ndarray], *, settled: bool = False) -> None:
        """Writes a chunk, then marks it as complete; `settled` where all gaits are known by now.

        Raises:
            ResourceError: it cannot be written; what was written before stays.
        """

    @abc.abstractmethod
    def read(self, chunk: int, names: tuple[str, ...]) -> dict[str, np.ndarray]:
        """These fields of one chunk, flat arrays of one's own."""

    @abc.abstractmethod
    def note(self, attributes: Mapping[str, str | float]) -> None:
        """Sets attributes.

        Raises:
            ResourceError: they cannot be written.
        """

    @abc.abstractmethod
    def noted(self, name: str) -> str | None:
        """An attribute that is a text, None where it is not there."""

    @abc.abstractmethod
    def dataset(self) -> "xarray.Dataset":
        """The results; those on a disk are opened lazily."""
