"""Summary of a gait, against an orbit that is written down: units, errors, what is unknown."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.gait import FoundBy, LinearisedReturn, Slopes, Stability
from jaxbiped.gait._fixed_point_search import FixedPointProblem, Found
from jaxbiped.gait._gait import gait_entries
from jaxbiped.gait._gait_summary import summary_of
from jaxbiped.gait._orbit_derivatives import Orbit
from jaxbiped.gait._return_map_spec import return_map_spec
from jaxbiped.gait._search_provenance import single_stage_origin, warn_of_unknown
from jaxbiped.gait._stability import eigenvalue_errors
from jaxbiped.scene._parameter_access import select_parameters
from jaxbiped.solve._accuracy import Precision
from jaxbiped.variational._solve_to_section import Nodes

NAMES = ("K", "hip_mass")
SIZES = np.array([1e6, 1.0])
"""Of K, and of a mass that is zero."""
RADIUS = np.array([0.3, 0.7])


@pytest.fixture(scope="module")
def summary():
    """The gait of one footstep with given ending; of 0.5 s and 0.2 m, and slopes of its own."""
    scene, start = jb.seed_scene(), jb.seed_state()
    spec = return_map_spec(scene, start, solver="rodas4", engine="lanes", max_solver_steps=9)
    _, active = select_parameters(scene, NAMES)
    slopes = Slopes(np.arange(14.0).reshape(7, 2), np.array([0.1, 2.0]), np.array([[0.4, -1.0]]),
                    np.array([50.0, 8.0]))  # fmt: skip
    point = np.array([float(leaf) for leaf in start[1:]])

    def both(ending):
        zero, whole = np.zeros(()), np.asarray(0)
        begun = np.concatenate([[0.0, 0.0], point])
        last = LinearisedReturn(
            recurring=point, jacobian=np.zeros((7, 9)), monodromy=np.ones((7, 9)),
            velocity=np.zeros(7), period=np.asarray(0.5), period_row=np.zeros(9),
            advance=np.array([0.2]), advance_rows=np.zeros((1, 9)), peak=np.asarray(100.0),
            peak_row=np.zeros(9), code=whole, attempted=np.asarray(321), jumps=whole,
            grazes=np.asarray(2), nodes=Nodes(begun[None], None, begun[None], zero),
        )  # fmt: skip
        coarse = last._replace(period=np.asarray(0.502), peak=np.asarray(97.0))
        pair = jax.tree.map(lambda a, b: np.stack([a, b]), last, coarse)
        found = Found(ending, whole, point, np.asarray(1e-9), pair, np.asarray(7), np.zeros(3),
                      np.asarray(True))  # fmt: skip
        values = np.array([0.5 + 0.5j, 0.5 - 0.5j, 0.1, 0.0, 0.0, 0.0])
        stability = Stability(values, np.full(6, 0.01), np.eye(7)[:, :6], np.asarray(1e-6),
                              np.abs(values[0]), np.asarray(2))  # fmt: skip
        errors = jax.tree.map(lambda slope: 0.01 * np.abs(slope), slopes)
        state = jb.State(np.zeros(()), *point)
        orbit = Orbit(found, state, stability, slopes, errors, RADIUS, 0.1 * RADIUS, SIZES)
        return jax.tree.map(jnp.asarray, orbit)

    problem = FixedPointProblem(spec, scene, active, start, Precision(0.0, 0.0))
    origin, path = single_stage_origin(problem, FoundBy.GUESS), (jnp.zeros((1, 1)), start)
    return jax.jit(lambda ending: summary_of(problem, both(ending), path, NAMES, origin))


def test_sensitivities_are_in_the_units_of_the_parameters(summary):
    gait = summary(jnp.asarray(0))
    np.testing.assert_allclose(gait.sensitivities.period, [0.1e-6, 2.0])
    np.testing.assert_allclose(gait.sensitivities.step_length, [0.4e-6, -1.0])
    by_speed = (np.array([0.4, -1.0]) - 0.4 * np.array([0.1, 2.0])) / 0.5
    np.testing.assert_allclose(gait.sensitivities.speed, by_speed / SIZES)
    np.testing.assert_allclose(gait.sensitivities.spectral_radius, RADIUS / SIZES)
    np.testing.assert_allclose(gait.sensitivities.state.omega_2, [12.0e-6, 13.0])
    np.testing.assert_allclose(gait.sensitivities.state.hip_x, [0.0, 0.0])
    np.testing.assert_allclose(gait.sensitivity_errors.peak_normal, [0.5e-6, 0.08])
    np.testing.assert_allclose(gait.sensitivity_errors.spectral_radius, 0.1 * RADIUS / SIZES)
    # Relative to parameter and measure; a parameter that is zero has none.
    np.testing.assert_allclose(gait.elasticities.period, [0.2, 0.0])
    np.testing.assert_allclose(gait.elasticities.peak_normal, [0.5, 0.0])


def test_measures_and_their_errors_are_those_of_the_return(summary):
    gait = summary(jnp.asarray(0))
    measures, errors = gait.measures, gait.measure_errors
    told = (measures.period, measures.step_length, measures.speed, measures.peak_normal)
    assert tuple(map(float, told)) == pytest.approx((0.5, 0.2, 0.4, 100.0))
    assert float(measures.spectral_radius) == pytest.approx(np.sqrt(0.5))
    told = (errors.period, errors.step_length, errors.speed, errors.peak_normal)
    expected = (0.002, 0.0, 0.4 - 0.2 / 0.502, 3.0)
    assert tuple(map(float, told)) == pytest.approx(expected, abs=1e-12)
    assert float(errors.spectral_radius) == pytest.approx(0.01)
    assert (int(gait.solver_steps), int(gait.grazes), int(gait.evaluations)) == (321, 2, 7)
    assert gait.parameters == NAMES
    assert [quantity.unit for quantity in gait.quantities] == ["N/m^n", "kg"]
    assert gait.critical is jb.gait.Bifurcation.PERIOD_DOUBLING


def test_a_dataset_has_the_units_of_the_state(summary):
    dataset = summary(jnp.asarray(0)).to_dataset()
    units = {name: dataset[f"state_{name}"].attrs["units"] for name in ("theta_2", "omega_2")}
    assert units == {"theta_2": "rad", "omega_2": "rad/s"}


def test_what_never_returned_is_not_a_number_and_at_no_bifurcation(summary):
    lost = summary(jnp.asarray(int(jb.gait.Search.NO_RETURN)))
    assert np.isnan(float(lost.measures.period))
    assert np.isnan(np.asarray(lost.multipliers)).all()
    assert float(lost.measures.state.theta_2) == pytest.approx(0.1655)
    assert lost.critical is jb.gait.Bifurcation.NONE
    assert not bool(lost.stable)
    best = summary(jnp.asarray(int(jb.gait.Search.NOT_CONVERGED)))
    assert float(best.measures.period) == 0.5
    assert not bool(best.stable)


def test_a_gait_that_grazes_a_switch_warns(summary):
    with pytest.warns(RuntimeWarning, match="its sensitivities are not known"):
        warn_of_unknown(summary(jnp.asarray(0)))


def test_of_several_gaits_what_was_not_found_is_unknown_in_every_entry(summary):
    """Numbers, one for each multiplier and one for each parameter and measure alike."""
    alone = gait_entries(summary(jnp.asarray(0)))
    gaits = [summary(jnp.asarray(ending)) for ending in (0, 1, 0)]
    together = gait_entries(jax.tree.map(lambda *leaves: jnp.stack(leaves), *gaits))
    assert {np.ndim(each.values) for each in together.values()} >= {1, 2}
    names = [name for name in alone if name.startswith(("period", "multiplier", "elasticity"))]
    assert len(names) > 6
    for name in names:
        here, expected = together[name], alone[name]
        for values, own in ((here.values, expected.values), (here.errors, expected.errors)):
            if own is not None and not isinstance(own, str):
                np.testing.assert_array_equal(values[0], own)
                np.testing.assert_array_equal(values[2], own)
                assert np.isnan(values[1]).all()


@pytest.mark.parametrize("gap", [1e-9, 1e-6, 1e-3, 1.0])
def test_eigenvalues_part_as_the_root_of_a_change_where_they_are_near(gap):
    """A bar m of an eigenvalue a gap away from its neighbour solves m (1 + m/gap) = what it would
    be of one far away: a change that is small beside the gap counts whole, another by its root."""
    change = 1e-5 * np.eye(2)

    def bars(values):
        found = np.array(values), np.eye(2), np.eye(2)
        return np.asarray(eigenvalue_errors(found, change, np.array(values)))

    (alone, _) = bars([0.5, -1e6])
    for bar in bars([0.5, 0.5 + gap]):
        assert bar * (1.0 + bar / gap) == pytest.approx(alone, rel=1e-9)
