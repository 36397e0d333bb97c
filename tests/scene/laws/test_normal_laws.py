"""Laws of the normal force, against formulas written a second time, differences, constructors."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb
from tests.scene.laws.derivatives import Force
from tests.scene.laws.formulas import normal_forces


def numbers(low, high):
    # XLA takes subnormal numbers for zero.
    return st.floats(low, high, allow_subnormal=False)


K = numbers(1e3, 1e8)
SOME = {
    "Hertz": st.builds(jb.laws.Hertz, K=K, n=numbers(1.0, 2.0)),
    "KelvinVoigt": st.builds(jb.laws.KelvinVoigt, K=K, D=numbers(0.0, 1e4)),
    "RistowSchafer": st.builds(
        jb.laws.RistowSchafer, K=K, c=numbers(0.0, 1e8), n=numbers(1.0, 2.0)
    ),
    "KuwabaraKono": st.builds(jb.laws.KuwabaraKono, K=K, gamma=numbers(0.0, 1e6)),
    "Tsuji": st.builds(jb.laws.Tsuji, K=K, gamma=numbers(0.0, 1e5)),
    "HuntCrossley": st.builds(
        jb.laws.HuntCrossley, K=K, hysteresis=numbers(0.0, 1e3), n=numbers(1.0, 2.0)
    ),
    "SmoothRistowSchafer": st.builds(
        jb.laws.SmoothRistowSchafer, K=K, c=numbers(0.0, 1e8), n=numbers(1.0, 2.0)
    ),
}
LAWS = [
    jb.laws.Hertz(K=1e6),
    jb.laws.KelvinVoigt(K=3e4, D=200.0),
    jb.laws.RistowSchafer(K=1e6, c=3e5),
    jb.laws.KuwabaraKono(K=1e6, gamma=5e3),
    jb.laws.Tsuji(K=1e6, gamma=1e3),
    jb.laws.HuntCrossley(K=1e6, hysteresis=3.0),
]
DAMPED = LAWS[1:]
SEED, SMOOTH = (kind(K=1e6, c=1e7) for kind in (jb.laws.RistowSchafer, jb.laws.SmoothRistowSchafer))
OWN_EXPONENT = ("Hertz", "RistowSchafer", "HuntCrossley")
GRID = np.meshgrid([-1e-3, 0.0, *np.geomspace(1e-9, 1e-2, 22)], [-2.0, -1e-3, 0.0, 1e-2, 2.0])
"""Depths and rates."""
name = lambda law: type(law).__name__
force = eqx.filter_jit(lambda law, depth, rate: law.force(depth, rate))
held = eqx.filter_jit(lambda law, depth: law.elastic_force(depth))


@pytest.mark.parametrize("kind", SOME)
def test_forces_are_the_formulas_and_never_pull_and_dampers_only_lose(kind):
    depths, rates = GRID

    @settings(deadline=None, max_examples=30)
    @given(SOME[kind])
    def check(law):
        found, elastic = (np.asarray(part) for part in (force(law, *GRID), held(law, depths)))
        np.testing.assert_allclose(found, normal_forces(law, *GRID), rtol=1e-10, atol=1e-9)
        assert (found >= 0.0).all()
        assert (found[depths <= 0.0] == 0.0).all()
        assert (elastic[depths <= 0.0] == 0.0).all()
        if kind != "SmoothRistowSchafer":  # whose ramp takes from elasticity, too
            assert ((found - elastic) * rates >= -1e-9 * elastic * np.abs(rates)).all()

    check()


@pytest.mark.parametrize("law", LAWS, ids=name)
def test_a_closed_loop_loses_energy(law):
    turn = jnp.linspace(0.0, 2.0 * jnp.pi, 20001)
    for middle, swing in ((1e-3, 2e-4), (2e-4, 6e-4)):
        depth = middle + swing * jnp.sin(turn)
        rate = 300.0 * swing * jnp.cos(turn)
        work = float(jnp.trapezoid(law.force(depth, rate), depth))
        given_back = float(law.elastic_energy(jnp.asarray(middle + swing)))
        assert work > 1e-3 * given_back if law in DAMPED else abs(work) < 1e-7 * given_back


@pytest.mark.parametrize("law", LAWS, ids=name)
def test_only_kelvin_and_voigt_jump_at_touchdown(law):
    force = float(law.force(jnp.asarray(1e-14), jnp.asarray(0.3)))
    assert (force > 1.0) == law.jumps_at_touchdown == isinstance(law, jb.laws.KelvinVoigt)


def test_the_jump_is_told_to_the_switches():
    scene = jb.seed_scene()
    for law in (jb.laws.KelvinVoigt(K=3e4, D=200.0), jb.laws.Tsuji(K=1e6, gamma=1e3)):
        changed = eqx.tree_at(lambda s: s.normal, scene, law)
        # Of each foot: touchdown, the reaction, three of friction, the clearance rule.
        jumps = [switch.force_jumps for switch in jb.hybrid.switches(changed, jb.seed_state())]
        assert jumps == 2 * [law.jumps_at_touchdown, False, False, False, False, True]


def _lift_off(law, depth):
    """The rate at which the reaction reaches zero: all switches are linear in the rate."""
    switch = lambda rate: law.switches(jnp.asarray(depth), rate)[0]
    value, slope = jax.value_and_grad(switch)(jnp.asarray(0.0))
    return float(-value / slope)


@pytest.mark.parametrize("law", DAMPED, ids=name)
def test_switches_are_where_the_reaction_reaches_zero(law):
    for depth in (1e-6, 3e-4):
        rate = _lift_off(law, depth)
        at = lambda part, depth=depth, rate=rate: float(
            law.force(jnp.asarray(depth), jnp.asarray(part * rate))
        )
        assert rate < 0.0
        assert at(1.0 + 1e-9) == 0.0
        assert 0.0 < at(1.0 - 1e-9) < 1e-8 * at(0.0)
    assert jb.laws.Hertz(K=1.0).switches(jnp.asarray(1e-3), jnp.asarray(0.0)) == ()


@pytest.mark.parametrize("law", [*LAWS, SMOOTH], ids=name)
def test_elastic_energy_is_the_integral_of_elastic_force(law):
    depth = jnp.array([-1e-4, 0.0, 1e-7, 3e-6, 1e-5, 1e-4, 7e-4])
    slope = jax.vmap(jax.grad(law.elastic_energy))(depth)
    np.testing.assert_allclose(slope, law.elastic_force(depth), rtol=1e-12, atol=1e-15)
    assert float(law.elastic_energy(jnp.asarray(0.0))) == 0.0


@pytest.mark.parametrize("law", [*LAWS, SMOOTH], ids=name)
def test_gradients_equal_differences(law):
    """At random, out of contact, and on both sides of touchdown and of the lift-off."""
    draw, function = np.random.default_rng(3), Force(law)
    x = function.at(10.0 ** draw.uniform(-6, -2, 60), draw.uniform(-1.0, 1.0, 60))
    x[::10, -2] *= -1.0
    scales = np.abs(x)
    size = np.abs(np.asarray(function.force(jnp.asarray(x))))[:, None] + 1e-9
    np.testing.assert_allclose(
        function.exact(x, scales) / size, function.difference(x, scales) / size, 1e-6, 1e-6
    )
    beside = [(1e-9, 0.1), (-1e-9, 0.1)]
    if law in DAMPED:
        lift = _lift_off(law, 3e-4)
        beside += [(3e-4, lift * (1 - 1e-6)), (3e-4, lift * (1 + 1e-6))]
    for at in beside:
        x = function.at(*at)
        exact, one_sided = function.beside(x, np.abs(x))
        np.testing.assert_allclose(exact, one_sided, 1e-6, 1e-9)


@pytest.mark.parametrize("law", [*LAWS, SMOOTH], ids=name)
def test_derivatives_are_finite_at_the_switches(law):
    function = Force(law)
    points = [(0.0, r) for r in (-0.3, 0.0, 0.3)] + [(1e-300, 0.0), (-1e-3, 0.3)]
    if law in DAMPED:
        points.append((3e-4, _lift_off(law, 3e-4)))
    x = function.at(*np.transpose(points))
    assert np.isfinite(function.exact(x, 1.0)).all()
    assert (function.exact(x, 1.0)[:3] == 0.0).all()
    second = jax.jit(jax.vmap(jax.hessian(lambda v: law.force(v[0], v[1]))))
    assert np.isfinite(second(jnp.array(points[:3] + points[4:]))).all()


def _from_weight(kind, ratio, n, **standing):
    damping = {} if kind == "Hertz" else {"damping_ratio": ratio}
    exponent = {"n": n} if kind in OWN_EXPONENT else {}
    return getattr(jb.laws, kind).from_weight(**standing, **damping, **exponent)


@pytest.mark.parametrize("kind", [kind for kind in SOME if kind != "SmoothRistowSchafer"])
def test_from_weight_realises_penetration_and_damping_ratio(kind):
    @settings(deadline=None, max_examples=15)
    @given(
        numbers(0.1, 100.0), numbers(1e-6, 1e-2), numbers(0.0, 30.0), numbers(1.0, 2.0), st.data()
    )
    def check(mass, depth, ratio, n, data):
        g = data.draw(st.sampled_from([9.8, 1.62]))
        law = _from_weight(kind, ratio, n, mass=mass, penetration=depth, g=g)
        weight, stiffness, damper = (float(x) for x in linear(law, depth))
        assert weight == pytest.approx(mass * g, rel=1e-9)
        wanted = 0.0 if kind == "Hertz" else ratio
        assert damper / (2 * np.sqrt(stiffness * mass)) == pytest.approx(wanted, rel=1e-9)

    @eqx.filter_jit
    def linear(law, depth):
        at, one, zero = (jnp.asarray(depth), jnp.asarray(0.0)), jnp.asarray(1.0), jnp.asarray(0.0)
        weight, stiffness = jax.jvp(law.force, at, (one, zero))
        return weight, stiffness, jax.jvp(law.force, at, (zero, one))[1]

    check()


def test_from_weight_is_differentiable_and_takes_batches():
    masses = jnp.array([1.0, 2.0])
    law = jb.laws.Tsuji.from_weight(mass=masses, penetration=1e-3, damping_ratio=0.5)
    assert law.K.shape == law.gamma.shape == (2,)
    stiffness = lambda m: jb.laws.Hertz.from_weight(mass=m, penetration=1e-3).K
    assert float(jax.jit(jax.grad(stiffness))(2.0)) == pytest.approx(9.8 / 1e-3**1.5)


STEEL = {"modulus": 210e9, "poisson": 0.3}


def test_hertz_stiffness_of_known_pairs():
    steel = jb.laws.hertz_stiffness(radius=0.08, **STEEL, ground_modulus=210e9, ground_poisson=0.3)
    np.testing.assert_allclose(steel, 2 / 3 * 210e9 * np.sqrt(0.08) / 0.91, rtol=1e-12)
    rigid = jb.laws.hertz_stiffness(radius=0.08, **STEEL, ground_modulus=1e30, ground_poisson=0.0)
    np.testing.assert_allclose(rigid, 2 * steel, rtol=1e-12)
