"""The trip of a scene through each door, against the files and climbs that it may take."""

import pytest

from tests.scene_trip import above, imports, trip_through

MOST = {"simulate": (20, 3), "find_gait": (24, 6), "labelling": (28, 7)}
"""Files entered, and climbs back to a file above."""


# Labelling searches the gait first: what the search alone passes through is counted at night.
@pytest.mark.slow
@pytest.mark.parametrize(
    "door", ["simulate", "labelling", pytest.param("find_gait", marks=pytest.mark.nightly)]
)
def test_a_scene_passes_through_few_files(door):
    files, climbs, _ = trip_through(door).counts(above(imports()))
    assert 10 < files <= MOST[door][0]
    assert climbs <= MOST[door][1]
