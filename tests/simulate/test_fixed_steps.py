"""Fixed steps, against equations written anew: contacts between two are told."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from extreme_cases.case import check_numbers
from extreme_cases.grazing import START, TIME, grazing_scene, lowest
from reference.scipy_solves import scales, states_of

import jaxbiped as jb

pytestmark = pytest.mark.slow

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


@pytest.mark.parametrize(("depth", "dt"), [(DEPTH, SHORT), (-DEPTH, LONG)])
def test_where_there_is_none_nothing_is_told(depth, dt, recwarn):
    missed, error = walk(depth, dt)
    assert missed == 0
    assert error < 1e-4
    assert not [each for each in recwarn if each.category is RuntimeWarning]


@pytest.mark.parametrize("options", [{"footsteps": 1}, {"extremes": lambda scene, y: y.hip_z}])
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
    found = jb.simulate(jb.seed_scene(), jb.seed_state(), duration=1e-3, save="end")
    assert found.missed_contacts is None
