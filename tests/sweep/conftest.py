"""Labels that cost nothing, for sweeps whose labels do not matter."""

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.basins._labels import Label
from jaxbiped.sweep._follow_starts import Labelled


@pytest.fixture
def by_formula(monkeypatch):
    """Every labelling labels by the sign of a difference of angles; counts the starts it labels."""
    asked = []

    def follow(self, states, given, effort):
        count, column = len(states.hip_x), np.asarray(states.theta_2, float)
        asked.append(count)
        whole = np.zeros(count, int)
        label = np.where(column > 0.2, int(Label.FELL_BACK), int(Label.STUMBLED)).astype(np.int8)
        return Labelled(label, whole - 1, whole, whole, column, 10.0 * column, column, column,
                        whole + 7, np.zeros((count, 4)))  # fmt: skip

    monkeypatch.setattr(jb.labels.Labelling, "_label_once", follow)
    return asked
