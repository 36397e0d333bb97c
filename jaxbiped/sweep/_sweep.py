"""Sweeps: starts labelled chunk by chunk, here or by workers, in memory or into a store."""

import json
import platform
import subprocess
import time
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from tqdm import tqdm

from jaxbiped._checks import ArgumentError, check_positive, check_type
from jaxbiped.sweep._label import Label
from jaxbiped.sweep._labelling import Labelling
from jaxbiped.sweep._layout import Layout, empty_dataset, fields_of
from jaxbiped.sweep._prepare import with_gaits_met, with_gaits_of
from jaxbiped.sweep._starts import AbstractStarts
from jaxbiped.sweep._store import SETTINGS, Store, check_store

CHUNK = 16384
_AHEAD = 2
"""Chunks handed out for each worker, so that none waits for the next."""
_MOST_OPEN = 4096
"""Unresolved starts from which gaits are sought after a sweep."""


def sweep(
    labelling: Labelling,
    starts: AbstractStarts,
    *,
    store: str | Path | None = None,
    chunk: int = CHUNK,
    executor: Executor | None = None,
    workers: int = 1,
    look_for_gaits: bool = True,
    progress: bool = False,
) -> xr.Dataset:
    """Labels all starts.

    Gaits that some of the starts converge to are sought first, so that every start is compared
    with the same ones: no label depends on the chunks or on their order. With a store, memory is
    bounded by the chunks in hand; a run that was killed continues where it was.

    Args:
        labelling: see there.
        starts: a `grid`, a `sample`, or `GivenStarts`.
        store: directory of a Zarr store, for `xarray.open_zarr`; in memory unless given.
        chunk: how many starts are labelled and written at once, about.
        executor: what runs the chunks, any of `concurrent.futures`' kind, such as
            `distributed.Client(...).get_executor()`; this process unless given.
        workers: how many chunks the executor runs at once.
        look_for_gaits: whether to look for gaits besides those of the labelling.
        progress: whether to show a bar on stderr.

    Returns:
        A dataset with the labels and all else of `Labelled`, along the axes of the starts.
        Its attributes say scene, tolerances, gaits, versions and revision.

    Raises:
        ArgumentError: an argument that is not allowed; a store of other settings, or one that
            cannot be written; workers that were lost. What is in the store stays.
    """
    check_type("labelling", labelling, Labelling)
    check_type("starts", starts, AbstractStarts)
    check_positive("chunk", chunk)
    check_positive("workers", workers)
    if not starts.size:
        raise ArgumentError("starts is empty: give at least one.")
    if store is not None:
        check_store(Path(store))
    began = time.perf_counter()
    layout = Layout.of(starts, int(chunk))
    known = with_gaits_met(labelling, starts) if look_for_gaits else labelling
    settings = known.settings() | {"starts": starts.described(), "chunk_rows": layout.rows}
    sink: Any = _Memory(layout, settings)
    if store is not None:
        sink = Store.open(Path(store), layout, settings, _provenance())
    missing = sink.missing()
    done = layout.chunks - len(missing)
    with tqdm(total=starts.size, unit="starts", disable=not progress, smoothing=0.05) as bar:
        bar.update(sum(_size(layout, i) for i in range(layout.chunks) if i not in set(missing)))
        for number, fields in _computed(known, layout, missing, executor, int(workers)):
            sink.write(number, fields)
            bar.update(_size(layout, number))
    if look_for_gaits:
        known = _resolved(known, layout, sink)
    fresh = sum(_size(layout, i) for i in missing)
    sink.note(
        {
            "gaits": json.dumps(known.family.described()),
            "labelled_in_this_run": fresh,
            "chunks_found_complete": done,
            "wall_s": time.perf_counter() - began,
        }
    )
    dataset: xr.Dataset = sink.dataset()
    return dataset


def _size(layout: Layout, chunk: int) -> int:
    first, last = layout.numbers(chunk)
    return last - first


def _computed(
    labelling: Labelling,
    layout: Layout,
    chunks: list[int],
    executor: Executor | None,
    workers: int,
) -> Iterator[tuple[int, dict[str, np.ndarray]]]:
    """Chunks and their fields as they are ready."""
    if executor is None:
        for chunk in chunks:
            yield chunk, label_chunk(labelling, layout, chunk)
        return
    queue = list(reversed(chunks))
    running: dict[Future[Any], int] = {}
    try:
        while queue or running:
            while queue and len(running) < _AHEAD * workers:
                chunk = queue.pop()
                running[executor.submit(label_chunk, labelling, layout, chunk)] = chunk
            ready, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in ready:
                chunk = running.pop(future)
                yield chunk, future.result()
    except BrokenExecutor as error:
        raise ArgumentError(
            f"executor = {type(executor).__name__} lost its workers ({error}): start it anew and "
            "run again; the chunks that are complete stay in the store."
        ) from None
    finally:
        for future in running:
            future.cancel()


def label_chunk(labelling: Labelling, layout: Layout, chunk: int) -> dict[str, np.ndarray]:
    """The fields of one chunk, flat: what a worker computes."""
    batch = layout.starts.batch(labelling, *layout.numbers(chunk))
    return fields_of(layout, labelling(batch.states, parameters=batch.parameters), batch)


def _resolved(labelling: Labelling, layout: Layout, sink: Any) -> Labelling:
    """Seeks gaits from starts that are unresolved but repeat a cycle, and labels those anew."""
    open_ = {
        chunk: np.flatnonzero((f["label"] == int(Label.UNRESOLVED)) & (f["period"] > 0))
        for chunk, f in sink.chunks(("label", "period"))
    }
    open_ = {chunk: places for chunk, places in open_.items() if len(places)}
    before = labelling
    for chunk, places in open_.items():
        batch = _some_of(labelling, layout, chunk, places[:_MOST_OPEN])
        found = labelling(batch.states, parameters=batch.parameters)
        labelling = with_gaits_of(labelling, found, batch.parameters)
    if labelling is before or labelling.family.rows == before.family.rows:
        return before
    for chunk, places in open_.items():
        fields = label_again(labelling, layout, chunk, places, sink)
        sink.write(chunk, fields)
    return labelling


def label_again(
    labelling: Labelling, layout: Layout, chunk: int, places: np.ndarray, sink: Any
) -> dict[str, np.ndarray]:
    """A chunk's fields with some of its starts labelled anew."""
    batch = _some_of(labelling, layout, chunk, places)
    new = fields_of(layout, labelling(batch.states, parameters=batch.parameters), batch)
    fields: dict[str, np.ndarray] = sink.read(chunk, tuple(new))
    for name, values in new.items():
        fields[name][places] = values
    return fields


def _some_of(labelling: Labelling, layout: Layout, chunk: int, places: np.ndarray) -> Any:
    batch = layout.starts.batch(labelling, *layout.numbers(chunk))
    states = type(batch.states)(*[np.asarray(leaf)[places] for leaf in batch.states])
    parts = ({k: v[places] for k, v in part.items()} for part in batch[1:])
    return type(batch)(states, *parts)


class _Memory:
    """What a `Store` is, in memory."""

    def __init__(self, layout: Layout, settings: dict[str, Any]) -> None:
        self.layout = layout
        self._dataset = empty_dataset(layout).copy(deep=True)
        self._dataset.attrs = _provenance() | {SETTINGS: json.dumps(settings)}
        for name in self._dataset.data_vars:
            self._dataset[name].data = np.array(self._dataset[name].data)

    def missing(self) -> list[int]:
        return list(range(self.layout.chunks))

    def write(self, chunk: int, fields: dict[str, np.ndarray]) -> None:
        region, shape = self.layout.region(chunk), self.layout.shape_of(chunk)
        for name, values in fields.items():
            self._dataset[name].data[region] = np.reshape(values, shape)

    def read(self, chunk: int, names: tuple[str, ...]) -> dict[str, np.ndarray]:
        region = self.layout.region(chunk)
        return {name: self._dataset[name].data[region].ravel() for name in names}

    def chunks(self, names: tuple[str, ...]) -> Iterator[tuple[int, dict[str, np.ndarray]]]:
        for chunk in range(self.layout.chunks):
            yield chunk, self.read(chunk, names)

    def note(self, attributes: dict[str, Any]) -> None:
        self._dataset.attrs.update(attributes)

    def dataset(self) -> xr.Dataset:
        return self._dataset


def _provenance() -> dict[str, str]:
    """Versions and revision that made the results."""
    packages = ("jaxbiped", "jax", "diffrax", "numpy", "llvmlite")
    found = {f"version_{name}": version(name) for name in packages}
    return found | {"version_python": platform.python_version(), "git_revision": _revision()}


def _revision() -> str:
    """Of the source that runs, "unknown" where it is not a checkout."""
    here = Path(__file__).parent
    command = ["git", "-C", str(here), "describe", "--always", "--dirty", "--abbrev=40"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
