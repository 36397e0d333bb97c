"""Named accuracies, against friction that builds up anywhere."""

import jax
import jax.numpy as jnp
import pytest

import jaxbiped as jb
from jaxbiped.solve._accuracy import ACCURACIES, tolerances

SEED, START = jb.seed_scene(), jb.seed_state()


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_the_seeds_tolerances_are_those_of_the_name(accuracy):
    found = tolerances(accuracy, None, None, SEED)
    assert (float(found.rtol), float(found.atol)) == (
        ACCURACIES[accuracy].walk,
        1e-2 * ACCURACIES[accuracy].walk,
    )


def test_a_slip_speed_is_resolved_and_what_is_given_stays():
    sticky = jb.seed_scene(v0=1e-8)
    assert float(tolerances("balanced", None, None, sticky).rtol) < 1e-8
    assert tolerances("balanced", 1e-6, 1e-9, sticky) == (1e-6, 1e-9)
    larger = jb.seed_scene(v0=1e-8, g=9.8e-4)
    fine, less = (float(tolerances("draft", None, None, s).rtol) for s in (sticky, larger))
    assert less == pytest.approx(100.0 * fine)
    weightless = jb.seed_scene(v0=1e-8, g=0.0)
    assert float(tolerances("draft", None, None, weightless).rtol) == ACCURACIES["draft"].walk
    traced = jax.vmap(lambda v0: tolerances("draft", None, None, jb.seed_scene(v0=v0)).rtol)
    found = traced(jnp.array([1e-8, 1e-4])).tolist()
    assert found == [pytest.approx(fine, rel=1e-14), ACCURACIES["draft"].walk]


@pytest.mark.parametrize("v0", [1e-6, 1e-8])
def test_a_walker_that_all_but_sticks_walks_at_balanced(v0):
    walk = jb.simulate(jb.seed_scene(v0=v0), START, duration=0.45, save="end")
    assert walk.outcome == jb.Ending.WALKING
    exact = jb.simulate(jb.seed_scene(v0=v0), START, duration=0.45, save="end", rtol=1e-9)
    off = max(abs(float(a - b)) for a, b in zip(walk.final, exact.final, strict=True))
    assert off < 1e-4


@pytest.mark.parametrize("name", jb.laws.FRICTION_LAWS)
def test_every_law_names_a_parameter_of_its_own(name):
    law = jb.laws.FRICTION_LAWS[name]
    parameter = getattr(law, "builds_up_over", None)
    assert parameter is None or parameter in law.__dataclass_fields__
