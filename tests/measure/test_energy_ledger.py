"""The energy ledger closes, and tells an honest solve from a sloppy one."""

import numpy as np
import pytest

import jaxbiped as jb


def test_the_ledger_closes_at_the_tight_setting(seed_walk):
    scene, walk = seed_walk
    ledger = jb.energy_ledger(scene, walk)
    assert abs(ledger.residual[0]) < 1e-6 * ledger.gravity_work[0]
    assert ledger.friction_loss[0] > 0.0


def test_the_residual_measures_the_error():
    scene = jb.seed_scene()
    residuals = [
        abs(
            jb.energy_ledger(
                scene, jb.simulate(scene, jb.seed_state(), duration=2.0, rtol=rtol)
            ).residual[0]
        )
        for rtol in (1e-4, 1e-7)
    ]
    assert residuals[0] > 10 * residuals[1]


def test_parts_add_up_to_the_whole(seed_walk):
    scene, walk = seed_walk
    whole = jb.energy_ledger(scene, walk)
    parts = jb.energy_ledger(scene, walk, np.array([0.0, 0.3, 1.0, float(walk.t[-1])]))
    for total, pieces in zip(whole, parts, strict=True):
        assert pieces.shape == (3,)
        assert pieces.sum() == pytest.approx(total[0], abs=1e-9)


def test_gravitys_work_is_its_potential(seed_walk):
    """Also by integrating its power along the solution."""
    from jaxbiped.dynamics._energy import powers
    from jaxbiped.measure._samples import sample

    scene, walk = seed_walk
    flows = sample(scene, walk, powers, np.zeros(0))
    work = flows.integral(flows.values.gravity).sum()
    assert work == pytest.approx(jb.energy_ledger(scene, walk).gravity_work[0], rel=1e-7)
