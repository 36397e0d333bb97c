import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.orbit_reference import SEED, gait, jacobian, sensitivities

PARAMETERS = ("K", "c", "xi", "slope", "l", "mu_kinetic")
IN_REFERENCE = {"mu_static": "mu_s", "mu_kinetic": "mu_k", "hip_mass": "hip"}


@pytest.fixture(scope="module")
def found():
    return jb.find_gait(jb.seed_scene())


@pytest.fixture(scope="module")
def tight():
    return jb.find_gait(jb.seed_scene(), accuracy="tight", radius_sensitivities=False)


@pytest.fixture(scope="module")
def start(tight):
    return tuple(float(value) for value in tight.measures.state[1:])


def test_seed_gait(found):
    assert found.outcome == jb.Search.FOUND
    assert found.critical == jb.Bifurcation.NONE
    assert bool(found.stable)
    assert float(found.measures.period) == pytest.approx(0.4408349, abs=1e-7)
    assert float(found.measures.step_length) == pytest.approx(0.1792270, abs=1e-7)
    assert float(found.measures.peak_normal) == pytest.approx(308.7904, abs=1e-3)
    assert float(found.residual) < 1e-7
    assert float(found.unit_multiplier_error) < 1e-4
    assert found.multipliers.shape == (6,)


def test_tight_gait(tight):
    assert float(tight.unit_multiplier_error) < 1e-6
    assert float(tight.residual) < 2e-10


@pytest.mark.parametrize(("accuracy", "tolerance"), [("found", 5e-4), ("tight", 1e-5)])
def test_multipliers_agree_with_an_independent_solve(accuracy, tolerance, start, request):
    ours = np.sort(np.abs(request.getfixturevalue(accuracy).multipliers))[::-1]
    theirs = np.sort(np.abs(np.linalg.eigvals(jacobian(start))))[::-1]
    assert ours[:3] == pytest.approx(theirs[:3], rel=tolerance)
    assert ours[3] == pytest.approx(theirs[3], abs=1e-7)


@pytest.mark.parametrize("name", PARAMETERS)
def test_sensitivities_agree_with_an_independent_solve(name, found, tight, start):
    reference_name = IN_REFERENCE.get(name, name)
    # ξ matters so little that its difference needs a wide step to rise above rounding.
    expected = sensitivities(start, reference_name, 5e-2 if name == "xi" else 2e-3)
    noise = 1e-8 if name == "xi" else 2e-9
    for each, tolerance in ((found, 5e-4), (tight, 1e-5)):
        k = each.parameters.index(name)
        slopes = each.sensitivities
        measures = (slopes.period, slopes.step_length, slopes.speed, slopes.peak_normal)
        ours = np.array([float(leaf[k]) for leaf in (*slopes.state[1:], *measures)])
        ours *= SEED[reference_name]
        # The state is one vector: its entries are measured against the largest.
        sizes = np.abs(expected)
        sizes[:7] = np.max(sizes[:7])
        rounding = noise * np.array([1.0] * 10 + [1e3])
        assert np.all(np.abs(ours - expected) <= tolerance * sizes + rounding)


def test_gait_of_the_reference_is_ours(tight, start):
    state, measures = gait(start, np.array(list(_reference_parameters())))
    assert state == pytest.approx(np.array(start), abs=2e-9)
    ours = tight.measures
    mine = [ours.period, ours.step_length, ours.speed, ours.peak_normal]
    assert measures == pytest.approx(np.array([float(m) for m in mine]), rel=1e-8)


def _reference_parameters():
    from tests.orbit_reference import parameters

    return parameters()


def test_elasticities_obey_the_scaling_of_mass(found):
    """Scaling m, J, K, c and the hip's mass alike changes forces alone."""
    for measure, expected in (("period", 0.0), ("step_length", 0.0), ("peak_normal", 1.0)):
        leaf = getattr(found.elasticities, measure)
        total = sum(float(leaf[found.parameters.index(name)]) for name in ("m", "J", "K", "c"))
        assert total == pytest.approx(expected, abs=1e-4)


def test_radius_sensitivities(found):
    """d log ρ / d log p by differences of tight gaits."""
    leaf, errors = found.elasticities.spectral_radius, found.sensitivity_errors.spectral_radius
    for name in ("slope", "c", "l"):
        k, h = found.parameters.index(name), 1e-3
        radii = []
        for sign in (1.0, -1.0):
            changed = {name: SEED[name] * (1.0 + sign * h)}
            gait = jb.find_gait(
                jb.seed_scene(**changed), accuracy="tight", radius_sensitivities=False
            )
            radii.append(float(gait.measures.spectral_radius))
        expected = np.log(radii[0] / radii[1]) / (2 * h)
        assert float(leaf[k]) == pytest.approx(expected, rel=5e-3)
        assert float(errors[k]) > 0.0


def test_a_start_that_falls_gives_no_gait():
    state = jb.seed_state()._replace(omega_2=jnp.asarray(-3.0), hip_vx=jnp.asarray(1.5))
    gait = jb.find_gait(jb.seed_scene(), state)
    assert gait.outcome == jb.Search.NO_RETURN
    assert gait.walk_outcome != jb.Ending.WALKING
    assert not np.isfinite(float(gait.residual))
    assert np.isnan(float(gait.measures.period))
    assert not bool(gait.stable)


def test_no_gait_on_the_level():
    """A slope of nothing feeds no energy: the search says so, with what it had."""
    gait = jb.find_gait(jb.seed_scene(slope=0.0))
    assert gait.outcome in (jb.Search.NO_RETURN, jb.Search.NOT_CONVERGED)
    assert not bool(gait.stable)


def test_vmap_over_scenes_changes_nothing(found):
    stiffness = jnp.array([1e6, 2e6])

    def one(k):
        scene = eqx.tree_at(lambda s: s.normal.K, jb.seed_scene(), k)
        return jb.find_gait(scene, parameters=("K",), radius_sensitivities=False)

    both = jax.jit(jax.vmap(one))(stiffness)
    alone = one(stiffness[0])
    assert np.all(np.asarray(both.ending) == 0)
    assert float(both.measures.period[0]) == pytest.approx(float(alone.measures.period), abs=1e-8)
    k = found.parameters.index("K")
    assert float(both.elasticities.period[0, 0]) == pytest.approx(
        float(found.elasticities.period[k]), rel=5e-4
    )


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (dict(accuracy="fast"), "accuracy"),
        (dict(period=0), "period"),
        (dict(period=1.5), "period"),
        (dict(parameters=("K", "stiffness")), "parameters"),
        (dict(method="secant"), "method"),
        (dict(most_turns=0), "most_turns"),
        (dict(solver="euler"), "solver"),
    ],
)
def test_bad_arguments(options, named):
    with pytest.raises(jb.ArgumentError, match=named):
        jb.find_gait(jb.seed_scene(), **options)


def test_a_batch_as_guess_is_refused():
    many = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), jb.seed_state())
    with pytest.raises(jb.ArgumentError, match=r"jax\.vmap"):
        jb.find_gait(jb.seed_scene(), many)
