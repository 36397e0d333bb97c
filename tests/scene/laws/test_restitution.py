"""What restitution each formula really gives, against numbers computed elsewhere."""

import jax
import numpy as np
import pytest
from scipy.optimize import brentq

import jaxbiped as jb
from tests.scene.laws.drop import restitutions

WANTED = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
REALISED = {
    "hunt-crossley": (0.516, 0.581, 0.663, 0.768, 0.909),
    "herbert-mcwhannell": (0.491, 0.520, 0.594, 0.723, 0.901),
    "lee-wang": (0.687, 0.739, 0.799, 0.869, 0.952),
    "lankarani-nikravesh": (0.665, 0.684, 0.725, 0.796, 0.913),
    "gonthier": (0.101, 0.304, 0.488, 0.670, 0.876),
    "zhiying-qishao": (0.218, 0.327, 0.483, 0.680, 0.896),
    "flores": (0.069, 0.256, 0.470, 0.683, 0.894),
    "hu-guo": (0.074, 0.271, 0.488, 0.697, 0.900),
}
DIVIDE = ("gonthier", "flores", "hu-guo")


def test_the_formulas_are_these():
    assert list(jb.laws.RESTITUTION_FORMULAS) == list(REALISED)


@pytest.mark.parametrize("formula", REALISED)
def test_a_drop_realises_the_restitution(formula):
    speed = 0.5
    law = jb.laws.HuntCrossley.from_restitution(
        K=1e6, e=WANTED, approach_speed=speed, formula=formula
    )
    found = restitutions(law, np.full(WANTED.size, speed))
    np.testing.assert_allclose(found, REALISED[formula], atol=0.002)
    np.testing.assert_allclose(found, [_by_energy(float(h), speed) for h in law.hysteresis], 1e-5)


def _by_energy(hysteresis, speed):
    """Force times path on the ways in and out are equal: no integration in time at all."""
    way = lambda v: v / hysteresis - np.log1p(hysteresis * v) / hysteresis**2
    fastest = min(speed, (1 - 1e-14) / hysteresis)
    return brentq(lambda v: way(-v) - way(speed), 0.0, fastest, xtol=1e-14) / speed


@pytest.mark.parametrize("formula", REALISED)
def test_no_loss_at_one_and_more_loss_below(formula):
    factor = jb.laws.RESTITUTION_FORMULAS[formula]
    assert float(factor(1.0)) == 0.0
    assert (np.diff(factor(np.linspace(0.5, 1.0, 21))) < 0.0).all()
    slope = jax.grad(lambda e: factor(e))(0.7)
    difference = (factor(0.7 + 1e-6) - factor(0.7 - 1e-6)) / 2e-6
    np.testing.assert_allclose(slope, difference, rtol=1e-8)


def test_approach_speed_and_hysteresis():
    law = jb.laws.HuntCrossley.from_restitution(K=1e6, e=0.5, approach_speed=0.25, formula="hu-guo")
    assert float(law.hysteresis) == pytest.approx(1.5 / 0.25)
    default = jb.laws.HuntCrossley.from_restitution(K=1e6, e=0.5, approach_speed=0.25)
    assert float(default.hysteresis) == pytest.approx(1.6 / 0.25)


@pytest.mark.parametrize("formula", REALISED)
@pytest.mark.parametrize("e", [-0.1, 1.1, float("nan"), [0.5, 1.5]])
def test_a_restitution_that_is_none_is_refused(formula, e):
    with pytest.raises(jb.ArgumentError, match=r"^e = .*at most 1"):
        jb.laws.RESTITUTION_FORMULAS[formula](e)


@pytest.mark.parametrize("formula", REALISED)
def test_zero_is_refused_where_it_is_divided_by(formula):
    factor = jb.laws.RESTITUTION_FORMULAS[formula]
    if formula in DIVIDE:
        with pytest.raises(jb.ArgumentError, match=r"^e = 0 is not allowed: .*above 0"):
            factor(0.0)
    else:
        assert np.isfinite(factor(0.0))
