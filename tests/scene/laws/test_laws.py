"""Laws of contact against closed forms, their stated properties, and their derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb

K, C = 1e6, 1e7
SEED_NORMAL = jb.laws.RistowSchafer(K=K, c=C)
SMOOTH_NORMAL = jb.laws.SmoothRistowSchafer(K=K, c=C)
FRICTION = dict(mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1000.0)
SEED_FRICTION = jb.laws.BengisuAkay(**FRICTION)
SMOOTH_FRICTION = jb.laws.SmoothBengisuAkay(**FRICTION)
NORMALS = [SEED_NORMAL, SMOOTH_NORMAL, jb.laws.Hertz(K=K)]
FRICTIONS = [
    SEED_FRICTION,
    SMOOTH_FRICTION,
    jb.laws.RegularisedCoulomb(mu=0.4, v_d=1e-4),
    jb.laws.Frictionless(),
]
name = lambda law: type(law).__name__


@pytest.mark.parametrize("law", NORMALS, ids=name)
def test_normal_laws_never_pull_and_vanish_out_of_contact(law):
    depth, rate = jnp.meshgrid(jnp.linspace(-1e-3, 1e-3, 41), jnp.linspace(-2.0, 2.0, 41))
    force = law.force(depth, rate)
    assert bool(jnp.all(force >= 0.0))
    assert bool(jnp.all(force[depth <= 0.0] == 0.0))


@pytest.mark.parametrize("law", FRICTIONS, ids=name)
def test_friction_opposes_slip_is_odd_and_zero_at_rest(law):
    slip = jnp.concatenate([jnp.linspace(-1e-3, 1e-3, 201), jnp.array([-2.0, 2.0])])
    force = law.force(jnp.full_like(slip, 10.0), slip)
    assert bool(jnp.all(force * slip <= 0.0))
    mirrored = law.force(jnp.full_like(slip, 10.0), -slip)
    np.testing.assert_allclose(force, -mirrored, atol=1e-14)
    assert float(law.force(jnp.asarray(10.0), jnp.asarray(0.0))) == 0.0


def test_stribeck_peak_and_limits():
    for law in (SEED_FRICTION, SMOOTH_FRICTION):
        force = lambda v, law=law: float(-law.force(jnp.asarray(10.0), jnp.asarray(v)))
        assert force(1e-4) == pytest.approx(5.0)
        assert force(1.0) == pytest.approx(4.0, rel=1e-9)
        assert max(force(v) for v in np.linspace(0, 1e-2, 1001)) <= 5.0 + 1e-12
    slope = -jax.grad(SEED_FRICTION.force, 1)(jnp.asarray(10.0), jnp.asarray(0.0))
    assert float(slope) == pytest.approx(2 * 5.0 / 1e-4)


def test_smooth_laws_are_the_originals_away_from_their_corners():
    slip = jnp.array([2.01e-4, 5e-4, 1e-2])
    ten = jnp.full_like(slip, 10.0)
    np.testing.assert_allclose(SMOOTH_FRICTION.force(ten, slip), SEED_FRICTION.force(ten, slip))
    depth, rate = jnp.array([1.1e-5, 5e-4]), jnp.array([0.3, 0.0])
    np.testing.assert_allclose(SMOOTH_NORMAL.force(depth, rate), SEED_NORMAL.force(depth, rate))


def _jump(function, at, order):
    """Difference of a derivative's limits from the two sides, relative to its size nearby."""
    for _ in range(order):
        function = jax.grad(function)
    side = 1e-7 * abs(at) if at else 1e-12
    below, above = function(jnp.asarray(at - side)), function(jnp.asarray(at + side))
    # At all points at once: second derivatives take long, one by one.
    scale = float(jnp.max(jnp.abs(jax.vmap(function)(at + jnp.linspace(-1e-4, 1e-4, 41)))))
    return abs(float(above - below)) / scale


@pytest.mark.parametrize("at", [-1e-4, 0.0, 1e-4, 2e-4])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_smooth_friction_is_twice_differentiable(at, order):
    assert _jump(lambda v: SMOOTH_FRICTION.force(jnp.asarray(10.0), v), at, order) < 1e-5


@pytest.mark.parametrize("order", [0, 1, 2])
def test_smooth_normal_law_is_twice_differentiable(order):
    for rate, at in ((0.3, 0.0), (0.3, 1e-5), (0.0, 1e-5), (-2.64e-3, 7e-4)):
        fixed = jnp.asarray(rate)
        assert _jump(lambda d, fixed=fixed: SMOOTH_NORMAL.force(d, fixed), at, order) < 1e-3


def test_the_seed_laws_do_have_corners():
    """The check above can see a corner."""
    assert _jump(lambda v: SEED_FRICTION.force(jnp.asarray(10.0), v), 1e-4, 1) > 1e-2
    assert _jump(lambda d: SEED_NORMAL.force(d, jnp.asarray(0.3)), 0.0, 1) > 0.5


@pytest.mark.parametrize("law", NORMALS, ids=name)
@pytest.mark.parametrize("depth", [-1e-4, 5e-6, 2e-4])
def test_gradients_equal_central_differences(law, depth):
    """In the arguments and in every parameter; finite at and below touchdown."""

    def force(law, depth, rate):
        return law.force(depth, rate)

    at = (law, jnp.asarray(depth), jnp.asarray(0.1))
    gradient = jax.tree_util.tree_leaves(jax.grad(force, argnums=(0, 1, 2))(*at))
    leaves, structure = jax.tree_util.tree_flatten(at)
    for i, exact in enumerate(gradient):
        h = 1e-6 * max(abs(float(leaves[i])), 1e-3)

        def shifted(by, i=i):
            moved = [leaf + by if j == i else leaf for j, leaf in enumerate(leaves)]
            return float(force(*jax.tree_util.tree_unflatten(structure, moved)))

        difference = (shifted(h) - shifted(-h)) / (2 * h)
        np.testing.assert_allclose(float(exact), difference, rtol=2e-5, atol=1e-8)


def test_gradients_are_finite_at_the_switches():
    zero = jnp.asarray(0.0)
    for law in NORMALS:
        leaves = jax.tree_util.tree_leaves(jax.grad(lambda x, r: x.force(r, r))(law, zero))
        assert all(bool(jnp.isfinite(leaf)) for leaf in leaves)
    for law in (SEED_FRICTION, SMOOTH_FRICTION):
        for v in (0.0, 1e-4):
            gradient = jax.grad(lambda x, v: x.force(jnp.asarray(1.0), v), (0, 1))(
                law, jnp.asarray(v)
            )
            leaves = jax.tree_util.tree_leaves(gradient)
            assert all(bool(jnp.isfinite(leaf)) for leaf in leaves)
