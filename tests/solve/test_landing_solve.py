"""Landing solve of a system that is no walker, against the parabolas of a ball that bounces."""

import numpy as np
import pytest

from jaxbiped import Ending
from tests.solve.bouncing_ball import solved


@pytest.mark.parametrize("engine", ["lanes", "xla"])
def test_a_ball_bounces_half_as_fast_each_time(engine):
    """From rest it takes a second to the ground; then as long again, then half as long."""
    end, rows, _ = solved("bounces", engine, room=3)
    assert int(end.footsteps) == 3
    np.testing.assert_allclose(rows.values[:, 0], [1.0, 2.0, 2.5], atol=1e-8)
    np.testing.assert_allclose(rows.values[:, 1:], [[0.0, 1.0], [0.0, 0.5], [0.0, 0.25]], atol=1e-8)


def test_its_states_at_times_lie_on_the_parabolas():
    _, rows, _ = solved("times", "lanes", times=np.array([0.5, 1.0 + 0.5, 2.25]))
    np.testing.assert_allclose(rows.values[:, 1], [0.75, 0.25, 0.0625], atol=1e-8)


def test_one_that_is_thrown_up_comes_to_the_ceiling():
    """At z = 1 + 3 t − t² it is there after one second."""
    end, *_ = solved("end", "lanes", v=3.0)
    assert Ending.of(end.ending) is Ending.FINISHED
    assert float(end.t) == pytest.approx(1.0, abs=1e-8)
    assert float(end.state.v) == pytest.approx(1.0, abs=1e-8)
