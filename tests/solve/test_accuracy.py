"""Named accuracies, against friction that builds up anywhere."""

import jax
import jax.numpy as jnp
import pytest
from reference.scipy_solves import final_of

import jaxbiped as jb
from jaxbiped.solve._accuracy import ACCURACIES, tolerances

SEED, START = jb.seed_scene(), jb.seed_state()


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_the_seeds_tolerances_are_those_of_the_name(accuracy):
    found = tolerances(accuracy, None, None, SEED)
    walk = ACCURACIES[accuracy].walk
    assert (float(found.rtol), float(found.atol)) == (walk, 1e-2 * walk)


BOUNDS = {"draft": 1e-5, "balanced": 6e-7, "tight": 7e-10}
"""Errors of the seed's walk after 0.3 s, in SI units: some 2.5 times those at these tolerances."""


def test_named_walks_are_as_exact_as_their_names_say():
    """Ten times looser tolerances have six to thirteen times the errors."""
    exact = final_of(0.3, 1e-10)
    for accuracy, bound in BOUNDS.items():
        walk = jb.simulate(SEED, START, duration=0.3, accuracy=accuracy, save="end")
        off = max(abs(float(a) - b) for a, b in zip(walk.final, exact, strict=True))
        assert 0.1 * bound < off < bound, accuracy


def test_derivatives_have_ten_times_the_tolerance_of_the_state():
    for each in ACCURACIES.values():
        for precision in (each.gait, each.rigid_gait):
            assert precision.tangent_rtol == pytest.approx(10.0 * precision.rtol)
    draft, balanced, tight = ACCURACIES.values()
    assert draft.gait.rtol > 100.0 * balanced.gait.rtol > 1e4 * tight.gait.rtol


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
