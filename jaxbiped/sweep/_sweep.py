"""Sweeps: starts labelled chunk by chunk, here or by workers, in memory or into a store."""

import dataclasses
import json
import time
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jaxbiped._checks import ArgumentError, check_count, check_function, check_type
from jaxbiped._files import JsonObject
from jaxbiped._identity import provenance
from jaxbiped._progress import stage
from jaxbiped.basins._labels import (
    ERRORS,
    Doubt,
    Label,
    LabelErrors,
    Seen,
    Witness,
    estimate_label_errors,
)
from jaxbiped.sweep._gait_family import Guesses
from jaxbiped.sweep._labelling import Labelling
from jaxbiped.sweep._labelling_preparation import (
    FINEST_FIRST,
    guesses_among,
    with_gaits_met,
    with_guesses,
)
from jaxbiped.sweep._store import ALL_GAITS, DOUBT_FIELDS, Layout, Store, fields_of
from jaxbiped.sweep._store_files import (
    GAITS,
    check_continued,
    is_new,
    store_path,
    what_is_kept,
    writing,
)
from jaxbiped.sweep._workers import compute_chunks
from jaxbiped.sweep.starts._coordinates import coordinate_quantities, state_coordinates
from jaxbiped.sweep.starts._starts import AbstractStarts

if TYPE_CHECKING:
    import xarray

CHUNK = 16384
_MOST_OPEN = 4096
"""Unresolved starts from which gaits are sought after a sweep."""
_GUESSES = "gait_guesses"
"""Attribute that holds, as JSON, where gaits were sought after a sweep."""
_TOLERANCES = "label_tolerances"
"""Attribute that holds, as JSON, the tolerances of all rounds so far, this one included."""
_FINER = 10.0
_ROUNDS = 3


def sweep(
    labelling: Labelling,
    starts: AbstractStarts,
    *,
    store: str | Path | None = None,
    chunk: int = CHUNK,
    executor: Executor | None = None,
    workers: int = 1,
    look_for_gaits: bool = True,
    progress: bool | None = None,
    any_version: bool = False,
) -> "xarray.Dataset":
    """Labels all starts.

    Gaits to which some of the starts converge are searched first, so every start is compared with
    the same gaits. After the sweep, starts that are still unresolved but repeat a cycle are used to
    search for further gaits. No label depends on the chunks or on their order. With a store, only
    the chunks in progress are in memory, and an interrupted run continues from the store.

    Args:
        labelling: how to label starts, see `labelling`.
        starts: a `grid`, a `sample`, or `GivenStarts`.
        store: directory of a Zarr store, for `xarray.open_zarr`, or an address such as
            "s3://bucket/basin.zarr" (with `jaxbiped[s3]`). Default: in memory.
        chunk: maximum number of starts that are labelled and written at once.
        executor: executor of the chunks, of the kind of `concurrent.futures`, such as
            `distributed.Client(...).get_executor()`. Default: this process.
        workers: number of chunks that the executor runs at once.
        look_for_gaits: whether to search for gaits other than those of the labelling.
        progress: whether to show on stderr what is being done, how far it is and what was found; by
            default (None) after two seconds, in a terminal, a notebook or a command.
        any_version: whether to continue a store that another version or revision of jaxbiped
            wrote, or one made with laws of yours whose code has changed since.

    Returns:
        A dataset with the fields of `Labelled` along the axes of the starts. Its attributes have
        the scene, tolerances, gaits, versions and revision. If the accuracy was a number, the
        dataset also records which labels were, or remain, in doubt (`doubt`, codes of
        `jb.basins.Doubt`); `jb.basins.label_errors` reports how many starts were labelled again and
        the estimated fraction of the others that is wrong. A `RuntimeWarning` is issued if that
        exceeds the number.

    Raises:
        ArgumentError: an argument is not allowed; or the store has other settings or another
            version, or cannot be written.
        ResourceError: the disk is full, or workers were lost. The contents of the store are kept.
    """
    check_type("labelling", labelling, Labelling)
    check_type("starts", starts, AbstractStarts)
    check_count("chunk", chunk)
    check_count("workers", workers)
    if executor is not None:
        check_function("executor.submit", getattr(executor, "submit", None))
    if not starts.size:
        raise ArgumentError("starts is empty: give at least one.")
    path = store_path(store)
    began = time.perf_counter()
    quantities = coordinate_quantities(labelling.scene)
    doubts = labelling.effort.wanted is not None
    endings = labelling.scene.endings
    layout = Layout.of(starts, int(chunk), quantities, doubts=doubts, endings=endings)
    own = {
        "fields": list(layout.fields),
        "starts": starts.described(),
        "chunk_shape": list(layout.chunk_shape),
    }
    writer = provenance(labelling.scene, labelling.effort.solver, starts)
    if path is not None and not is_new(path):
        # Before gaits are sought: they may be missing from these settings.
        early = labelling.settings() | own
        with writing(path):
            check_continued(path, early, writer, any_version=any_version, but=GAITS)
    kept = what_is_kept(path)
    with stage("seeking the gaits that starts converge to", show=progress, kept=kept):
        known = with_gaits_met(labelling, starts) if look_for_gaits else labelling
    settings = known.settings() | own
    results = Store.of(path, layout, settings, writer, any_version=any_version)
    missing = results.behind()
    sizes = layout.sizes
    fresh = int(sizes[missing].sum())
    done = starts.size - fresh
    with stage(
        "labelling", total=starts.size, unit="starts", done=done, show=progress, kept=kept
    ) as now:
        for number, fields in compute_chunks(known, layout, missing, executor, int(workers)):
            results.write(number, fields)
            now.update(int(sizes[number]))
    if look_for_gaits:
        with stage("seeking gaits from unresolved starts", show=progress, kept=kept):
            known = _resolve(known, results)
    told: dict[str, str | float] = {}
    if doubts:
        with stage("labelling at finer tolerances", show=progress, kept=kept):
            errors = tightened(known, results, executor, int(workers))
        errors.warn()
        told[ERRORS] = json.dumps(errors.numbers())
    results.note(
        told
        | {
            GAITS: json.dumps(_gaits_by_coordinate(known)),
            "labelled_in_this_run": fresh,
            "chunks_found_complete": layout.chunks - len(missing),
            "wall_s": time.perf_counter() - began,
        }
    )
    return results.dataset()


def _gaits_by_coordinate(known: Labelling) -> list[JsonObject]:
    """Each row's parameters and gaits, and where these are in the coordinates of starts."""
    leaves, rows = state_coordinates(known.scene), known.family.described()
    for row, gaits in zip(rows, known.family.rows, strict=True):
        for told, gait in zip(row["gaits"], gaits, strict=True):
            values = {name: float(getattr(gait.state, leaf)) for name, leaf in leaves.items()}
            told["coordinates"] = values
    return rows


def _resolve(labelling: Labelling, results: Store) -> Labelling:
    """Seeks gaits from starts that are unresolved but repeat a cycle; labels the unresolved anew.

    Where they were sought is noted first: a run that is killed here finds the same ones again,
    whatever is labelled anew by then.
    """
    layout, noted = results.layout, results.noted(_GUESSES)
    if noted is None:
        guesses = _guesses(labelling, results)
        results.note({_GUESSES: json.dumps(guesses)})
    else:
        guesses = {int(row): each for row, each in json.loads(noted).items()}
    known = with_guesses(labelling, guesses)
    if [len(row) for row in known.family.rows] == [len(row) for row in labelling.family.rows]:
        return labelling
    moved = labelling.family.places_in(known.family)
    for chunk in map(int, results.behind(ALL_GAITS)):
        own = (f"start_{name}" for name in layout.starts.own_columns)
        fields = results.read(chunk, (*layout.fields, *own))
        places = np.flatnonzero(fields["label"] == int(Label.UNRESOLVED))
        met = fields["gait"] >= 0
        fields["gait"][met] = moved[fields["gait"][met]]
        if len(places):
            batch = layout.starts.at(known, layout.numbers(chunk)[0] + places)
            found = known(batch.states, parameters=batch.parameters)
            for name, values in fields_of(layout.starts, found, batch).items():
                fields[name][places] = values
        if len(places) or met.any():
            results.write(chunk, fields, mark=ALL_GAITS)
    return known


def _guesses(labelling: Labelling, results: Store) -> Guesses:
    """From some of the starts that are open, evenly spread over all of them."""
    layout = results.layout
    counts = np.array([len(_open(results, chunk)) for chunk in range(layout.chunks)])
    before = np.cumsum(counts) - counts
    total = int(counts.sum())
    if not total:
        return {}
    chosen = np.unique(np.linspace(0, total - 1, min(total, _MOST_OPEN)).astype(int))
    numbers = []
    for chunk in range(layout.chunks):
        own = chosen[(chosen >= before[chunk]) & (chosen < before[chunk] + counts[chunk])]
        if len(own):
            numbers.append(layout.numbers(chunk)[0] + _open(results, chunk)[own - before[chunk]])
    return guesses_among(labelling, layout.starts, np.concatenate(numbers))


def _open(results: Store, chunk: int) -> np.ndarray:
    """Places of a chunk's starts that are unresolved but repeat a cycle."""
    fields = results.read(chunk, ("label", "cycle_footsteps"))
    unresolved = fields["label"] == int(Label.UNRESOLVED)
    return np.asarray(np.flatnonzero(unresolved & (fields["cycle_footsteps"] > 0)))


def tightened(
    labelling: Labelling, results: Store, executor: Executor | None, workers: int
) -> LabelErrors:
    """Labels all starts at finer tolerances until their errors are certainly what is wanted.

    Where the starts are too few to tell, it is enough that they are estimated to be.

    Each round is noted before it begins: a run that is killed goes on with it. Estimates count all
    starts, so that no label depends on the chunks.
    """
    layout, wanted = results.layout, labelling.effort.wanted
    least = FINEST_FIRST[labelling.scene.stiff]
    assert wanted is not None
    tolerances = json.loads(results.noted(_TOLERANCES) or json.dumps([labelling.effort.rtol]))
    while True:
        more = len(tolerances) - 1
        if more:
            effort = labelling.effort._replace(rtol=tolerances[-1])
            finer = dataclasses.replace(labelling, effort=effort)
            left = results.behind(ALL_GAITS + more)
            for chunk, fields in compute_chunks(finer, layout, left, executor, workers):
                results.write(chunk, fields, mark=ALL_GAITS + more)
        seen = Seen()
        for chunk in range(layout.chunks):
            seen += tally_disagreements(**results.read(chunk, tuple(DOUBT_FIELDS)))
        errors = estimate_label_errors(seen, wanted=wanted, rtol=tolerances[-1])
        finest = tolerances[-1] <= 1.001 * least
        too_few = errors.wrong <= wanted and errors.starts < errors.fewest
        if errors.met or too_few or finest or len(tolerances) >= _ROUNDS:
            return errors
        tolerances.append(max(tolerances[-1] / _FINER, least))
        results.note({_TOLERANCES: json.dumps(tolerances)})


def tally_disagreements(doubt: np.ndarray, disagreed: np.ndarray, changed: np.ndarray) -> Seen:
    """What the witnesses saw of some starts, from their `Labelled` fields."""
    moved = (changed > 0) & (doubt == int(Doubt.SETTLED))
    looser, other = (moved & (disagreed & int(who) > 0) for who in Witness)
    parts = (
        doubt != int(Doubt.NONE),
        changed > 0,
        doubt == int(Doubt.REMAINS),
        looser,
        other,
        looser & other,
    )
    return Seen(doubt.size, *[int(part.sum()) for part in parts])
