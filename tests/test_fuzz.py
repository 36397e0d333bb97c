"""Features drawn together, against an outcome with numbers or one sentence."""

import time

import pytest

from tests import fuzz


def failures(seed, count, doors, seconds=None, only=None):
    """What fails, in words, of so many draws; no more of them are begun after some seconds."""
    until = float("inf") if seconds is None else time.monotonic() + seconds
    return [
        f"{number}, {failure.door}: {failure.kind}: {failure.words}: {left}"
        for number, _, failure, left in fuzz.run(seed, range(count), doors, only, until)
    ]


@pytest.mark.nightly
def test_fields_of_features_drawn_together():
    assert failures(7, 4, ("field",)) == []


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("seed", "doors", "only"),
    [
        (8, ("field",), {}),
        (9, ("walk", "gait"), {"contact": "rigid", "within": "plain"}),
        (10, ("walk",), {"contact": "compliant", "coordinates": "minimal", "within": "plain"}),
    ],
)
def test_a_few_dozen_draws(seed, doors, only):
    assert failures(seed, 40, doors, 60.0, only) == []


def test_what_fails_is_told_by_the_features_that_it_needs(monkeypatch):
    """One door that fails of two features together; one sentence is no failure."""

    def falls(scene, state, wants):
        if wants("knees") == "stop" and wants("torso") == "spring":
            raise KeyError("a key")
        raise fuzz.jb.ArgumentError("a sentence.")

    monkeypatch.setitem(fuzz.DOORS, "field", {"falls": falls})
    features = {"contact": "rigid", "knees": "stop", "torso": "spring", "slope": 0.0}
    (failure,), ends = fuzz.tried(features, ("field",))
    assert failure.door == "falls"
    assert failure.kind.startswith("KeyError at test_fuzz.py:")
    assert ends["falls"] == "KeyError: 'a key'"
    del features["slope"]
    assert fuzz.smallest(features | {"slope": 0.0}, failure, ("field",)) == features
    assert fuzz.tried(features | {"torso": "none"}, ("field",))[0] == []
