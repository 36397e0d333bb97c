"""Tightening of labels: all starts again at finer tolerances, while too many are likely wrong."""

import dataclasses
import json
from concurrent.futures import Executor

import numpy as np

from jaxbiped.basins._label_errors import LabelErrors, Seen, estimate_label_errors
from jaxbiped.basins._labels import Doubt, Witness
from jaxbiped.sweep._array_layout import DOUBT_FIELDS, Layout
from jaxbiped.sweep._effort import FINEST_FIRST
from jaxbiped.sweep._labelling import Labelling
from jaxbiped.sweep._store import ALL_GAITS, AbstractStore
from jaxbiped.sweep._workers import compute_chunks

_TOLERANCES = "label_tolerances"
"""Attribute that holds, as JSON, the tolerances of all rounds so far, this one included."""
_FINER = 10.0
_ROUNDS = 3


def tightened(
    labelling: Labelling,
    layout: Layout,
    results: AbstractStore,
    executor: Executor | None,
    workers: int,
) -> LabelErrors:
    """Labels all starts at finer tolerances until their errors are certainly what is wanted.

    Where the starts are too few to tell, it is enough that they are estimated to be.

    Each round is noted before it begins: a run that is killed goes on with it. Estimates count all
    starts, so that no label depends on the chunks.
    """
    wanted, compliant = labelling.effort.wanted, labelling.scene.compliant
    assert wanted is not None
    tolerances = json.loads(results.noted(_TOLERANCES) or json.dumps([labelling.effort.rtol]))
    while True:
        more = len(tolerances) - 1
        if more:
            finer = _at_tolerance(labelling, tolerances[-1])
            left = results.behind(ALL_GAITS + more)
            for chunk, fields in compute_chunks(finer, layout, left, executor, workers):
                results.write(chunk, fields, mark=ALL_GAITS + more)
        errors = estimate_label_errors(seen(layout, results), wanted=wanted, rtol=tolerances[-1])
        finest = tolerances[-1] <= 1.001 * FINEST_FIRST[compliant]
        too_few = errors.wrong <= wanted and errors.starts < errors.fewest
        if errors.met or too_few or finest or len(tolerances) >= _ROUNDS:
            return errors
        tolerances.append(max(tolerances[-1] / _FINER, FINEST_FIRST[compliant]))
        results.note({_TOLERANCES: json.dumps(tolerances)})


def seen(layout: Layout, results: AbstractStore) -> Seen:
    """What the witnesses saw of all starts, a chunk at a time."""
    total = Seen()
    for chunk in range(layout.chunks):
        fields = results.read(chunk, tuple(DOUBT_FIELDS))
        total += seen_of(fields["doubt"], fields["disagreed"], fields["changed"])
    return total


def seen_of(doubt: np.ndarray, disagreed: np.ndarray, changed: np.ndarray) -> Seen:
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


def _at_tolerance(labelling: Labelling, rtol: float) -> Labelling:
    return dataclasses.replace(labelling, effort=labelling.effort.at_tolerance(rtol))
