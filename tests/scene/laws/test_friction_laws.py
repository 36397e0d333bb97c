"""Laws of friction, against formulas written a second time, and differences."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb
from tests.scene.laws.derivatives import Force
from tests.scene.laws.formulas import friction_shares


def numbers(low, high):
    # XLA takes subnormal numbers for zero.
    return st.floats(low, high, allow_subnormal=False)


MU, SPEED = numbers(0.0, 2.0), numbers(1e-6, 1.0)
CURVE = {"mu_static": MU, "mu_kinetic": MU, "v_s": SPEED, "p": numbers(0.3, 3.0)}


@st.composite
def _ambrosio(draw):
    v0 = draw(SPEED)
    return jb.laws.Ambrosio(mu=draw(MU), v0=v0, v1=v0 * draw(numbers(1.01, 10.0)))


@st.composite
def _brown_mcphee(draw):
    low, high = sorted((draw(MU), draw(MU)))
    viscous = {"mu_v": draw(numbers(0.0, 10.0)), "N_t": draw(numbers(0.1, 50.0))}
    options = viscous if draw(st.booleans()) else {}
    return jb.laws.BrownMcPhee(mu_static=high, mu_dynamic=low, v_t=draw(SPEED), **options)


PEAKED = {"mu_static": MU, "mu_kinetic": MU, "v0": SPEED, "xi": numbers(0.0, 1e4)}
SOME = {
    "Frictionless": st.just(jb.laws.Frictionless()),
    "BengisuAkay": st.builds(jb.laws.BengisuAkay, **PEAKED),
    "SmoothBengisuAkay": st.builds(jb.laws.SmoothBengisuAkay, **PEAKED),
    "RegularisedCoulomb": st.builds(jb.laws.RegularisedCoulomb, mu=MU, v_d=SPEED),
    "Viscous": st.builds(jb.laws.Viscous, k=numbers(0.0, 1e4)),
    "Threlfall": st.builds(jb.laws.Threlfall, mu=MU, v0=SPEED),
    "Ambrosio": _ambrosio(),
    "Stribeck": st.builds(jb.laws.Stribeck, **CURVE, k_v=numbers(0.0, 10.0), v_d=SPEED),
    "Andersson": st.builds(jb.laws.Andersson, **CURVE, k=numbers(1.0, 1e5)),
    "BrownMcPhee": _brown_mcphee(),
}
STRIBECK = dict(mu_static=0.5, mu_kinetic=0.4, v_s=1e-3)
SHARP = jb.laws.Stribeck(**STRIBECK, p=0.5, k_v=0.1, v_d=1e-4)
CORNERED = jb.laws.Andersson(**STRIBECK, p=1.0, k=1e4)
SEED = dict(mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1000.0)
LAWS = {
    "bengisu-akay": jb.laws.BengisuAkay(**SEED),
    "smooth-bengisu-akay": jb.laws.SmoothBengisuAkay(**SEED),
    "coulomb": jb.laws.RegularisedCoulomb(mu=0.4, v_d=1e-4),
    "viscous": jb.laws.Viscous(k=3.0),
    "threlfall": jb.laws.Threlfall(mu=0.4, v0=1e-3),
    "ambrosio": jb.laws.Ambrosio(mu=0.4, v0=1e-4, v1=1e-3),
    "stribeck": jb.laws.Stribeck(**STRIBECK, p=2.0, k_v=0.1, v_d=1e-4),
    "stribeck, p = 0.5": SHARP,
    "andersson": jb.laws.Andersson(**STRIBECK, p=1.5, k=1e4),
    "andersson, p = 1": CORNERED,
    "brown-mcphee": jb.laws.BrownMcPhee(mu_static=0.5, mu_dynamic=0.4, v_t=1e-3),
    "brown-mcphee, viscous": jb.laws.BrownMcPhee(
        mu_static=0.5, mu_dynamic=0.4, v_t=1e-3, mu_v=0.7, N_t=15.0
    ),
}
SWITCHES = {
    "bengisu-akay": (-1e-4, 0.0, 1e-4),
    "threlfall": (-1e-3, 0.0, 1e-3),
    "ambrosio": (-1e-3, -1e-4, 1e-4, 1e-3),
    "stribeck, p = 0.5": (0.0,),
    "andersson, p = 1": (0.0,),
}
every_law = pytest.mark.parametrize("which", LAWS)
force = eqx.filter_jit(lambda law, load, slip: law.force(load, slip))


def pulled(law, slip, load=10.0):
    """Friction over load along the slip, at many speeds."""
    slip = jnp.asarray(slip, float)
    return -np.asarray(law.force(jnp.full_like(slip, load), slip)) / load


@pytest.mark.parametrize("kind", SOME)
def test_forces_are_the_formulas_oppose_slip_and_are_odd(kind):
    size = np.concatenate([[0.0], np.geomspace(1e-8, 5.0, 40)])
    load, slip = np.meshgrid([1e-2, 10.0, 1e3], size)

    @settings(deadline=None, max_examples=30)
    @given(SOME[kind])
    def check(law):
        found = np.asarray(force(law, load, slip))
        expected = -load * friction_shares(law, load, slip)[0]
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12)
        assert (found * slip <= 0.0).all()
        np.testing.assert_array_equal(force(law, load, -slip), -found)
        assert not np.any(force(law, load, 0.0 * slip))
        assert not np.any(force(law, 0.0 * load, slip))

    check()


@every_law
def test_forces_are_continuous_across_every_switch(which):
    for v in (*SWITCHES.get(which, ()), 0.0):
        side = 1e-9 * abs(v) if v else 1e-13
        below, above = pulled(LAWS[which], [v - side, v + side])
        assert abs(above - below) < 1e-7


@every_law
def test_switches_are_where_a_derivative_jumps_and_nowhere_else(which):
    law, told = LAWS[which], SWITCHES.get(which, ())
    slip = np.unique([*np.linspace(-3e-3, 3e-3, 2001), *told])
    zeros = {v for f in law.switches(jnp.asarray(slip)) for v in slip[np.asarray(f) == 0.0]}
    assert zeros == set(told)
    places = (-1e-3, -1e-4, 0.0, 1e-4, 1e-3)
    assert [v for v, jump in zip(places, _jumps(law, places), strict=True) if jump > 0.03] == [
        *told
    ]


def _jumps(law, places, nearby=3e-3):
    """The largest jump of force, first and second derivative, relative to their size nearby."""
    force = lambda slip: law.force(jnp.asarray(1.0), slip)
    second = jax.grad(jax.grad(force))
    derivatives = jax.jit(jax.vmap(lambda v: (force(v), jax.grad(force)(v), second(v))))
    v = jnp.array(places)
    side = jnp.where(v == 0.0, 1e-10, 1e-6 * jnp.abs(v))
    found = derivatives(jnp.concatenate([v - side, v + side, jnp.linspace(-nearby, nearby, 60)]))
    jumps = [
        abs(d[: v.size] - d[v.size : 2 * v.size]) / (1e-9 + abs(d[2 * v.size :]).max())
        for d in found
    ]
    return np.max(jumps, axis=0)


@every_law
def test_gradients_equal_differences(which):
    """At random, on the switches (between the sides), beside them and at rest."""
    law, draw = LAWS[which], np.random.default_rng(5)
    function = Force(law)
    x = function.at(
        draw.uniform(0.1, 40.0, 80), draw.choice([-1, 1], 80) * 10.0 ** draw.uniform(-6, 0, 80)
    )
    scales, size = np.abs(x), x[:, -2:-1]
    np.testing.assert_allclose(
        function.exact(x, scales) / size, function.difference(x, scales) / size, 1e-6, 1e-8
    )
    told = np.array(SWITCHES.get(which, ()))
    x = function.at(10.0, np.concatenate([told * (1 + 1e-6), told * (1 - 1e-6), [1e-9, -1e-9]]))
    exact, one_sided = function.beside(x, np.abs(x))
    np.testing.assert_allclose(exact, one_sided, 1e-6, 1e-7)
    x = function.at(10.0, np.append(told, 0.0))
    scales = np.abs(x)
    scales[:, -1] = 1e-5
    exact, least, greatest = function.within_sides(x, scales)
    assert np.isfinite(exact).all()
    slack = 1e-6 + 2e-3 * np.abs(exact)
    assert (least - slack <= exact).all()
    assert (exact <= greatest + slack).all()


def test_the_slope_at_rest_is_that_of_the_tanh():
    def derivatives(p):
        law = jb.laws.Stribeck(**STRIBECK, p=p, k_v=0.2, v_d=1e-4)
        slope = jax.grad(lambda v: law.force(jnp.asarray(1.0), v))
        return jax.value_and_grad(slope)(jnp.asarray(0.0))

    slope, second = jax.jit(jax.vmap(derivatives))(jnp.array([0.3, 0.5, 1.0, 1.5, 2.0]))
    np.testing.assert_allclose(slope, -(0.5 / 1e-4 + 0.2))
    assert bool(jnp.isfinite(second).all())


def test_brown_and_mcphee_without_a_viscous_part_leave_it_out():
    program = lambda law: str(jax.make_jaxpr(law.force)(1.0, 1.0))
    assert program(LAWS["brown-mcphee"]).count("= tanh ") == 1
    assert program(LAWS["brown-mcphee, viscous"]).count("= tanh ") == 2
