"""Friction with a memory, against formulas written anew, differences and the seed's gait."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb
from tests.scene.laws.formulas import friction_shares

DAHL = jb.laws.Dahl(mu=0.45, sigma_0=2e4)
LUGRE = jb.laws.LuGre(
    mu_static=0.5, mu_kinetic=0.4, v_s=1e-3, sigma_0=2e4, sigma_1=60.0, sigma_2=0.02
)
LAWS = [DAHL, LUGRE]
name = lambda law: type(law).__name__
floats = lambda low, high: st.floats(low, high, allow_subnormal=False)


def with_law(law):
    return eqx.tree_at(lambda scene: scene.friction, jb.seed_scene(), law)


@pytest.mark.parametrize("law", LAWS, ids=name)
def test_coefficients_and_rates_are_the_formulas(law):
    size = np.array([1e-6, 2e-4, 1e-3, 2e-3, 0.3])
    slip, bristle = np.meshgrid([*-size, 0.0, *size], [-0.4, -1e-2, 0.0, 0.2, 0.45])
    told = law.coefficient(slip, bristle), law.rate(slip, bristle)
    for found, expected in zip(told, friction_shares(law, 1.0, slip, bristle), strict=True):
        # At the largest coefficient a rate is the rounding of two large terms that cancel.
        rounding = max(1e-12, 1e-15 * np.abs(expected).max())
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=rounding)


@pytest.mark.parametrize("law", LAWS, ids=name)
@settings(deadline=None, max_examples=60)
@given(floats(0.0, 500.0), floats(-3.0, 3.0), floats(-0.4, 0.4))
def test_odd_bounded_and_gone_without_load(law, load, slip, bristle):
    load, slip, bristle = map(jnp.asarray, (load, slip, bristle))
    force = law.force(load, slip, bristle)
    np.testing.assert_allclose(force, -law.force(load, -slip, -bristle), rtol=1e-13, atol=1e-13)
    rate = law.bristle_rate(load, slip, bristle)
    opposite = law.bristle_rate(load, -slip, -bristle)
    np.testing.assert_allclose(rate, -opposite, rtol=1e-13, atol=1e-13)
    nothing = jnp.zeros_like(load)
    assert float(law.force(nothing, slip, bristle)) == 0.0
    assert float(law.bristle_rate(nothing, slip, bristle)) == pytest.approx(-50.0 * float(bristle))
    # At its largest coefficient a bristle bends no further.
    most = jnp.asarray(0.45 if law is DAHL else 0.5)
    outward = law.bristle_rate(load, slip, most)
    assert float(outward) <= 1e-9


@pytest.mark.parametrize("law", LAWS, ids=name)
def test_derivatives_equal_differences(law):
    point = (jnp.asarray(12.0), jnp.asarray(3e-4), jnp.asarray(0.21))
    for method in (type(law).force, type(law).bristle_rate):
        for beside in (1e-9, -1e-9, 3e-4, -0.4):
            at = (point[0], jnp.asarray(beside), point[2])
            gradient = jax.grad(method, argnums=(0, 1, 2, 3))(law, *at)
            for i, step in enumerate((1e-5, 1e-10, 1e-7)):
                high, low = ([*at] for _ in range(2))
                high[i], low[i] = at[i] + step, at[i] - step
                difference = (method(law, *high) - method(law, *low)) / (2 * step)
                np.testing.assert_allclose(gradient[i + 1], difference, rtol=2e-5, atol=1e-7)
            by_parameter = jax.tree.leaves(gradient[0])
            assert all(bool(jnp.isfinite(leaf)) for leaf in by_parameter)


def test_only_scenes_with_bristles_carry_them():
    state = jb.seed_state()
    plain = jb.simulate(jb.seed_scene(), state, duration=0.01, save="end")
    assert type(plain.state) is jb.State
    bent = jb.simulate(with_law(LUGRE), state, duration=0.01, save="end")
    assert type(bent.state) is jb.dynamics.BristleState
    given_ones = jb.dynamics.BristleState(**state._asdict(), bristle_1=0.0, bristle_2=0.1)
    moved = jb.simulate(with_law(LUGRE), given_ones, duration=0.01, save="end")
    assert float(moved.state.bristle_2[0]) != float(bent.state.bristle_2[0])
    with pytest.raises(jb.ArgumentError, match="state has bristles, but friction = BengisuAkay"):
        jb.simulate(jb.seed_scene(), given_ones, duration=0.01)


def test_exchanging_legs_exchanges_bristles():
    state = jb.dynamics.BristleState(*[jnp.asarray(float(i)) for i in range(10)])
    swapped = [float(leaf) for leaf in jb.dynamics.exchange_legs(jb.seed_scene(), state)]
    assert swapped == [0.0, 1.0, 3.0, 2.0, 4.0, 5.0, 7.0, 6.0, 9.0, 8.0]


@pytest.mark.nightly
def test_engines_agree_and_bristles_straighten_in_the_swing():
    scene = with_law(LUGRE)
    lanes, xla = (
        jb.simulate(scene, jb.seed_state(), duration=0.7, rtol=1e-8, save="end", engine=engine)
        for engine in ("lanes", "xla")
    )
    np.testing.assert_allclose(np.array(lanes.state), np.array(xla.state), atol=2e-6)
    # Leg 1 came down, and leg 2 has swung for a third of a second.
    assert abs(float(lanes.state.bristle_1[0])) > 1e-2
    assert abs(float(lanes.state.bristle_2[0])) < 1e-5


@pytest.mark.slow
def test_the_gait_on_bristles_is_the_seeds_but_for_their_give():
    gait = jb.find_gait(with_law(LUGRE), parameters=("sigma_0", "K"), radius_sensitivities=False)
    assert gait.outcome is jb.gait.Search.FOUND
    assert float(gait.unit_multiplier_error) < 1e-4
    assert float(gait.measures.period) == pytest.approx(0.4408, abs=2e-3)
    assert type(gait.measures.state) is jb.dynamics.BristleState
    assert bool(jnp.all(jnp.isfinite(gait.sensitivities.period)))


def test_a_state_without_bristles_is_refused_where_nothing_adds_them():
    for use in (
        jb.dynamics.foot_forces,
        lambda scene, state: jb.dynamics.vector_field(0.0, state, scene),
    ):
        with pytest.raises(jb.ArgumentError, match="state has no bristles, which friction = LuGre"):
            use(with_law(LUGRE), jb.seed_state())
