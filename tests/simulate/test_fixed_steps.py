"""Steps too long and tolerances too coarse, against equations written anew: they are told."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from extreme_cases.case import Case, check_numbers
from extreme_cases.grazing import START, TIME, grazing_scene, lowest
from extreme_cases.verdict import judge
from reference.scipy_solves import scales, states_of

import jaxbiped as jb

pytestmark = pytest.mark.slow

SEED, STATE = jb.seed_scene(), jb.seed_state()
END = dict(save="end", watch=())
"""Of walks of the seed's that end before anything could be watched: fewer surfaces to compile."""
SCENE = grazing_scene("kelvin-voigt")
"""Its force jumps at touchdown, so that even a shallow contact is felt."""
NUMBERS = check_numbers(SCENE)
DEPTH, LONG, SHORT = 1e-7, 3.196e-4, 1e-5
"""Of the contact had there been no ground [m]; steps that miss it, and that do not [s]."""


def walk(depth, dt, **options):
    start = START.copy()
    start[1] = START[1] - lowest(NUMBERS) - depth
    how = dict(duration=TIME, dt=dt, solver="rodas5p", watch=(), save="end") | options
    found = jb.simulate(SCENE, jb.State(*map(jnp.asarray, start)), **how)
    truth = states_of(start, NUMBERS, TIME, 1e-13, points=12000)[-1]
    apart = np.abs(np.array(found.final) - truth) / scales(NUMBERS, 8)
    return int(found.missed_contacts), float(np.max(apart))


def test_a_contact_between_two_steps_is_told():
    with pytest.warns(RuntimeWarning, match="dt = 0.0003196 steps over contacts") as told:
        missed, error = walk(DEPTH, LONG)
    assert missed == 1
    assert error > 1e-3
    assert len(told) == 1  # walks by longer steps miss it, too
    assert told[0].filename == __file__  # the caller's line, not one of the package


@pytest.mark.parametrize(("depth", "dt"), [(DEPTH, SHORT), (-DEPTH, LONG)])
def test_where_there_is_none_nothing_is_told(depth, dt, recwarn):
    missed, error = walk(depth, dt)
    assert missed == 0
    assert error < 1e-4
    assert not [each for each in recwarn if each.category is RuntimeWarning]


@pytest.mark.parametrize(
    "options",
    [
        {"footsteps": 1},
        pytest.param({"extremes": lambda scene, y: y.hip_z}, marks=pytest.mark.nightly),
    ],
)
def test_they_are_counted_beside_footsteps_and_extremes(options):
    with pytest.warns(RuntimeWarning, match="steps over contacts"):
        assert walk(DEPTH, LONG, **options)[0] == 1


def test_each_of_a_batch_counts_its_own():
    height = START[1] - lowest(NUMBERS)

    def missed(z):
        start = jb.State(*map(jnp.asarray, START))._replace(hip_z=z)
        how = dict(duration=TIME, dt=LONG, solver="rodas5p", watch=(), save="end")
        return jb.simulate(SCENE, start, **how).missed_contacts

    found = jax.vmap(missed)(height - jnp.array([DEPTH, -DEPTH]))
    assert found.tolist() == [1, 0]


def test_by_tolerances_nothing_is_counted():
    found = jb.simulate(SEED, STATE, duration=1e-3, save="end")
    assert found.missed_contacts is None


@pytest.mark.parametrize("dt", [1e-1, 1e-3])
def test_steps_of_one_size_that_are_too_long_are_told(dt):
    with pytest.warns(RuntimeWarning, match=f"dt = {dt:g} is too long"):
        jb.simulate(SEED, STATE, duration=0.03, dt=dt, **END)


@pytest.mark.parametrize(("steps", "factor"), [(7, 0.5), (8, 2.0)])
def test_other_steps_are_longer_from_eight_steps_on(steps, factor):
    dt = 2.0**-9
    with pytest.warns(RuntimeWarning, match=f"too long: with steps of {factor * dt:g} s"):
        jb.simulate(SEED, STATE, duration=steps * dt, dt=dt, **END)


def test_steps_whose_other_solve_is_as_wrong_by_chance_are_told():
    case = Case(
        "dt [s], rodas5p", {"dt [s], rodas5p": 3e-4}, {"xi": 1e6}, duration=0.03,
        asked={"dt": 3e-4, "solver": "rodas5p"},
    )  # fmt: skip
    found = judge(case)
    assert found.error > 1e-2
    assert found.verdict == "flagged"


def test_short_steps_of_one_size_are_not(recwarn):
    walk = jb.simulate(SEED, STATE, duration=3e-3, dt=1e-6, **END)
    assert walk.outcome is jb.Ending.WALKING
    assert not [each for each in recwarn if each.category is RuntimeWarning]


@pytest.mark.parametrize("most", [16, 24])
def test_a_few_short_steps_are_not_where_few_are_allowed(most, recwarn):
    walk = jb.simulate(SEED, STATE, duration=7.5e-6, dt=1e-6, max_solver_steps=most, **END)
    assert walk.outcome is jb.Ending.WALKING
    assert int(walk.accepted) == 8
    assert not [each for each in recwarn if each.category is RuntimeWarning]


@pytest.mark.parametrize("steps", [5, 20, 49, 100])
def test_there_are_as_many_as_divide_the_duration(steps):
    """Here the first one's end is rounded otherwise than a fifth of five steps."""
    walk = jb.simulate(SEED, STATE, duration=float(f"{steps}e-6"), dt=1e-6, **END)
    assert int(walk.accepted) == steps


def test_one_step_that_is_too_long_is_told_where_24_are_allowed():
    """Longer steps end with the walk, as this one does: only shorter ones lead elsewhere."""
    with pytest.warns(RuntimeWarning, match="dt = 0.1 is too long"):
        jb.simulate(SEED, STATE, duration=0.03, dt=0.1, max_solver_steps=24, **END)


def test_a_tolerance_far_too_coarse_for_the_slip_is_told(recwarn):
    how = dict(duration=1e-3, rtol=1e-3, save="end")
    jb.simulate(SEED, STATE, **how)
    assert not [each for each in recwarn if each.category is RuntimeWarning]
    with pytest.warns(RuntimeWarning, match=r"rtol = 0\.001 is too coarse for v0 = 1e-07"):
        jb.simulate(jb.seed_scene(v0=1e-7), STATE, **how)


def test_an_accuracy_by_a_number_holds_where_slip_is_slow():
    case = Case(
        "accuracy", {"accuracy": 2e-5}, {"v0": 1e-7}, start="striking", duration=0.03,
        asked={"accuracy": 2e-5},
    )  # fmt: skip
    found = judge(case)
    assert found.verdict == "accurate"
    assert found.error <= found.told
