"""The same gait from both engines, against each other."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.unknown_to_lanes import ErrorFunction

pytestmark = pytest.mark.slow


@pytest.mark.nightly
@pytest.mark.parametrize(
    "scene",
    [
        pytest.param(jb.ladder()["rigid"], id="rigid"),
        pytest.param(jb.seed_scene(), id="seed"),
    ],
)
def test_both_find_the_same_gait_and_the_same_derivatives(scene):
    """The seed's takes XLA more than a minute to compile."""
    ours, theirs = (jb.find_gait(scene, engine=engine) for engine in ("lanes", "xla"))
    assert (ours.engine, theirs.engine) == ("lanes", "xla")
    assert ours.outcome == theirs.outcome == jb.gait.Search.FOUND
    for name in ("period", "step_length", "speed", "peak_normal", "spectral_radius"):
        a, b = (float(getattr(gait.measures, name)) for gait in (ours, theirs))
        assert a == pytest.approx(b, rel=5e-5)
    assert float(ours.unit_multiplier_error) < 1e-4
    np.testing.assert_allclose(ours.multipliers[:4], theirs.multipliers[:4], atol=5e-5)
    for name in ("period", "step_length", "speed", "peak_normal"):
        a, b = (np.array(getattr(gait.elasticities, name)) for gait in (ours, theirs))
        np.testing.assert_allclose(a, b, rtol=5e-4, atol=1e-8)
    a, b = (np.array(gait.elasticities.spectral_radius) for gait in (ours, theirs))
    np.testing.assert_allclose(a, b, rtol=5e-4, atol=1e-7)


@pytest.mark.parametrize(
    ("scene", "names", "accuracy", "rtol"),
    [
        pytest.param(
            jb.seed_scene(), ("K", "slope"), "tight", 2e-5, id="seed", marks=pytest.mark.nightly
        ),
        # An impact is no symmetry of the motion.
        pytest.param(jb.ladder()["rigid"], ("d", "J", "slope"), "balanced", 1e-7, id="rigid"),
    ],
)
def test_the_radius_of_a_cycle_of_two_is_that_of_one_squared(scene, names, accuracy, rtol):
    """Its derivatives, too."""
    once, twice = (
        jb.find_gait(scene, footsteps=n, parameters=names, accuracy=accuracy) for n in (1, 2)
    )
    expected = 2.0 * once.elasticities.spectral_radius
    np.testing.assert_allclose(twice.elasticities.spectral_radius, expected, rtol=rtol)


@pytest.mark.nightly
def test_many_scenes_at_once_give_what_each_gives_alone(seed_gait):
    """A large batch, in which batched calls of LAPACK once waited for each other for ever."""
    slopes, own = jnp.linspace(0.019, 0.021, 257), 128

    def measured(slope):
        one = jb.find_gait(jb.seed_scene(slope=slope), engine="lanes", radius_sensitivities=False)
        return one.measures, one.elasticities.period, one.ending

    measures, elasticities, endings = jax.jit(jax.vmap(measured))(slopes)
    assert np.all(np.asarray(endings) == int(jb.gait.Search.FOUND))
    assert float(measures.period[own]) == pytest.approx(float(seed_gait.measures.period), abs=1e-8)
    np.testing.assert_allclose(
        elasticities[own], seed_gait.elasticities.period, rtol=5e-4, atol=1e-8
    )
    assert np.all(np.diff(measures.period) > 0.0)
    assert np.all(np.abs(np.diff(measures.spectral_radius)) < 1e-3)


@pytest.mark.nightly
def test_a_return_map_and_its_derivatives_by_both():
    """Of a rigid walker, which XLA compiles soonest; the seed's are compared within its gait."""
    scene = jb.ladder()["rigid"]
    begin = jb.find_gait(scene, parameters=(), radius_sensitivities=False).measures.state

    def arrival(engine, d, theta):
        state = begin._replace(theta_1=theta)
        found = jb.return_map(jb.with_parameters(scene, {"d": d}), state, engine=engine)
        return jnp.stack([*found.state, found.time])

    where, along = (scene.walker.d, begin.theta_1), (1e-3, 0.1)
    where = tuple(map(jnp.asarray, where))
    ours, theirs = (
        jax.jit(lambda *z, e=engine: jax.jvp(functools.partial(arrival, e), z, along))(*where)
        for engine in ("lanes", "xla")
    )
    np.testing.assert_allclose(ours[0], theirs[0], atol=1e-7)
    np.testing.assert_allclose(ours[1], theirs[1], rtol=5e-4, atol=1e-6)
    with pytest.raises(RuntimeError, match="no reverse mode"):
        jax.jacrev(functools.partial(arrival, "lanes"))(*where)


def test_every_search_by_what_lanes_lack_is_refused_in_the_same_sentence():
    scene = dataclasses.replace(jb.seed_scene(), friction=ErrorFunction(mu=0.5))
    for _ in range(2):
        with pytest.raises(jb.ArgumentError, match=r"'erf'.*engine=\"xla\""):
            jb.find_gait(scene, parameters=(), radius_sensitivities=False)
