"""The energy ledger, against conservation: it closes, and tells a sloppy solve."""

import numpy as np
import pytest
from reference.walks import walk as independent_walk

import jaxbiped as jb
from jaxbiped.measure import _energy_ledger
from jaxbiped.measure._samples import NODES, ModeChanges


def test_the_ledger_closes_at_the_tight_setting(seed_walk):
    scene, walk = seed_walk
    ledger = jb.measure.energy_ledger(scene, walk)
    assert abs(ledger.residual[0]) < 1e-6 * ledger.gravity_work[0]
    assert ledger.friction_loss[0] > 0.0


def test_the_residual_follows_the_tolerance():
    """In proportion to it: a thousand times tighter is at least a thousand times better."""
    scene, tolerances = jb.seed_scene(), np.array([1e-4, 1e-5, 1e-6, 1e-7])
    residuals = []
    for rtol in tolerances:
        walk = jb.simulate(scene, jb.seed_state(), duration=2.0, rtol=rtol)
        ledger = jb.measure.energy_ledger(scene, walk)
        residuals.append(abs(ledger.residual[0]) / ledger.gravity_work[0])
    assert np.all(residuals < 10.0 * tolerances)
    assert np.all(np.diff(residuals) < -0.8 * np.array(residuals[:-1]))
    assert residuals[0] > 1e3 * residuals[-1]


@pytest.mark.slow
def test_parts_are_those_of_an_independent_solve(seed_walk):
    """Not only their sum: what goes into one part could be missing in another."""
    ledger = jb.measure.energy_ledger(*seed_walk)
    for name, expected in independent_walk(2.0, 1e-11).ledger.items():
        assert getattr(ledger, name)[0] == pytest.approx(expected, abs=1e-7), name


def test_parts_add_up_to_the_whole(seed_walk):
    scene, walk = seed_walk
    whole = jb.measure.energy_ledger(scene, walk)
    parts = jb.measure.energy_ledger(scene, walk, np.array([0.0, 0.3, 1.0, float(walk.t[-1])]))
    for total, pieces in zip(whole, parts, strict=True):
        assert pieces.shape == (3,)
        assert pieces.sum() == pytest.approx(total[0], abs=1e-9)


def test_gravitys_work_is_its_potential(seed_walk):
    """Also by integrating its power along the solution."""
    from jaxbiped.dynamics import powers
    from jaxbiped.measure._samples import sample

    scene, walk = seed_walk
    flows = sample(scene, walk, powers, np.zeros(0))
    work = flows.integral(flows.values.gravity).sum()
    assert work == pytest.approx(jb.measure.energy_ledger(scene, walk).gravity_work[0], rel=1e-7)


@pytest.mark.parametrize("times", [[1.0, 0.5], [0.2, 1.0, 0.5, 1.5], [0.5], [[0.2, 0.5]]])
def test_times_that_do_not_increase_are_refused(seed_walk, times):
    with pytest.raises(jb.ArgumentError, match="2 or more increasing numbers"):
        jb.measure.energy_ledger(*seed_walk, np.array(times))


def test_what_a_change_of_mode_takes_is_the_energy_beside_it():
    """Energies that fall steadily but where a mode changes, once in one footstep, twice in another.

    What joints lose on the way is no loss of the change's; NaN where a change was left out.
    """
    changes = np.array([0, 2, 2]), np.array([0.25, 0.5, 0.75])
    taken = np.array([2.0, 0.5, 0.125])

    def energy(number, since):
        past = (changes[0] == number[:, None]) & (changes[1] < since[:, None])
        return 6.0 - 0.75 * since - past @ taken

    known = np.array([True, True, True, False])
    found = _energy_ledger._stop_losses(energy, np.ones(4), ModeChanges(*changes, known))
    np.testing.assert_allclose(found, [2.0, 0.0, 0.625, np.nan], atol=1e-12)


def test_works_of_powers_that_jump_and_bend_within_a_footstep():
    """Closed forms; in the second footstep everything is twice as strong."""
    periods, strengths = np.array([0.7, 0.9]), np.array([1.0, 2.0])

    def powers(numbers, begins, widths):
        times = begins[:, None] + widths[:, None] * 0.5 * (1.0 + NODES)
        total, lost = np.abs(times - 0.31), np.maximum(times - 0.42, 0.0)
        jumps, steady = np.where(times > 0.4, 2.0, -1.0), times
        return strengths[numbers][:, None] * np.array([total, lost, jumps, steady])

    change = ModeChanges(np.array([1]), np.array([0.4]), np.array([True, True]))
    found = _energy_ledger._works(powers, periods, change)
    total = 0.5 * (0.31**2 + (periods - 0.31) ** 2)
    motors = 2.0 * (periods - 0.4) + 0.5 * periods**2
    lost = 0.5 * (periods - 0.42) ** 2
    np.testing.assert_allclose(found, strengths * np.array([total, motors, lost]), rtol=1e-7)
