"""Memory store: results of a sweep without a disk."""

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxbiped.sweep._array_layout import Layout, empty_dataset
from jaxbiped.sweep._same_store import SETTINGS

if TYPE_CHECKING:
    import xarray


class Memory:
    """Arrays for all results; see `Store`."""

    def __init__(self, layout: Layout, settings: dict[str, Any], attributes: dict[str, Any]):
        self.layout = layout
        self._dataset = empty_dataset(layout)
        self._dataset.attrs = attributes | {SETTINGS: json.dumps(settings)}
        for name in self._dataset.data_vars:
            self._dataset[name].data = np.array(self._dataset[name].data)

    def missing(self) -> np.ndarray:
        return np.arange(self.layout.chunks)

    def unsettled(self) -> np.ndarray:
        return self.missing()

    def write(self, chunk: int, fields: dict[str, np.ndarray], *, settled: bool = False) -> None:
        region, shape = self.layout.region(chunk), self.layout.shape_of(chunk)
        for name, values in fields.items():
            self._dataset[name].data[region] = np.reshape(values, shape)

    def read(self, chunk: int, names: tuple[str, ...]) -> dict[str, np.ndarray]:
        region = self.layout.region(chunk)
        return {name: self._dataset[name].data[region].flatten() for name in names}

    def note(self, attributes: dict[str, Any]) -> None:
        self._dataset.attrs.update(attributes)

    def noted(self, name: str) -> Any:
        return self._dataset.attrs.get(name)

    def dataset(self) -> "xarray.Dataset":
        return self._dataset
