"""Named walkers and their parameters, against the mechanisms they stand for and written numbers."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.scene.test_mechanism import BISECTING, LAW, LEGS, TORSO, kneed, two_legs

WALKER = dict(m=1.5, J=0.01, l=0.4, d=0.1, r=0.08, hip_mass=0.7)


def test_masses_and_lengths_are_sums_of_its_own():
    walker = jb.Walker(**WALKER)
    assert float(walker.total_mass) == pytest.approx(2 * 1.5 + 0.7)
    assert float(walker.hip_to_foot) == pytest.approx(0.4 - 0.08)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (dict(l=0.07), "l = 0.07 and r = 0.08 are not allowed together"),
        (dict(m=0.0), "m = 0 is not allowed"),
        (dict(l=0.0), "l = 0 is not allowed"),
        (dict(r=-0.01), "r = -0.01 is not allowed"),
        (dict(d=-0.01), "d = -0.01 is not allowed"),
        (dict(J=-1e-9), "J = -1e-09 is not allowed"),
        (dict(hip_mass=-0.1), "hip_mass = -0.1 is not allowed"),
        (dict(J=0.0, hip_mass=0.0), "J = 0 is not allowed where hip_mass = 0"),
        (dict(J=0.0, d=0.0), "J = 0 is not allowed where d = 0"),
    ],
)
def test_numbers_that_no_walker_has_are_refused(change, said):
    with pytest.raises(jb.ArgumentError) as refused:
        jb.Walker(**WALKER | change)
    assert said in str(refused.value)
    jb.Walker(**WALKER | {"l": 0.08, "d": 0.0})


KNEED = jb.Kneed(
    m_thigh=0.2, J_thigh=5.8e-4, l_thigh=0.184, d_thigh=0.08,
    m_shank=0.124, J_shank=6.9e-4, l_shank=0.216, d_shank=0.096, w_shank=-0.004,
    r=0.08, hip_mass=1.352, epsilon=0.2, stop=LAW,
)  # fmt: skip
SEED = jb.seed_scene().walker


def test_a_kneed_walker_is_its_mechanism():
    found, expected = KNEED.mechanism(), kneed()
    assert found.structure == expected.structure
    np.testing.assert_allclose(jax.tree.leaves(found), jax.tree.leaves(expected), rtol=1e-15)
    assert found.structure.coordinates[2:] == (
        "theta_thigh_1", "theta_shank_1", "theta_thigh_2", "theta_shank_2"
    )  # fmt: skip


def test_a_kneed_walkers_parameters_are_its_fields():
    names = jb.parameter_names(KNEED)
    assert names[:2] == ("m_thigh", "J_thigh")
    assert names[-4:] == ("epsilon", "stop.K", "stop.c", "stop.n")
    slopes = jax.grad(lambda walker: walker.mechanism().total_mass)(KNEED)
    assert (float(slopes.m_thigh), float(slopes.hip_mass)) == (2.0, 1.0)
    held = jb.with_parameters(KNEED, {"stop.K": 9.0}).mechanism()
    assert [float(stop.law.K) for stop in held.joints] == [9.0, 9.0]


def test_rigid_feet_need_no_law_of_the_stop():
    rigid = jb.Kneed(*jax.tree.leaves(KNEED)[:12], holds="through heel strike").mechanism()
    assert {(stop.law, stop.holds) for stop in rigid.joints} == {(None, "through heel strike")}


def test_a_torso_bisects_the_legs_or_is_held_by_a_spring():
    coupled = jb.WithTorso(two_legs(), m_torso=0.3, J_torso=0.0015, h=0.1).mechanism()
    expected = two_legs(jb.Coupling(BISECTING), bodies=(*LEGS, TORSO))
    assert coupled.structure == expected.structure
    np.testing.assert_array_equal(jax.tree.leaves(coupled), jax.tree.leaves(expected))
    spring = jb.Spring({"torso": 1, "vertical": -1}, stiffness=60.0, damping=1.0)
    held = jb.WithTorso(KNEED, 0.3, 0.0015, 0.1, spring)
    assert "theta_torso" in held.mechanism().structure.coordinates
    names = jb.parameter_names(held)
    assert {"walker.m_thigh", "walker.stop.K", "h", "spring.stiffness"} <= set(names)


@pytest.mark.parametrize("walker", [SEED, KNEED], ids=["two legs", "kneed"])
def test_a_torso_of_any_walker_bisects_its_legs(walker):
    (fixed,) = jb.WithTorso(walker, 0.3, 0.0015, 0.1).mechanism().structure.fixed
    assert [weight for _, weight in fixed.angle.weights] == [0.5, 0.5]


REFUSED = {
    "l_shank = 0.05": lambda: jb.with_parameters(KNEED, {"l_shank": 0.05}),
    "m_thigh = 0": lambda: jb.with_parameters(KNEED, {"m_thigh": 0.0}),
    "stop = 3": lambda: jb.Kneed(*jax.tree.leaves(KNEED)[:12], stop=3.0),
    "holds = 'never'": lambda: jb.Kneed(*jax.tree.leaves(KNEED)[:12], holds="never"),
    "module with a method": lambda: jb.WithTorso(3.0, 0.3, 0.0015, 0.1),
    "with 0 mirrored": lambda: jb.WithTorso(two_legs(mirror=()), 0.3, 0.0015, 0.1),
    "m_torso = 0": lambda: jb.WithTorso(SEED, 0.0, 0.0015, 0.1),
    "without any inertia": lambda: jb.WithTorso(
        SEED, 0.3, 0.0, 0.0, jb.Spring("torso", stiffness=1.0)
    ),
}


@pytest.mark.parametrize("words", REFUSED)
def test_what_is_no_walker_is_refused(words):
    with pytest.raises(jb.ArgumentError, match=words):
        REFUSED[words]()


def test_walkers_are_made_under_tracing():
    def height(length):
        walker = jb.with_parameters(KNEED, {"l_thigh": length})
        return jb.WithTorso(walker, 0.3, 0.0015, 0.1).mechanism().height

    assert float(jax.jit(jax.grad(height))(0.2)) == 1.0
    assert jax.vmap(height)(jnp.array([0.2, 0.3])).shape == (2,)
