"""Memory store: results of a sweep without a disk."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from jaxbiped._files import strict_json
from jaxbiped._types import JsonObject
from jaxbiped.sweep._array_layout import Layout, empty_dataset
from jaxbiped.sweep._same_store import SETTINGS
from jaxbiped.sweep._store import COMPLETE, AbstractStore

if TYPE_CHECKING:
    import xarray


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
