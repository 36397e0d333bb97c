"""Store of a sweep's results: what a sweep asks of it, and one in memory."""

import abc
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from jaxbiped._files import strict_json
from jaxbiped._types import JsonObject
from jaxbiped.sweep._store_files import SETTINGS
from jaxbiped.sweep._stored_fields import Layout, empty_dataset

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


class MemoryStore(AbstractStore):
    """Arrays for all results; without a disk none is ever complete beforehand."""

    def __init__(self, layout: Layout, settings: JsonObject, attributes: Mapping[str, str]):
        self.layout = layout
        self._dataset = empty_dataset(layout)
        self._dataset.attrs = dict(attributes) | {SETTINGS: strict_json(settings)}
        for name in self._dataset.data_vars:
            self._dataset[name].data = np.array(self._dataset[name].data)

    def missing(self) -> np.ndarray:
        return np.arange(self.layout.chunks)

    def behind(self, mark: int) -> np.ndarray:
        return self.missing()

    def write(self, chunk: int, fields: Mapping[str, np.ndarray], *, mark: int = COMPLETE) -> None:
        region, shape = self.layout.region(chunk), self.layout.shape_of(chunk)
        for name, values in fields.items():
            self._dataset[name].data[region] = np.reshape(values, shape)

    def read(self, chunk: int, names: tuple[str, ...]) -> dict[str, np.ndarray]:
        region = self.layout.region(chunk)
        return {name: self._dataset[name].data[region].flatten() for name in names}

    def note(self, attributes: Mapping[str, str | float]) -> None:
        self._dataset.attrs.update(attributes)

    def noted(self, name: str) -> str | None:
        text = self._dataset.attrs.get(name)
        return None if text is None else str(text)

    def dataset(self) -> "xarray.Dataset":
        return self._dataset
