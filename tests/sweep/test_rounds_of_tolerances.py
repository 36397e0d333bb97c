"""Rounds of finer tolerances of a sweep, against doubts that are written down."""

import json

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.basins._labels import Doubt, Seen, Witness
from jaxbiped.sweep import _sweep
from jaxbiped.sweep._store import Layout, Store
from jaxbiped.sweep._sweep import tally_disagreements, tightened
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker
from tests.sweep.walkers import gaitless

SCENE = simplest_walker(0.009)
BOTH = int(Witness.LOOSER | Witness.OTHER)


def test_witnesses_are_counted_where_a_settled_label_changed():
    doubt = np.array([0, 1, 1, 1, 2, 1, 1])
    disagreed = np.array([0, 1, 2, 3, 3, 0, 1])
    changed = np.array([0, 1, 1, 1, 1, 1, 0])
    assert [int(each) for each in Doubt] == [0, 1, 2]
    assert tally_disagreements(doubt, disagreed, changed) == Seen(
        starts=7, relabelled=6, changed=5, in_doubt=1, looser=2, other=2, both=1
    )


@pytest.mark.parametrize(
    ("wrong", "rounds"), [((), 1), ((1e-4,), 2), ((1e-4, 1e-5), 3), ((1e-4, 1e-5, 1e-6), 3)]
)
def test_tolerances_are_tightened_until_the_errors_are_what_was_asked_for(
    wrong, rounds, monkeypatch
):
    """At tolerances that are `wrong` the witnesses see different errors: many are overlooked."""
    labelling = gaitless(SCENE, simplest_state(*STABLE), rtol=None, accuracy=0.03)
    effort = labelling.effort._replace(rtol=1e-4)
    labelling = jb.labels.Labelling(SCENE, labelling.family, effort)
    starts = jb.starts.grid(SCENE, {"theta_stance": np.linspace(0.1, 0.3, 1000)})
    layout = Layout.of(starts, 500, doubts=True)
    results, solved = Store.of(None, layout, {}, {}), []

    def labels(labelling, layout, chunks, executor, workers):
        solved.append(labelling.effort.rtol)
        for chunk in chunks:
            many = any(labelling.effort.rtol == pytest.approx(each) for each in wrong)
            doubt, disagreed = np.zeros(500, int), np.zeros(500, int)
            if many:
                doubt[:60], disagreed[:30], disagreed[30:60] = 1, 1, 2
            yield chunk, {"doubt": doubt, "disagreed": disagreed, "changed": doubt}

    monkeypatch.setattr(_sweep, "compute_chunks", labels)
    for chunk, fields in labels(labelling, layout, range(2), None, 1):
        results.write(chunk, fields)
    told = tightened(labelling, results, None, 1)
    assert solved == pytest.approx([1e-4, 1e-5, 1e-6][:rounds])
    assert told.met is (len(wrong) < 3)
    assert told.rtol == pytest.approx(10.0 ** (-3 - rounds))
    noted = results.noted(_sweep._TOLERANCES)
    assert (noted is None) is (rounds == 1)
    assert noted is None or json.loads(noted) == pytest.approx([1e-4, 1e-5, 1e-6][:rounds])
