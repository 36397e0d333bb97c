"""Rounds of finer tolerances of a sweep, against doubts that are written down."""

import json

import equinox as eqx
import jax
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.basins import Doubt, label_errors
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker
from tests.sweep.walkers import ByFormula, as_kind, gaitless

SCENE = simplest_walker(0.009)
LABELLING = gaitless(SCENE, simplest_state(*STABLE), rtol=None, accuracy=0.03)
LABELLING = jb.labels.Labelling(SCENE, LABELLING.family, LABELLING.effort._replace(rtol=1e-4))


class Doubting(ByFormula):
    """Labels that are in doubt as a table says, start by start, at tolerances that are wrong."""

    table: jax.Array
    wrong: tuple = eqx.field(static=True)
    solved: list = eqx.field(static=True)

    def __call__(self, states, *, parameters=None):
        self.solved.append(self.effort.rtol)
        numbers = np.round(np.asarray(states.theta_2) * 1e4).astype(int)
        is_wrong = any(self.effort.rtol == pytest.approx(each) for each in self.wrong)
        marks = np.asarray(self.table)[:, numbers] * is_wrong
        names = ("doubt", "disagreed", "changed")
        found = super().__call__(states, parameters=parameters)
        return found._replace(**dict(zip(names, marks.astype(np.int8), strict=True)))


def swept(table, wrong):
    """Labels of a sweep, and at which tolerances its two chunks were labelled."""
    solved, count = [], np.shape(table)[1]
    starts = jb.starts.grid(SCENE, {"theta_stance": np.arange(count) * 1e-4})
    labelling = as_kind(Doubting, LABELLING, np.asarray(table), wrong, solved)
    chunk = -(-count // 2)
    return jb.sweep(labelling, starts, chunk=chunk, look_for_gaits=False), solved


@pytest.mark.filterwarnings("ignore:accuracy = 0.03 is not met")
def test_witnesses_are_counted_where_a_settled_label_changed():
    """By Chapman of two seen by one, two by the other and one by both: half a start is left."""
    doubt = [0, 1, 1, 1, 2, 1, 1]
    disagreed = [0, 1, 2, 3, 3, 0, 1]
    changed = [0, 1, 1, 1, 1, 1, 0]
    assert [int(each) for each in Doubt] == [0, 1, 2]
    found, _ = swept([doubt, disagreed, changed], (1e-4, 1e-5, 1e-6))
    told = label_errors(found)
    assert (told.starts, told.relabelled, told.changed, told.in_doubt) == (7, 6, 5, 1)
    assert told.wrong == pytest.approx((3 * 3 / 2 - 1 - 3) / 7)


@pytest.mark.filterwarnings("ignore:accuracy = 0.03 is not met")
@pytest.mark.parametrize(
    ("wrong", "rounds"), [((), 1), ((1e-4,), 2), ((1e-4, 1e-5), 3), ((1e-4, 1e-5, 1e-6), 3)]
)
def test_tolerances_are_tightened_until_the_errors_are_what_was_asked_for(wrong, rounds):
    """At tolerances that are `wrong` the witnesses see different errors: many are overlooked."""
    table = np.zeros((3, 1000), int)
    for begin in (0, 500):
        table[[0, 2], begin : begin + 60] = 1
        table[1, begin : begin + 30], table[1, begin + 30 : begin + 60] = 1, 2
    found, solved = swept(table, wrong)
    told = label_errors(found)
    assert solved == pytest.approx(np.repeat([1e-4, 1e-5, 1e-6][:rounds], 2))
    assert told.met is (len(wrong) < 3)
    assert told.rtol == pytest.approx(10.0 ** (-3 - rounds))
    noted = found.attrs.get("label_tolerances")
    assert (noted is None) is (rounds == 1)
    assert noted is None or json.loads(noted) == pytest.approx([1e-4, 1e-5, 1e-6][:rounds])
