"""Doubt about labels, against a made-up boundary and labels that the draft has wrong."""

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb
from jaxbiped.basins._labels import Witness
from jaxbiped.sweep._labelling import relabel_doubtful
from jaxbiped.sweep._labelling_preparation import effort_of
from jaxbiped.sweep._sweep import tally_disagreements
from jaxbiped.sweep.labels import Labelled
from tests.sweep.walkers import same

SCENE = jb.seed_scene()
EFFORT = effort_of(SCENE, accuracy=1.0 / 300.0)


def _followed(distances, asked=None, *, jumps=()):
    """Labels by the side of a boundary, seen 40 tolerances off; by another method on its far side.

    `jumps`: starts whose two methods never agree.
    """

    def follow(places, effort):
        if asked is not None:
            asked.append((len(places), effort.rtol, type(effort.solver).__name__))
        other = type(effort.solver).__name__ != "Rodas4P"
        off = 40.0 * effort.rtol * (-0.7 if other else 1.0)
        label = (distances[places] + off > 0.0).astype(np.int8)
        label = np.where(np.isin(places, jumps), np.int8(other), label)
        ones = np.ones(len(places))
        return Labelled(
            label, -ones.astype(np.int16), 0 * ones.astype(np.int16), *[ones] * 5,
            100 * ones.astype(np.int32), np.ones((len(places), 7)),
        )  # fmt: skip

    return follow


def test_starts_are_settled_that_lie_beside_the_boundary_and_no_others():
    distances = np.array([-1.0, -3e-4, -1e-4, 1e-4, 1.0, 2e-4])
    asked = []
    found = relabel_doubtful(_followed(distances, asked), 6, EFFORT, SCENE)
    assert EFFORT.rtol == pytest.approx(1e-5)
    # Off by 4e-4, 1e-3 at the looser tolerance, and -2.8e-4 by the other method.
    np.testing.assert_array_equal(found.disagreed > 0, [False, True, True, True, False, True])
    np.testing.assert_array_equal(found.label, [0, 0, 0, 1, 1, 1])
    np.testing.assert_array_equal(found.doubt, np.where(found.disagreed > 0, 1, 0))
    np.testing.assert_array_equal(found.changed, [0, 1, 1, 0, 0, 0])
    assert [each[0] for each in asked] == [6, 6, 6, 4, 4, 4, 4]
    np.testing.assert_allclose([each[1] for each in asked[3::2]], [1e-6, 1e-7])
    np.testing.assert_array_equal(found.attempted, [300, 700, 700, 700, 300, 700])
    counted = tally_disagreements(found.doubt, found.disagreed, found.changed)
    assert (counted.starts, counted.relabelled, counted.changed, counted.in_doubt) == (6, 4, 2, 0)


def test_what_never_agrees_is_flagged_and_not_silently_labelled():
    found = relabel_doubtful(_followed(np.ones(3), jumps=(1,)), 3, EFFORT, SCENE)
    assert found.doubt.tolist() == [
        jb.basins.Doubt.NONE,
        jb.basins.Doubt.REMAINS,
        jb.basins.Doubt.NONE,
    ]
    assert found.disagreed.tolist() == [0, Witness.OTHER, 0]
    assert tally_disagreements(found.doubt, found.disagreed, found.changed).in_doubt == 1


def test_what_grazes_is_in_doubt_whoever_agrees():
    plain, grazes = _followed(np.ones(4)), np.array([0, 2, 0, 0], dtype=np.int32)

    def follow(places, effort):
        own = grazes[places] if effort.rtol == EFFORT.rtol else 0 * places
        return plain(places, effort)._replace(grazes=own)

    found = relabel_doubtful(follow, 4, EFFORT, SCENE)
    assert found.doubt.tolist() == [0, int(jb.basins.Doubt.SETTLED), 0, 0]
    assert not found.disagreed.any()
    counted = tally_disagreements(found.doubt, found.disagreed, found.changed)
    assert (counted.relabelled, counted.changed, counted.looser, counted.other) == (1, 0, 0, 0)


@given(st.lists(st.floats(-1e-3, 1e-3), min_size=1, max_size=12), st.data())
@settings(max_examples=40, deadline=None)
def test_no_starts_label_depends_on_another(distances, data):
    distances = np.array(distances)
    whole = relabel_doubtful(_followed(distances), len(distances), EFFORT, SCENE)
    one = data.draw(st.integers(0, len(distances) - 1))
    alone = relabel_doubtful(_followed(distances[[one]]), 1, EFFORT, SCENE)
    same(alone, jax.tree.map(lambda leaf: leaf[[one]], whole))
    settled = whole.doubt == jb.basins.Doubt.SETTLED
    np.testing.assert_array_equal(whole.label[settled], distances[settled] > 0.0)


HARD = {301: 4, 591: 1, 826: 4, 1645: 4, 2142: 4, 2309: 4, 2694: 1, 3278: 0, 4820: 4, 5372: 4}
"""Starts of a sample, most of which the draft labels wrongly, and labels by Rodas5P at 1e-10."""


@pytest.mark.slow
def test_labels_that_the_draft_has_wrong_are_put_right():
    scene = jb.seed_scene(slope=0.02)
    bounds = {"omega_swing": (-4.0, 5.0), "theta_swing": (-0.5, 0.8)}
    starts = jb.starts.sample(scene, bounds, 10_000, method="uniform", seed=1)
    numbers = np.array(sorted([*HARD, *range(0, 10_000, 500)]))
    place = np.isin(numbers, list(HARD))
    draft, ours = (jb.labelling(scene, accuracy=each) for each in ("draft", 1e-3))
    states = starts.at(draft, numbers).states
    before, found = draft(states), ours(states)
    exact = before.label.copy()
    exact[place] = [HARD[number] for number in numbers[place]]
    assert before.doubt is None
    wrong = before.label != exact
    # Rounding decides about some of them.
    assert wrong[place].sum() > len(HARD) / 2
    assert not wrong[~place].any()
    certain = found.doubt != jb.basins.Doubt.REMAINS
    assert (found.label != exact)[certain].sum() <= 3
    assert np.all(found.label[~place] == exact[~place])
    assert (found.doubt[place] == jb.basins.Doubt.SETTLED).any()
    assert ours.settings()["effort"]["wanted"] == 1e-3
    assert "wanted" not in draft.settings()["effort"]
    code = jb.labels.label_at(ours, tuple(bounds))
    points = np.stack([starts.at(ours, numbers).columns[name] for name in bounds], axis=1)
    np.testing.assert_array_equal(code(points[:4]), found.label[:4])
