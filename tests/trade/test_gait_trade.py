"""Trade of a gait, against errors that shrink with the tolerance."""

import pytest

import jaxbiped as jb
from jaxbiped.trade import GaitTrade, Way

pytestmark = pytest.mark.slow


def test_errors_of_a_rigid_gait_shrink_with_the_tolerance():
    seed = jb.seed_scene()
    trade = GaitTrade(jb.RigidScene(walker=seed.walker, ground=seed.ground), repeats=1)
    assert trade.parameters == ("slope",)
    truth = trade.truth()
    assert max(truth.floor.values()) < 1e-9
    loose, tight = (
        trade.row(Way("rodas5p", "lanes", f"rtol={r:g}", r), truth) for r in (1e-4, 1e-8)
    )
    assert loose.outcome == tight.outcome == "ok"
    assert loose.attempted < tight.attempted
    assert set(tight.errors) == {"period", "multiplier", "gradient"}
    for axis in ("multiplier", "gradient"):
        assert tight.errors[axis] < 1e-2 * loose.errors[axis]


def test_no_gait_no_truth():
    scene = jb.seed_scene(slope=-0.2)
    assert GaitTrade(scene).parameters == ("K", "c", "xi")
    assert GaitTrade(scene).truth() is None
