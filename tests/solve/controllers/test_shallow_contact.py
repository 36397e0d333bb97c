"""Shallow contact: plain steps that would step over one, against equations written anew."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from extreme_cases.case import check_numbers
from extreme_cases.grazing import START, TIME, grazing_scene, lowest
from reference.scipy_solves import scales, states_of

import jaxbiped as jb

pytestmark = pytest.mark.slow

DEPTHS = np.array([1e-5, 1e-6, 1e-7, 1e-8])
"""Of the contact that a swinging foot would come to had there been no ground [m]."""
SCENE = grazing_scene("kelvin-voigt")
"""Its force jumps at touchdown, so that even a shallow contact is felt."""


@pytest.fixture(scope="module")
def ends():
    """Starts, and the states at the end with a contact and with none."""
    p = check_numbers(SCENE)
    touching = START[1] - lowest(p)

    def end(height, points):
        start = START.copy()
        start[1] = height
        return states_of(start, p, TIME, 1e-13, points=points)[-1]

    heights = touching - DEPTHS
    points = (4000 * np.sqrt(1e-6 / np.minimum(DEPTHS, 1e-6))).astype(int)
    return heights, np.array([end(z, n) for z, n in zip(heights, points, strict=True)])


@pytest.mark.parametrize(
    ("engine", "accuracy", "within"),
    [("lanes", "balanced", 1e-5), ("lanes", "tight", 1e-7), ("xla", "balanced", 1e-5)],
)
def test_a_shallow_contact_is_not_stepped_over(ends, engine, accuracy, within):
    heights, expected = ends

    def end(height):
        start = jb.State(*map(jnp.asarray, START))._replace(hip_z=height)
        return jb.simulate(
            SCENE, start, duration=TIME, save="end", watch=(), engine=engine, accuracy=accuracy
        ).final

    found = np.stack(jax.vmap(end)(jnp.asarray(heights)), axis=1)
    error = np.max(np.abs(found - expected) / scales(check_numbers(SCENE), 8), axis=1)
    assert np.all(error < within)


@pytest.mark.parametrize("solver", ["rodas4", "rodas4p"])
@pytest.mark.parametrize("law", ["kelvin-voigt", "smooth-ristow-schafer"])
def test_contacts_are_found_wherever_a_step_ends(law, solver):
    """A step may end in such a contact: before its force is felt, or after the damper's is over."""
    random = np.random.default_rng(3)
    depths, tolerances = (
        10.0 ** random.uniform(*span, 1000) for span in ((-8.5, -4.0), (-9.0, -4.5))
    )
    normal = jb.laws.normal_law_like(law, K=1e6, c=1e7, n=1.5, mass=2.0)
    scene, p = dataclasses.replace(SCENE, normal=normal), check_numbers(SCENE)
    touching = START[1] - lowest(p)

    def end(depth, rtol):
        start = jb.State(*map(jnp.asarray, START))._replace(hip_z=touching - depth)
        how = dict(save="end", watch=(), engine="lanes", solver=solver)
        return jb.simulate(scene, start, duration=TIME, rtol=rtol, atol=1e-2 * rtol, **how).final

    found, exact = (
        np.stack(jax.vmap(end)(jnp.asarray(depths), jnp.asarray(each)), axis=1)
        for each in (tolerances, np.full_like(tolerances, 1e-11))
    )
    error = np.max(np.abs(found - exact) / scales(p, 8), axis=1)
    assert np.all(error < np.maximum(1e3 * tolerances, 1e-5))
