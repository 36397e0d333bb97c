"""Store of a sweep's results: what a sweep asks of it, on a disk or in memory."""

import abc
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from jaxbiped.sweep._array_layout import Layout

if TYPE_CHECKING:
    import xarray


COMPLETE = 1
"""Mark of a chunk that was labelled."""
ALL_GAITS = 2
"""Mark of a chunk that was gone over again after gaits were found late. Each round of finer
tolerances after that counts one more."""


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
    def behind(self, mark: int) -> np.ndarray:
        """Numbers of the chunks whose mark is below this one."""

    @abc.abstractmethod
    def write(self, chunk: int, fields: Mapping[str, np.ndarray], *, mark: int = COMPLETE) -> None:
        """Writes a chunk, then marks how far it is.

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
