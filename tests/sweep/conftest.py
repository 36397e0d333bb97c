"""Labels that cost nothing, for sweeps whose labels do not matter."""

import pytest

from tests.sweep.walkers import ByFormula


@pytest.fixture
def by_formula():
    """How many starts labellings by a formula label at once, call by call."""
    ByFormula.asked.clear()
    return ByFormula.asked
