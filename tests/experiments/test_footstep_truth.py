"""Truth of a footstep's gradients: collocation against SciPy and ours, and the quick run."""

import numpy as np
import pytest
from reference.collocation import radau
from reference.compliant import numbers
from reference.footstep import LAWS, MID_STANCE, PARAMETERS, footstep
from reference.scipy_solves import final_of

from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run


def test_radau_is_of_its_order():
    """The last row integrates powers exactly up to twice the stages less two, and no further."""
    nodes, matrix, _, last = radau(4)
    for power in range(7):
        assert matrix[-1] @ nodes**power == pytest.approx(1.0 / (power + 1), abs=1e-14)
    assert matrix[-1] @ nodes**7 != pytest.approx(1.0 / 8.0, abs=1e-6)
    assert last @ nodes**2 == pytest.approx(0.0, abs=1e-14)
    assert abs(last @ nodes**3) > 1e-2


@pytest.mark.nightly
def test_the_footstep_is_scipys():
    found = footstep()
    assert found.state == pytest.approx(final_of(found.time, 1e-9, start=MID_STANCE), abs=2e-7)
    assert [name for name, _ in found.switches].count("depth 1") == 1


@pytest.mark.nightly
def test_derivatives_are_differences_of_footsteps():
    found, h = footstep(), 1e-4
    for k in (0, 1, 2, 3):
        laws = [LAWS * np.exp(s * h * np.eye(4)[k]) for s in (1.0, -1.0)]
        ends = [footstep(p=numbers(**dict(zip(PARAMETERS, each, strict=True)))) for each in laws]
        slope = (ends[0].time - ends[1].time) / (2.0 * h)
        assert slope == pytest.approx(found.time_gradient[8 + k], rel=1e-4, abs=1e-10)
    height = np.eye(8)[1] * 1e-8
    ends = [footstep(MID_STANCE + s * height) for s in (1.0, -1.0)]
    slope = (ends[0].state - ends[1].state) / 2e-8
    assert slope == pytest.approx(found.gradient[:, 1], rel=1e-4, abs=1e-5)


@pytest.mark.nightly
def test_ours_agree_and_say_how_far(tmp_path):
    numbers, figures = quick_run("footstep_truth", tmp_path)
    assert_is_drawn(figures["footstep_truth.png"])
    assert numbers["problem"]["coarser_collocation"] < 1e-9
    assert numbers["problem"]["our_finest"] < 2e-8
    *own, peer = numbers["rows"]
    assert {row["way"] for row in own} == {"jaxbiped"}
    for row in own:
        assert row["gradient_error"] <= row["said"] < 0.1
    # Differences of solves at 1e-4, by the best of their steps.
    assert peer["gradient_error"] > 10.0 * own[0]["gradient_error"]
    assert peer["said"] is None
