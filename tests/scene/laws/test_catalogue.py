"""The laws by name, against the seed's law that each resembles."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.compiler.one_shot import evaluate

NORMAL = dict(K=1e6, c=1e7, n=1.5, mass=2.0)
FRICTION = dict(mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1000.0)
BRISTLES = ("dahl", "lugre")
EXACT = ("ristow-schafer", "smooth-ristow-schafer")
ONE = jnp.asarray(1.0)
_FRICTION = (jb.laws.AbstractFrictionLaw, jb.laws.AbstractBristleLaw)


@pytest.mark.parametrize("name", jb.laws.NORMAL_LAWS)
def test_normal_laws_stand_like_the_seeds(name):
    law = jb.laws.normal_law_like(name, **NORMAL)
    assert type(law) is jb.laws.NORMAL_LAWS[name]
    at = (jnp.asarray((2.0 * 9.8 / 1e6) ** (2 / 3)), jnp.asarray(0.0))
    weight, (stiffness, damper) = jax.value_and_grad(lambda x: law.force(*x))(at)
    assert float(weight) == pytest.approx(19.6, rel=1e-9)
    ratio = float(damper) / (2 * np.sqrt(2.0 * float(stiffness)))
    seed_ratio = 1e7 * float(at[0]) / (2 * np.sqrt(2.0 * 1.5 * 19.6 / float(at[0])))
    assert ratio == pytest.approx(0.0 if name == "hertz" else seed_ratio, rel=1e-9)


@pytest.mark.parametrize("name", EXACT)
def test_the_seeds_own_normal_laws_keep_their_parameters(name):
    law = jb.laws.normal_law_like(name, K=2e6, c=3e6, n=1.7, mass=1.0)
    assert (float(law.K), float(law.c), float(law.n)) == (2e6, 3e6, 1.7)


@pytest.mark.parametrize("name", ["hertz", "hunt-crossley"])
def test_the_exponent_is_kept_where_there_is_one(name):
    assert float(jb.laws.normal_law_like(name, **NORMAL | {"n": 1.8}).n) == pytest.approx(1.8)


@pytest.mark.parametrize("name", [name for name in jb.laws.FRICTION_LAWS if name not in BRISTLES])
def test_friction_laws_resemble_the_seeds(name):
    law = jb.laws.friction_law_like(name, **FRICTION)
    assert type(law) is jb.laws.FRICTION_LAWS[name]
    at = lambda v: -float(law.force(ONE, jnp.asarray(v)))
    if name == "frictionless":
        assert at(1e-4) == 0.0
        return
    assert 0.37 < at(1e-4) <= 0.5 + 1e-12
    if name != "viscous":
        assert at(1.0) == pytest.approx(0.4 if name != "threlfall" else 0.38, rel=2e-3)
    rise = -float(jax.grad(law.force, 1)(ONE, jnp.asarray(6e-5)))
    assert 1e3 < rise < 2 * 0.5 / 1e-4
    if hasattr(law, "mu_static"):
        slip = np.geomspace(1e-6, 1e-1, 2001)
        size = -law.force(jnp.ones(2001), jnp.asarray(slip))
        assert 0.8e-4 < slip[np.argmax(size)] < 2e-4
        assert 0.48 < float(size.max()) <= 0.5 + 1e-12


@pytest.mark.parametrize("name", ["coulomb", "stribeck", "bengisu-akay", "andersson"])
def test_friction_laws_with_the_seeds_slope_at_rest(name):
    law = jb.laws.friction_law_like(name, **FRICTION)
    mu = 0.4 if name == "coulomb" else 0.5
    assert -float(jax.grad(law.force, 1)(ONE, jnp.asarray(0.0))) == pytest.approx(2 * mu / 1e-4)


@pytest.mark.parametrize(("name", "peak", "give"), [("dahl", 0.4, 4e-4), ("lugre", 0.5, 1e-5)])
def test_bristle_laws_resemble_the_seeds(name, peak, give):
    law = jb.laws.friction_law_like(name, **FRICTION)
    assert type(law) is jb.laws.FRICTION_LAWS[name]

    def steady(slip):
        slip = jnp.asarray(slip)
        # The rate is linear in the bristle: this is where it vanishes.
        free = law.rate(slip, 0.0 * ONE)
        return float(law.coefficient(slip, free / (free - law.rate(slip, ONE))))

    assert steady(1e-6) == pytest.approx(peak, rel=1e-4)
    assert steady(1.0) == -steady(-1.0) == pytest.approx(0.4, rel=1e-9)
    stiffness = float(jax.grad(law.rate)(jnp.asarray(1e-9), 0.0 * ONE))
    assert peak / stiffness == pytest.approx(give, rel=1e-9)
    if name == "lugre":
        assert steady(1e-3) == pytest.approx(0.4 + 0.1 / np.e, rel=1e-9)
        # 1 kg on bristles under 20 N comes to rest without swinging.
        assert 20.0 * float(law.sigma_1) == pytest.approx(2.0 * np.sqrt(20.0 * stiffness))


def test_they_are_differentiable_in_the_seeds_parameters():
    def force(K):
        law = jb.laws.normal_law_like("tsuji", **NORMAL | {"K": K})
        return law.force(jnp.asarray(5e-4), jnp.asarray(0.1))

    difference = (force(1e6 + 1.0) - force(1e6 - 1.0)) / 2.0
    np.testing.assert_allclose(jax.jit(jax.grad(force))(1e6), difference, rtol=1e-6)


def _walk(normal, friction):
    scene = eqx.tree_at(
        lambda s: (s.normal, s.friction),
        jb.seed_scene(),
        (
            jb.laws.normal_law_like(normal, **NORMAL),
            jb.laws.friction_law_like(friction, **FRICTION),
        ),
    )
    return jb.simulate(scene, jb.seed_state(), duration=0.05, save="end", engine="lanes")


# A compilation each: so two laws at a time. Before the night, forces that jump and bristles alone
# walk, for the forces of all laws by lanes are those by XLA.
PAIRS = [
    pytest.param(
        list(jb.laws.NORMAL_LAWS)[k % len(jb.laws.NORMAL_LAWS)],
        friction,
        marks=[] if friction in ("andersson", "dahl") else pytest.mark.nightly,
    )
    for k, friction in enumerate(jb.laws.FRICTION_LAWS)
]
DEPTHS, RATES = np.geomspace(1e-7, 1e-3, 32), np.linspace(-0.5, 0.5, 32)
SLIPS = np.concatenate([-np.geomspace(1e-7, 1.0, 16), np.geomspace(1e-7, 1.0, 16)])


@pytest.mark.parametrize("name", jb.laws.NORMAL_LAWS)
def test_normal_forces_by_lanes_are_those_by_xla(name):
    law = jb.laws.normal_law_like(name, **NORMAL)
    found, expected = evaluate(law.force, DEPTHS, RATES), jax.vmap(law.force)(DEPTHS, RATES)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize("name", jb.laws.FRICTION_LAWS)
def test_friction_by_lanes_is_that_by_xla(name):
    law = jb.laws.friction_law_like(name, **FRICTION)
    functions = (law.rate, law.coefficient) if name in BRISTLES else (law.force,)
    bristles = np.linspace(-1e-5, 1e-5, 32)
    for function in functions:
        given = (SLIPS, bristles) if name in BRISTLES else (10.0 + RATES, SLIPS)
        expected = jax.vmap(function)(*given)
        np.testing.assert_allclose(evaluate(function, *given), expected, rtol=1e-11, atol=1e-300)


@pytest.mark.parametrize(("normal", "friction"), PAIRS)
def test_all_laws_run_by_lanes(normal, friction):
    walk = _walk(normal, friction)
    if friction == "frictionless":
        assert str(walk.outcome) == "stopped"
        return
    assert str(walk.outcome) == "walking"
    # As the seed's laws, by the independent equations; Dahl's bristles give.
    near = 1e-4 if friction == "dahl" else 3e-5
    assert float(walk.final.hip_x) == pytest.approx(0.02197, abs=near)
    assert float(walk.final.theta_1) == pytest.approx(-0.21805, abs=3e-4)


def test_every_public_law_is_in_the_catalogue_under_its_own_name_in_the_order_of_the_lines():
    public = [each for each in vars(jb.laws).values() if isinstance(each, type)]
    for laws, kinds in (
        (jb.laws.NORMAL_LAWS, jb.laws.AbstractNormalLaw),
        (jb.laws.FRICTION_LAWS, _FRICTION),
    ):
        final = [law for law in public if issubclass(law, kinds) and "Abstract" not in law.__name__]
        assert [law for law in laws.values() if law.__module__.startswith("jaxbiped.")] == final
        assert all(law.name == name for name, law in laws.items())
