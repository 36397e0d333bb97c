"""Gaits of rigid walkers against what was published of them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from reference.rigid import rigid_walker

import jaxbiped as jb
from tests.rigid_walkers import compass_gait, rigid_seed

pytestmark = pytest.mark.slow

PLAIN = dict(parameters=(), radius_sensitivities=False)


@pytest.mark.parametrize(
    ("slope", "asked", "least"), [(0.06, 2, 1), (0.102, 2, 2), (0.102, 4, 2), (0.102, 3, 3)]
)
def test_the_least_number_of_footsteps_is_that_of_the_map_itself(slope, asked, least):
    """The orbit closes under the return map then, and not before; a longer cycle is sought."""
    scene = jb.with_parameters(rigid_seed(), {"slope": slope})
    gait = jb.find_gait(scene, footsteps=asked, **PLAIN)
    assert gait.outcome is jb.gait.Search.FOUND
    assert int(gait.cycle_footsteps) == least
    state, first = gait.measures.state, np.array(gait.measures.state[1:])
    for k in range(1, asked + 1):
        state = jb.return_map(scene, state).state
        off = np.max(np.abs(np.array(state[1:]) - first))
        assert bool(off < 1e-4) is (k % least == 0)
    said = jb.gait.explain_search(scene, gait)
    assert (f"closes after {least} of the {asked} footsteps" in said) is (least < asked)


def test_footsteps_below_a_hundredth_of_the_height_are_no_walk():
    """Footsteps on slight slopes are as their third root (Garcia et al. 1998)."""
    scene = jb.with_parameters(rigid_seed(), {"slope": 1e-6})
    gait = jb.find_gait(scene, **PLAIN)
    height = float(scene.mechanism.height)
    assert gait.outcome is jb.gait.Search.FOUND
    length = float(gait.measures.step_length) / height
    last = 1e-6 * (0.01 / length) ** 3
    beyond = jb.find_gait(jb.with_parameters(scene, {"slope": 0.5 * last}), gait, **PLAIN)
    assert beyond.outcome is jb.gait.Search.NO_WALK
    assert not bool(beyond.stable)
    branch = jb.continue_gait(scene, "slope", bounds=(0.1 * last, 2e-6))
    assert str(branch.stops[0].end) == "no walk"
    assert min(each.value for each in branch.points) == pytest.approx(last, rel=0.01)
    best = jb.optimise_gait(
        scene, vary={"slope": (0.1 * last, 2e-6)}, minimise="step_length", guess=gait
    )
    assert best.outcome is jb.optimise.Outcome.CORNER
    assert best.objective >= 0.01 * height


def test_compass_gait_converges_and_is_stable():
    """One of the gaits that starts lead to is stable; an independent solve returns to it."""
    gaits = jb.find_gaits(compass_gait(), jb.gait.rolling_starts(compass_gait(), 32, spread=0.5))
    stable = np.asarray(gaits.gaits.stable)
    assert stable.sum() == 1
    k = int(np.argmax(stable))
    assert float(gaits.gaits.measures.period[k]) == pytest.approx(0.734, abs=1e-3)
    assert float(gaits.gaits.measures.step_length[k]) == pytest.approx(0.535, abs=1e-3)
    state = jax.tree.map(lambda leaf: leaf[k], gaits.gaits.measures.state)
    assert_returns(compass_gait(), state, gaits.gaits.measures.period[k])


def assert_returns(scene, state, period):
    """A footstep by another program and integrator, with multipliers, leads back to the state."""
    after, time = rigid_walker(scene).footstep(state[1:])
    np.testing.assert_allclose(after, np.array(state[1:]), rtol=0.0, atol=2e-8)
    assert time == pytest.approx(float(period), abs=2e-8)


def test_the_seeds_walker_in_the_rigid_limit():
    gait = jb.find_gait(rigid_seed())
    assert gait.outcome is jb.gait.Search.FOUND
    assert bool(gait.stable)
    assert float(gait.measures.period) == pytest.approx(0.44378, abs=5e-6)
    assert float(gait.measures.step_length) == pytest.approx(0.19041, abs=5e-6)
    assert_returns(rigid_seed(), gait.measures.state, gait.measures.period)
    # Mass alone scales nothing, and gravity only the time.
    index = gait.parameters.index
    elasticities = gait.elasticities
    for measure in ("period", "step_length", "spectral_radius"):
        values = np.asarray(getattr(elasticities, measure))
        assert abs(values[index("m")] + values[index("J")]) < 1e-6
    assert float(elasticities.period[index("g")]) == pytest.approx(-0.5, abs=1e-7)
    assert abs(float(elasticities.spectral_radius[index("g")])) < 1e-6
    checks = jb.dynamics.rigid_checks(rigid_seed(), gait.orbit[1])
    assert not bool(checks.flies.any())
    assert not bool(checks.slips(0.4).any())


def test_sensitivities_equal_differences():
    scene, measures = rigid_seed(), ("period", "step_length", "spectral_radius")
    gait = jb.find_gait(scene, accuracy="tight")

    def values(parameter, step):
        own = float(jb.parameter_values(scene)[parameter])
        moved = jb.with_parameters(scene, {parameter: own + step})
        found = jb.find_gait(moved, gait.measures.state, accuracy="tight", **PLAIN)
        return np.array([float(getattr(found.measures, measure)) for measure in measures])

    for parameter in ("slope", "r", "d", "hip_mass"):
        if parameter == "hip_mass":  # from zero, to one side
            zero, one, two = (values(parameter, step) for step in (0.0, 1e-4, 2e-4))
            expected = (4.0 * one - two - 3.0 * zero) / 2e-4
        else:
            expected = (values(parameter, 1e-5) - values(parameter, -1e-5)) / 2e-5
        place = gait.parameters.index(parameter)
        ours = [float(getattr(gait.sensitivities, measure)[place]) for measure in measures]
        assert ours == pytest.approx(expected, rel=1e-5, abs=1e-6)


def test_return_map_and_measures_differentiate():
    scene = rigid_seed()
    state = jb.find_gait(scene, **PLAIN).measures.state
    turn = lambda y, **options: jb.return_map(scene, y, **options)
    by_lanes = jax.jacfwd(lambda y: turn(y, engine="lanes").state)(state)
    moved = lambda h: turn(state._replace(omega_2=state.omega_2 + h), accuracy="tight").state
    difference = (moved(1e-6).omega_1 - moved(-1e-6).omega_1) / 2e-6
    assert float(by_lanes.omega_1.omega_2) == pytest.approx(float(difference), rel=1e-5)
    slope = jax.grad(lambda s: jb.gait_measures(s).period)(scene).ground.slope
    gait = jb.find_gait(scene)
    expected = gait.sensitivities.period[gait.parameters.index("slope")]
    assert float(slope) == pytest.approx(float(expected), rel=1e-9)


def test_other_sections_are_refused():
    with pytest.raises(jb.ArgumentError, match="HeelStrike"):
        jb.find_gait(rigid_seed(), section=jb.MidStance())
    with pytest.raises(jb.ArgumentError, match="must be a RigidState"):
        jb.find_gait(rigid_seed(), jb.seed_state())


def test_gaits_over_many_slopes_at_once():
    start = jb.find_gait(rigid_seed(), **PLAIN).measures.state
    slopes = jnp.linspace(0.015, 0.03, 8)
    many = jax.vmap(lambda slope: jb.find_gait(rigid_seed_at(slope), start, **PLAIN))(slopes)
    assert np.all(np.asarray(many.ending) == 0)
    speeds = np.asarray(many.measures.speed)
    assert np.all(np.diff(speeds) > 0.0)


def rigid_seed_at(slope):
    return jb.RigidScene(walker=jb.seed_scene().walker, ground=jb.Ground(slope=slope))
