"""The clock on compliant feet, which strikes restart, against SciPy and differences."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxbiped as jb

A = jb.actuation
PLAIN = jb.seed_scene(slope=0.015)
LAW = A.TimePolynomial((0.006, -0.004, -0.002), 0.4)
SCENE = dataclasses.replace(PLAIN, actuation=LAW)
START = SCENE.state_type(*jb.seed_state(), 0.1, 0.0)
GAIT = SCENE.state_type(
    *(0.0, 0.39935339995, 0.09767661109, 0.0, 0.24113561538, -0.00051967769, 2.15129987239),
    *(-0.6028396713, 0.24721395049, 0.0),
)
"""At mid-stance, to 1e-9."""


def final(walk):
    return np.array([leaf[-1] for leaf in walk.state])


@pytest.mark.slow
def test_a_walk_is_scipys():
    """From strike to strike: the other foot comes down ahead while its leg turns back."""
    kind, t, y, struck = type(START), 0.0, np.array([*START[:8]]), 2

    @jax.jit
    def rates(y, clock):
        return jnp.stack(jb.dynamics.vector_field(0.0, kind(*y, clock, 0.0), SCENE)[:8])

    @jax.jit
    def reach(y):
        return jnp.stack([foot.penetration for foot in jb.dynamics.feet(SCENE, kind(*y, 0.0, 0.0))])

    begun, strikes = 0.1, []
    while t < 0.95:

        def lands(t, y, other=2 - struck):
            admitted = y[2 + other] > y[3 - other] and y[6 + other] < 0.0
            return float(reach(y)[other]) if admitted else -1.0

        lands.direction, lands.terminal = 1, True
        piece = solve_ivp(
            lambda s, y, at=t, clock=begun: rates(y, clock + s - at), (t, 0.95), y, "Radau",
            events=lands, rtol=1e-9, atol=1e-11,
        )  # fmt: skip
        t, y = piece.t[-1], piece.y[:, -1]
        if piece.status == 1:
            begun, struck = 0.0, 3 - struck
            strikes.append(t)
    walk = jb.simulate(SCENE, START, duration=0.95, accuracy="tight", save="end")
    np.testing.assert_allclose(final(walk)[:8], y, atol=3e-6)
    assert len(strikes) == 2
    assert float(walk.state.clock[-1]) == pytest.approx(0.95 - strikes[-1], abs=1e-7)
    assert float(walk.state.strike_leg[-1]) == 0.0


@pytest.mark.slow
def test_both_engines_and_both_names_walk_alike():
    lanes = jb.simulate(SCENE, START, duration=0.8)
    xla = jb.simulate(SCENE, START, duration=0.8, engine="xla")
    np.testing.assert_allclose(final(xla), final(lanes), atol=1e-9)
    renamed = jb.dynamics.exchange_legs(SCENE, START)
    assert float(renamed.strike_leg) == 1.0
    other = jb.simulate(SCENE, renamed._replace(strike_leg=jnp.asarray(0.0)), duration=0.8)
    back = jb.dynamics.exchange_legs(SCENE, type(START)(*final(other)))
    np.testing.assert_allclose(np.stack(back), final(lanes), atol=1e-7)


@pytest.mark.slow
def test_a_foot_that_bounces_strikes_once():
    hard = jb.laws.HuntCrossley(K=1e6, hysteresis=0.2, n=1.5)
    scene = dataclasses.replace(jb.seed_scene(), normal=hard, actuation=A.TimePolynomial(3e-3, 0.4))
    walk = jb.simulate(scene, jb.seed_state(), footsteps=4)
    touching = np.stack([foot.penetration > 0.0 for foot in jb.dynamics.feet(scene, walk.state)])
    assert np.sum(~touching[:, :-1] & touching[:, 1:]) > 10
    restarts = np.diff(walk.state.clock) < 0.0
    assert restarts.sum() == 4
    np.testing.assert_array_equal(restarts, np.diff(walk.state.strike_leg) != 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("section", [None, jb.HeelStrike()], ids=["mid-stance", "strike"])
def test_a_law_that_stays_the_same_adds_multipliers_of_zero(section):
    laws = A.HipTorque(0.003), A.TimePolynomial(0.003, 0.4)
    plain, clocked = (
        jb.find_gait(
            dataclasses.replace(PLAIN, actuation=law), jb.seed_state(), section=section,
            parameters=(), radius_sensitivities=False,
        )
        for law in laws
    )  # fmt: skip
    np.testing.assert_allclose(clocked.measures.state[:8], plain.measures.state, atol=1e-6)
    np.testing.assert_allclose(clocked.multipliers[:4], plain.multipliers[:4], atol=2e-5)
    assert np.max(np.abs(clocked.multipliers[4:])) < 1e-10
    assert float(clocked.measures.state.strike_leg) == 0.0
    begins = 0.0 if section else 0.247608
    assert float(clocked.measures.state.clock) == pytest.approx(begins, abs=1e-5)


@pytest.mark.slow
def test_derivatives_of_a_return_are_difference_quotients():
    centre = jnp.asarray([*GAIT[:9], *LAW.torque, LAW.span])

    def returned(numbers):
        law = A.TimePolynomial(tuple(numbers[9:12]), numbers[12])
        state = SCENE.state_type(*numbers[:9], jnp.zeros(()))
        scene = dataclasses.replace(SCENE, actuation=law)
        found = jb.return_map(scene, state, accuracy="tight")
        return jnp.stack([*found.state, found.time])

    slopes = np.array(jax.jacfwd(returned)(centre))
    assert not np.any(slopes[9])
    for place, step in ((2, 1e-4), (7, 3e-4), (8, 1e-3), (9, 1e-4), (10, 1e-4), (12, 1e-3)):
        moved = step * jnp.eye(13)[place]
        quotient = (returned(centre + moved) - returned(centre - moved)) / (2.0 * step)
        np.testing.assert_allclose(slopes[:, place], quotient, rtol=2e-4, atol=2e-5)


@pytest.mark.slow
def test_derivatives_of_a_walk_are_difference_quotients():
    def walked(numbers):
        law = A.TimePolynomial((numbers[0], *LAW.torque[1:]), LAW.span)
        scene = dataclasses.replace(SCENE, actuation=law)
        start = START._replace(clock=numbers[1])
        walk = jb.simulate(scene, start, duration=0.6, rtol=1e-10, save="end")
        return jnp.stack([leaf[-1] for leaf in walk.state])

    centre = jnp.asarray([0.006, 0.1])
    slopes = jax.jacfwd(walked)(centre)
    for place, step in ((0, 1e-5), (1, 1e-4)):
        moved = step * jnp.eye(2)[place]
        quotient = (walked(centre + moved) - walked(centre - moved)) / (2.0 * step)
        np.testing.assert_allclose(slopes[:, place], quotient, rtol=2e-4, atol=2e-4)


def test_a_start_of_the_plain_walker_is_one():
    bare = jb.simulate(SCENE, jb.seed_state(), duration=0.3, save="end")
    whole = SCENE.state_type(*jb.seed_state(), 0.0, 0.0)
    np.testing.assert_array_equal(
        final(bare), final(jb.simulate(SCENE, whole, duration=0.3, save="end"))
    )
    assert float(bare.state.clock[-1]) == pytest.approx(0.3, abs=1e-12)
    with pytest.raises(jb.ArgumentError, match="adjoint"):
        jb.simulate(SCENE, START, duration=0.3, adjoint=object())
