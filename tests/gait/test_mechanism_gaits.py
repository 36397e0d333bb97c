"""Gaits of mechanisms: against the seed's, differences of their return maps, and each other."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped import ArgumentError
from jaxbiped.compiler import host_jit
from tests.mechanisms import SEED_WITH_TORSO, leg, seed_walker

LAWS = dict(
    normal=jb.laws.RistowSchafer(K=1e6, c=1e7),
    friction=jb.laws.BengisuAkay(0.5, 0.4, 1e-4, 1000.0),
)
PLAIN = dict(parameters=(), radius_sensitivities=False)


def _seed_with(first=None):
    return dataclasses.replace(jb.seed_scene(), walker=seed_walker(first=first))


def test_the_seed_is_a_mechanism():
    scene = _seed_with()
    assert type(scene.state(theta_1=0.1)) is jb.State
    own, seed = jb.find_gait(scene, **PLAIN), jb.find_gait(jb.seed_scene(), **PLAIN)
    assert own.found_by is seed.found_by
    assert own.cycle == "step"
    bars = jax.tree.leaves(seed.measure_errors)
    pairs = zip(jax.tree.leaves(own.measures), jax.tree.leaves(seed.measures), bars, strict=True)
    assert all(abs(a - b) <= 0.1 * bar + 1e-12 for a, b, bar in pairs)


@pytest.mark.slow
def test_a_gait_with_a_torso_against_differences():
    """Multipliers by the return map's differences, and slopes by other gaits' periods."""
    names = ("torso.spring.stiffness", "torso.mass", "torso.centre", "slope")
    how = dict(accuracy="tight", parameters=names, radius_sensitivities=False)
    gait = jb.find_gait(SEED_WITH_TORSO, **how)
    assert gait.stable
    assert float(gait.unit_multiplier_error) < 1e-5
    jacobian = _by_differences(SEED_WITH_TORSO, gait.measures.state)
    np.testing.assert_allclose(jacobian, gait.return_jacobian[:-2], atol=2e-5)
    values = np.linalg.eigvals(jacobian)
    leading = values[np.argsort(-np.abs(values))][:3]
    np.testing.assert_allclose(np.abs(leading), np.abs(gait.multipliers[:3]), atol=1e-6)
    for k, name in enumerate(names):
        value = float(jb.parameter_values(SEED_WITH_TORSO)[name])
        step = 1e-4 * abs(value)
        periods = [
            float(
                jb.find_gait(
                    jb.with_parameters(SEED_WITH_TORSO, {name: value + moved}),
                    gait.measures.state,
                    **how,
                ).measures.period
            )
            for moved in (step, -step)
        ]
        slope = (periods[0] - periods[1]) / (2.0 * step)
        assert float(gait.sensitivities.period[k]) == pytest.approx(slope, rel=1e-5)


def _by_differences(scene, state, step=1e-6):
    names = state._fields[1:]
    moved = [
        state._replace(**{name: getattr(state, name) + side * step})
        for name in names
        for side in (1.0, -1.0)
    ]
    starts = jax.tree.map(lambda *each: jnp.stack(each), *moved)
    how = dict(rtol=1e-10, tangent_rtol=1e-3, parameters=())
    ends = jax.jit(jax.vmap(lambda y: jb.gait.linearise_return_map(scene, y, **how)))(starts)
    assert not np.any(ends.code)
    rows = np.asarray(ends.recurring)
    return ((rows[0::2] - rows[1::2]) / (2.0 * step)).T


@pytest.mark.slow
def test_unlike_legs_walk_in_strides():
    """At equal legs a stride is two steps, and its slope by one leg's mass the step's by both."""
    how = dict(radius_sensitivities=False)
    step = jb.find_gait(_seed_with(), parameters=("1+2.mass",), **how)
    even = _seed_with(first=1.0)
    names = ("1.mass", "2.mass")
    stride = jb.find_gait(even, step.measures.state, parameters=names, **how)
    assert stride.cycle == "stride"
    assert int(stride.cycle_footsteps) == 2
    assert float(stride.measures.period) == pytest.approx(2.0 * float(step.measures.period), 1e-6)
    np.testing.assert_allclose(stride.step_lengths, np.tile(step.step_lengths, 2), rtol=1e-5)
    np.testing.assert_allclose(
        stride.sensitivities.period, np.tile(step.sensitivities.period, 2), rtol=1e-4
    )
    uneven = jb.with_parameters(even, {"1.mass": 1.02})
    gait = jb.find_gait(uneven, stride.measures.state, parameters=names, **how)
    first, second = gait.step_lengths
    assert abs(float(first - second)) > 1e-4
    assert float(first + second) == pytest.approx(float(gait.measures.step_length), rel=1e-12)
    with pytest.raises(ArgumentError, match=r"footsteps = 3 is not allowed: .* multiple of 2"):
        jb.find_gait(uneven, footsteps=3)


@pytest.mark.slow
def test_footsteps_of_a_mirrored_walker_have_lengths_of_their_own():
    step = jb.find_gait(_seed_with(), footsteps=2, **PLAIN)
    assert step.cycle == "step"
    assert int(step.cycle_footsteps) == 1
    half = float(step.measures.step_length) / 2.0
    np.testing.assert_allclose(step.step_lengths, [half, half], rtol=1e-6)


@pytest.mark.slow
def test_measures_of_a_mechanism_are_differentiable():
    scene, gait = (
        SEED_WITH_TORSO,
        jb.find_gait(SEED_WITH_TORSO, parameters=("torso.mass",), radius_sensitivities=False),
    )

    def period(mass):
        place = next(k for k, each in enumerate(scene.walker.pieces) if each.name == "torso")
        changed = eqx.tree_at(lambda s: s.walker.pieces[place].mass, scene, mass)
        return jb.gait_measures(changed, gait.measures.state).period

    slope = host_jit()(jax.grad(period))(jnp.asarray(0.5))
    assert float(slope) == pytest.approx(float(gait.sensitivities.period[0]), rel=1e-4)


def test_a_section_may_be_where_a_body_is_upright():
    plain = jb.find_gait(SEED_WITH_TORSO, **PLAIN)
    section = jb.MidStance(body="torso")
    with pytest.raises(ArgumentError, match=r"section.body = 'trunk' is not known"):
        jb.find_gait(SEED_WITH_TORSO, section=jb.MidStance(body="trunk"))
    other = jb.find_gait(SEED_WITH_TORSO, plain.measures.state, section=section, **PLAIN)
    assert float(other.measures.period) == pytest.approx(float(plain.measures.period), rel=1e-6)
    assert float(other.measures.state.theta_torso) == pytest.approx(0.0, abs=1e-12)


class KneedOfMyOwn(eqx.Module):
    """Thighs and shanks, McGeer's proportions, with a stop at the knee."""

    m_thigh: jax.Array = jb.laws.parameter("thigh mass", "", "kg", positive=True)
    epsilon: jax.Array = jb.laws.parameter("knee angle at the stop", "", "rad")
    stop: jb.laws.RistowSchafer

    def mechanism(self):
        return jb.Mechanism(
            root_mass=1.352,
            bodies=(*leg(1, self.m_thigh), *leg(2, self.m_thigh)),
            feet=[jb.Foot(f"shank_{i}", centre=0.136, radius=0.08) for i in (1, 2)],
            joints=[jb.Stop(f"shank_{i}", upper=self.epsilon, law=self.stop) for i in (1, 2)],
            mirror=(("thigh_1", "thigh_2"), ("shank_1", "shank_2")),
        )


def _kneed():
    stop = jb.laws.RistowSchafer(K=300.0, c=3000.0, n=1.0)
    walker = KneedOfMyOwn(m_thigh=0.2, epsilon=0.2, stop=stop)
    return jb.Scene(walker=walker, ground=jb.Ground(slope=0.0456), **LAWS)


@pytest.mark.nightly
def test_a_kneed_walker_of_a_users_own_is_found_without_a_guess():
    scene = _kneed()
    assert {"K", "m_thigh", "epsilon", "stop.K"} <= set(jb.parameter_names(scene))
    assert isinstance(scene.clearance, jb.laws.AlwaysTouching)
    gait = jb.find_gait(scene, parameters=("m_thigh",), radius_sensitivities=False)
    assert gait.stable
    assert gait.found_by is jb.gait.FoundBy.CONTINUATION
    assert float(gait.unit_multiplier_error) < 1e-5
    # Its legs swing bent, and the knee is stretched again before the foot comes down.
    states = gait.orbit[1]
    knee = np.asarray(states.theta_shank_1 - states.theta_thigh_1)[0]
    knee = knee[np.isfinite(knee)]
    assert knee.min() < -0.1
    assert knee[-1] == pytest.approx(0.2, abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("depth", [-5e-17, 0.0, 1e-12])
def test_a_foot_that_is_put_on_the_ground_is_a_guess(depth):
    """By rounding it is above the ground or below, at rest: no step may wait for it to touch."""
    scene = jb.seed_scene(slope=0.02)
    start = scene.state(theta_1=0.1, omega_1=2.3, omega_2=-0.69, standing="2")
    gait = jb.find_gait(scene, start._replace(hip_z=start.hip_z - depth), max_evaluations=40)
    assert gait.outcome == jb.gait.Search.FOUND


def rimless_wheel():
    """The published wheel on compliant feet, whose ground is stiff for gravity of 1."""
    rigid = jb.models.rimless_wheel()
    return rigid, jb.Scene(walker=rigid.walker, ground=rigid.ground, **LAWS)


@pytest.mark.slow
def test_a_rimless_wheel_on_compliant_feet():
    """It turns to the next spoke at each step; its gait is near that on rigid feet."""
    rigid, scene = rimless_wheel()
    gait = jb.find_gait(scene, **PLAIN)
    assert gait.found_by is jb.gait.FoundBy.START
    assert gait.cycle == "step"
    # It varies with where steps fall: 2.5e-6 to 1.2e-5 over nine slopes within 2 % of this one.
    slopes = (0.98 * rigid.ground.slope, 1.02 * rigid.ground.slope)
    others = [jb.find_gait(jb.with_parameters(scene, {"slope": x}), **PLAIN) for x in slopes]
    off = [float(each.unit_multiplier_error) for each in (gait, *others)]
    assert np.median(off) < 1e-5
    assert max(off) < 3e-5
    eta = (0.5 + np.cos(2.0 * np.pi / 8.0)) / 1.5
    assert float(gait.multipliers[0].real) == pytest.approx(eta**2, abs=2e-3)
    length = 2.0 * np.sin(np.pi / 8.0)
    assert float(gait.measures.step_length) == pytest.approx(length, abs=1e-4)
    near = jb.find_gait(rigid, **PLAIN)
    assert near.cycle == "step"
    assert float(gait.measures.period) == pytest.approx(float(near.measures.period), rel=5e-3)


@pytest.mark.nightly
def test_a_rimless_wheel_on_compliant_feet_from_any_spoke():
    """Its sensitivity by differences, three steps, and labels of the same gait."""
    _, scene = rimless_wheel()
    gait = jb.find_gait(scene, parameters=("wheel.inertia",), radius_sensitivities=False)
    length = 2.0 * np.sin(np.pi / 8.0)
    slopes = [
        float(
            jb.find_gait(jb.with_parameters(scene, {"wheel.inertia": x}), **PLAIN).measures.period
        )
        for x in (0.505, 0.495)
    ]
    by_difference = (slopes[0] - slopes[1]) / 0.01
    assert float(gait.sensitivities.period[0]) == pytest.approx(by_difference, rel=1e-3)
    three = jb.find_gait(scene, gait.measures.state, footsteps=3, **PLAIN)
    np.testing.assert_allclose(three.step_lengths, [length] * 3, atol=1e-4)
    state = gait.measures.state
    turned = [state._replace(theta_wheel=state.theta_wheel + k * np.pi / 4.0) for k in range(3)]
    back = [jb.return_map(scene, each).state.omega_wheel for each in turned]
    np.testing.assert_allclose(back, [float(state.omega_wheel)] * 3, rtol=1e-7)
    label = jb.labelling(scene, guess=state)
    starts = jb.starts.grid(scene, {"omega_wheel": [0.0, 1.0, -1.0]}, base=state)
    found = jb.sweep(label, starts)
    names = jb.basins.label_names(found.label.values, found.cycle_footsteps.values)
    assert names[2].startswith("walking")
    assert not names[1].startswith("walking")
