"""Named accuracies, against friction that builds up anywhere; any size, against the seed's."""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from reference.scipy_solves import final_of

import jaxbiped as jb
from jaxbiped import ACCURACIES
from jaxbiped.hybrid._scales import (
    check_precision,
    recurring_inverse_units,
    recurring_sizes,
    relative_to_scene,
    sizes_of,
    units_of,
)
from jaxbiped.solve._accuracy import precision_of, tolerances
from jaxbiped.solve.solvers import rms_norm

SEED, START = jb.seed_scene(), jb.seed_state()
DURATION = 0.8
"""Through a heel strike [s], of the seed's walker."""


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_the_seeds_tolerances_are_those_of_the_name(accuracy):
    found = tolerances(accuracy, None, None, SEED)
    walk = ACCURACIES[accuracy].walk
    assert (float(found.rtol), float(found.atol)) == (walk, 1e-2 * walk)


BOUNDS = {"draft": 1e-5, "balanced": 6e-7, "tight": 7e-10}
"""Errors of the seed's walk after 0.3 s, in SI units: some 2.5 times those at these tolerances."""


def test_named_walks_are_as_exact_as_their_names_say():
    """Ten times looser tolerances have six to thirteen times the errors."""
    exact = final_of(0.3, 1e-10)
    for accuracy, bound in BOUNDS.items():
        walk = jb.simulate(SEED, START, duration=0.3, accuracy=accuracy, save="end")
        off = max(abs(float(a) - b) for a, b in zip(walk.final, exact, strict=True))
        assert 0.1 * bound < off < bound, accuracy


def test_derivatives_have_ten_times_the_tolerance_of_the_state():
    for each in ACCURACIES.values():
        for precision in (each.gait, each.rigid_gait):
            assert precision.tangent_rtol == pytest.approx(10.0 * precision.rtol)
    draft, balanced, tight = ACCURACIES.values()
    assert draft.gait.rtol > 100.0 * balanced.gait.rtol > 1e4 * tight.gait.rtol


def test_gaits_resolve_the_slip_speed_with_their_columns():
    """Half of 1e-5 m/s, of √(g l) = 1.98 m/s, is 2.5e-6: a gait's tolerance is four times that."""
    sticky = jb.seed_scene(v0=1e-5)
    found = precision_of("draft", sticky)
    assert float(found.rtol) == pytest.approx(2e-5 / np.sqrt(9.8 * 0.4))
    assert float(found.tangent_rtol) == pytest.approx(2e-4 / np.sqrt(9.8 * 0.4))
    for name, scene in (("draft", SEED), ("balanced", sticky), ("draft", jb.ladder()["rigid"])):
        named = ACCURACIES[name].gait if scene.compliant else ACCURACIES[name].rigid_gait
        assert tuple(map(float, precision_of(name, scene))) == tuple(named)
    traced = jax.jit(lambda v0: precision_of("draft", jb.seed_scene(v0=v0)).rtol)(1e-5)
    assert float(traced) == pytest.approx(float(found.rtol))


def test_a_slip_speed_is_resolved_and_what_is_given_stays():
    sticky = jb.seed_scene(v0=1e-8)
    assert float(tolerances("balanced", None, None, sticky).rtol) < 1e-8
    assert tolerances("balanced", 1e-6, 1e-9, sticky) == (1e-6, 1e-9)
    larger = jb.seed_scene(v0=1e-8, g=9.8e-4)
    fine, less = (float(tolerances("draft", None, None, s).rtol) for s in (sticky, larger))
    assert less == pytest.approx(100.0 * fine)
    weightless = jb.seed_scene(v0=1e-8, g=0.0)
    assert float(tolerances("draft", None, None, weightless).rtol) == ACCURACIES["draft"].walk
    traced = jax.vmap(lambda v0: tolerances("draft", None, None, jb.seed_scene(v0=v0)).rtol)
    found = traced(jnp.array([1e-8, 1e-4])).tolist()
    assert found == [pytest.approx(fine, rel=1e-14), ACCURACIES["draft"].walk]


@pytest.mark.parametrize("v0", [1e-6, 1e-8])
def test_a_walker_that_all_but_sticks_walks_at_balanced(v0):
    walk = jb.simulate(jb.seed_scene(v0=v0), START, duration=0.45, save="end")
    assert walk.outcome == jb.Ending.WALKING
    exact = jb.simulate(jb.seed_scene(v0=v0), START, duration=0.45, save="end", rtol=1e-9)
    off = max(abs(float(a - b)) for a, b in zip(walk.final, exact.final, strict=True))
    assert off < 1e-4


@pytest.mark.parametrize("name", jb.laws.FRICTION_LAWS)
def test_every_law_names_a_parameter_of_its_own(name):
    law = jb.laws.FRICTION_LAWS[name]
    parameter = getattr(law, "builds_up_over", None)
    assert parameter is None or parameter in law.__dataclass_fields__


def sized(length, time):
    """The seed's scene with lengths and times in these proportions, its start, and its units."""
    force = length / time**2
    factors = {"l": length, "d": length, "r": length, "J": length**2, "g": force}
    factors |= {"K": force / length**1.5, "c": force * time / length**2}
    factors |= {"v0": length / time, "xi": time / length}
    scene = SEED
    for part in ("walker", "ground", "normal", "friction"):
        old = getattr(scene, part)
        own = {k: getattr(old, k) * f for k, f in factors.items() if hasattr(old, k)}
        scene = dataclasses.replace(scene, **{part: dataclasses.replace(old, **own)})
    units = [length, length, 1.0, 1.0, *[length / time] * 2, *[1.0 / time] * 2]
    return scene, jb.State(*[x * unit for x, unit in zip(START, units, strict=True)]), units


def walked(scene, start, **options):
    return jb.simulate(scene, start, **{"save": "end", "engine": "lanes"} | options)


def numbers(walk, units):
    return np.array([float(leaf) for leaf in walk.final]) / np.array(units)


@pytest.fixture(scope="module")
def truth():
    return numbers(walked(SEED, START, duration=DURATION, rtol=1e-11, max_solver_steps=10**6), 1.0)


def test_the_units_of_the_seed_are_one():
    for scene, start in [(SEED, START), (jb.RedundantScene(SEED), START)]:
        units = units_of(scene, start)
        assert float(units.time) == 1.0
        assert [float(each) for each in units.inverse] == [1.0] * 8


def test_a_leaf_of_no_known_unit_is_refused():
    class Odd(NamedTuple):
        hip_x: float = 0.0
        mood: float = 0.0

    with pytest.raises(TypeError, match=r"Odd\.mood is not known"):
        units_of(SEED, Odd())
    with pytest.raises(ValueError, match="lengths and times alone"):
        _ = jb.laws.Quantity("force", unit="N").length_and_time
    assert jb.laws.Quantity("acceleration", unit="m/s^2").length_and_time == (1.0, -2.0)


def test_units_have_the_dimensions_of_what_they_measure():
    scene, start, expected = sized(2.0**-10, 2.0**-5)
    units = units_of(scene, start)
    inverse = 1.0 / np.array(expected)
    np.testing.assert_allclose(np.array(units.inverse), inverse, rtol=1e-15)
    np.testing.assert_allclose(recurring_inverse_units(scene, 7), inverse[1:], rtol=1e-15)
    assert float(units.time) == 2.0**-5
    legs = jb.dynamics.redundant_state(jb.RedundantScene(scene), start)
    by_name = units_of(jb.RedundantScene(scene), legs).inverse._asdict()
    assert by_name["vx_2"] == units.inverse.hip_vx
    assert by_name["x_1"] == units.inverse.hip_x
    still = dataclasses.replace(scene, ground=jb.Ground(slope=0.02, g=0.0))
    assert np.isfinite(np.array(units_of(still, start).inverse)).all()


@pytest.mark.slow
@pytest.mark.parametrize(("length", "engine"), [(1e-6, "lanes"), (1e3, "lanes"), (1e-3, "xla")])
def test_a_walker_of_any_size_is_as_exact(length, engine, truth):
    time = np.sqrt(length)
    scene, start, units = sized(length, time)
    own = walked(SEED, START, duration=DURATION, engine=engine)
    walk = walked(scene, start, duration=DURATION * time, engine=engine)
    assert walk.outcome == jb.Ending.WALKING
    # Rounding decides otherwise on few steps; in SI units a millimetre one took a quarter less.
    assert int(walk.accepted) == pytest.approx(int(own.accepted), abs=12)
    off, own_off = (abs(numbers(w, u) - truth).max() for w, u in ((walk, units), (own, 1.0)))
    assert off < 2.0 * own_off


def test_a_walker_of_any_size_is_as_exact_when_tight(truth):
    time = np.sqrt(1e-3)
    scene, start, units = sized(1e-3, time)
    walk = walked(scene, start, duration=DURATION * time, accuracy="tight")
    assert abs(numbers(walk, units) - truth).max() < 2e-8


def test_a_tolerance_that_is_given_is_one_in_si_units():
    scene, start, _ = sized(1e-3, np.sqrt(1e-3))
    duration = 0.2 * np.sqrt(1e-3)
    coarse, fine = (
        walked(scene, start, duration=duration, rtol=1e-6, atol=atol) for atol in (1e-5, 1e-12)
    )
    by_scale = walked(scene, start, duration=duration, rtol=1e-6)
    assert int(coarse.accepted) < int(by_scale.accepted) < int(fine.accepted)
    seed = [walked(SEED, START, duration=0.2, rtol=1e-6, **own) for own in ({}, {"atol": 1e-8})]
    np.testing.assert_array_equal(*[numbers(each, 1.0) for each in seed])


def test_sizes_differ_within_a_batch():
    lengths = jnp.array([1.0, 2.0**-10])

    def end(length):
        scene, start, _ = sized(length, jnp.sqrt(length))
        walk = walked(scene, start, duration=0.2 * jnp.sqrt(length))
        return walk.accepted, walk.final.theta_1

    counts, angles = jax.vmap(end)(lengths)
    assert int(counts[0]) == pytest.approx(int(counts[1]), abs=4)
    assert float(angles[0]) == pytest.approx(float(angles[1]), abs=1e-6)


def test_a_contact_is_too_stiff_for_a_precision_where_rounding_a_leg_carries_the_walker():
    """K = W/(ε l), with the weight W = (2 m + m_h) g [N]; laws of the seed are linear at 1 m."""
    walker, ground = SEED.walker, SEED.ground
    weight = float(2.0 * walker.m + walker.hip_mass) * float(ground.g)
    limit = weight / (float(np.finfo(np.float32).eps) * float(walker.l))

    def check(share):
        normal = dataclasses.replace(SEED.normal, K=jnp.asarray(share * limit))
        check_precision(dataclasses.replace(SEED, normal=normal), np.dtype(np.float32))

    check(0.9)
    with pytest.raises(jb.ArgumentError, match=r"by 1\.1 times the walker's weight"):
        check(1.1)


def test_sizes_are_a_leg_and_the_root_of_leg_over_gravity():
    scene = jb.seed_scene(l=0.9, g=1.6)
    time, sizes = sizes_of(scene, START)
    pace = np.sqrt(0.9 / 1.6)
    expected = [0.9, 0.9, 1.0, 1.0, *[0.9 / pace] * 2, *[1.0 / pace] * 2]
    assert time == pytest.approx(pace)
    np.testing.assert_allclose(sizes, expected)
    np.testing.assert_allclose(recurring_sizes(scene, START), expected[1:])
    weightless, floating = sizes_of(jb.seed_scene(l=0.9, g=0.0), START)
    assert (weightless, floating.hip_vx, floating.omega_1) == (1.0, 0.9, 1.0)
    units = units_of(scene, START)
    np.testing.assert_allclose(
        units.inverse,
        1.0
        / np.array(expected)
        * [*[0.4] * 2, 1.0, 1.0, *[0.4 / np.sqrt(0.4 / 9.8)] * 2, *[1.0 / np.sqrt(0.4 / 9.8)] * 2],
    )
    assert float(units_of(jb.seed_scene(g=0.0), START).time) == 1.0


def test_the_largest_error_is_that_of_a_time_or_of_any_leaf():
    scene, nothing = jb.seed_scene(l=0.9, g=1.6), jb.State(*[np.zeros(2)] * 8)
    pace = np.sqrt(0.9 / 1.6)
    assert relative_to_scene(scene, np.zeros(0), nothing) == 0.0
    assert relative_to_scene(scene, np.array([1e-6, 3e-6]), nothing) == pytest.approx(3e-6 / pace)
    for name, size in (("hip_x", 0.9), ("theta_2", 1.0), ("hip_vz", 0.9 / pace)):
        errors = nothing._replace(**{name: np.array([1e-3, 5e-3])})
        assert relative_to_scene(scene, np.array([1e-6]), errors) == pytest.approx(5e-3 / size)
    unknown = nothing._replace(omega_1=np.array([0.0, np.nan]))
    assert relative_to_scene(scene, np.array([1e-6]), unknown) == np.inf


def test_a_norm_is_the_root_of_the_mean_square_over_all_leaves():
    found = rms_norm({"a": jnp.array([3.0, 4.0]), "b": jnp.asarray(1.0)})
    assert float(found) == pytest.approx(np.sqrt(26.0 / 3.0))
