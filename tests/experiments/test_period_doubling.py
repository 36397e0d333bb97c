"""Period doublings, at the quick size, against published gaits and Feigenbaum's cascade."""

import pytest

from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_the_cascade_and_the_walks_beside_it(tmp_path):
    numbers, figures = quick_run("period_doubling", tmp_path)
    (figure,) = figures.values()
    assert_is_drawn(figure)
    assert 0.1 < numbers["rigid_seed"]["slope"] < 0.102
    assert numbers["rigid_seed"]["doubled"]["footsteps"] == 2
    pair = numbers["pair"]
    assert pair["long"]["theta"] == pytest.approx(0.20031090049483, abs=1e-9)
    assert pair["short"]["theta"] == pytest.approx(0.19393736960624, abs=1e-9)
    assert pair["long"]["stable"]
    assert not pair["short"]["stable"]
    assert pair["long"]["first_doubling"] == pytest.approx(0.0150884379, abs=1e-9)
    assert numbers["cascade"]["footsteps"] == [1, 2, 4]
    assert numbers["cascade"]["ratios"] == pytest.approx([5.26], abs=0.01)
    chaos = numbers["chaos"]
    assert chaos["last_cycle"] < 0.0183 < chaos["first_without"] < 0.0189
    (family,) = numbers["period_three"]["branches"]
    assert "fold" in [kind for kind, _ in family["bifurcations"]]
    assert len(numbers["period_three"]["gaits"]) >= 1
