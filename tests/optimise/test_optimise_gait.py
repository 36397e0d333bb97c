"""Optimisation of a gait: against a grid, through lost gaits, resumed, interrupted; bad inputs."""

import dataclasses

import jax.tree_util as jtu
import numpy as np
import optax
import pytest

import jaxbiped as jb
from tests.cli.commands import interrupt_after

pytestmark = pytest.mark.slow
RIGID = jb.ladder()["rigid"]
LEG = {"d": (0.08, 0.12), "r": (0.06, 0.1)}


def best_of(**options):
    return jb.optimise_gait(RIGID, **{"vary": LEG, "maximise": "speed"} | options)


def test_an_optimum_of_two_variables_is_that_of_a_grid():
    """Peak force against speed: inside the bounds of one variable; constrained by the radius."""
    weights = {"peak_normal": 1.0, "impact_loss": 40.0, "speed": -20.0}
    vary = {"d": (0.05, 0.15), "J": (0.004, 0.03)}
    count = 9
    d, J = (np.linspace(*bounds, count) for bounds in vary.values())
    grid = jb.gait_sweep(RIGID, {"d": d, "J": J}, parameters=(), radius_sensitivities=False)
    weight = float(RIGID.walker.total_mass * RIGID.ground.g)
    losses = weight * np.sin(float(RIGID.ground.slope)) * grid.step_length
    total = (grid.peak_normal + 40.0 * losses - 20.0 * grid.speed).values
    allowed = np.isfinite(total)
    free = best_of(vary=vary, maximise=None, minimise=weights)
    held = best_of(
        vary=vary, maximise=None, minimise=weights, subject_to={"spectral_radius": (None, 0.45)}
    )
    for best, inside in ((free, allowed), (held, allowed & (grid.spectral_radius.values <= 0.45))):
        assert best.outcome in (jb.optimise.Outcome.CONVERGED, jb.optimise.Outcome.CORNER)
        least = np.min(total[inside])
        # No point of the grid is better, and one of its neighbours is nearly as good.
        assert best.objective <= least + 1e-9
        k, j = np.unravel_index(np.argmin(np.where(inside, total, np.inf)), total.shape)
        spans = [(b[1] - b[0]) / (count - 1) for b in vary.values()]
        assert abs(best.variables["d"] - d[k]) <= 2.0 * spans[0]
        assert abs(best.variables["J"] - J[j]) <= 2.0 * spans[1]
    assert held.known.values["spectral_radius"] <= 0.45 * (1.0 + 1e-6)


@pytest.mark.nightly
def test_level_ground_is_walked_at_the_least_cost():
    """From nothing, held by a grid of gaits at the speed that is asked for."""
    walker, ground = RIGID.walker, jb.Ground(slope=0.0, g=RIGID.ground.g)
    level = jb.RigidScene(walker, ground, jb.actuation.PushOff(0.1))
    best = jb.optimise_gait(
        level,
        vary={"impulse": (0.05, 0.2), "d": (0.06, 0.12)},
        minimise="cost_of_transport",
        subject_to={"speed": (0.28, 0.28)},
    )
    assert best.outcome is jb.optimise.Outcome.CONVERGED
    assert best.known.values["speed"] == pytest.approx(0.28, rel=1e-6)
    assert repr(best).startswith("Optimum(converged, objective=0.00")
    impulses = np.linspace(0.08, 0.12, 9)
    for d in (0.9 * best.variables["d"], 1.1 * best.variables["d"]):
        other = jb.with_parameters(level, {"d": d})
        grid = jb.gait_sweep(
            other, {"impulse": impulses}, parameters=(), radius_sensitivities=False
        )
        # Work of the push-off is found by the speed alone: interpolate the impulse that has it.
        (impulse,) = np.interp([0.28], grid.speed.values, impulses)
        same = jb.with_parameters(other, {"impulse": impulse})
        gait = jb.find_gait(same, parameters=(), radius_sensitivities=False)
        walk = jb.rigid_walk(same, gait.measures.state, footsteps=2, max_arrivals=2)
        assert jb.measure.cost_of_transport(same, walk).cost[-1] > best.objective


def test_optax_descends_within_the_bounds():
    best = best_of(optimiser="optax", iterations=120)
    sure = best_of()
    assert best.objective == pytest.approx(sure.objective, rel=1e-2)
    own = best_of(optimiser=optax.sgd(2.0), iterations=20)
    assert own.objective > float(best.history[0].objective)


def test_an_equality_is_kept():
    best = best_of(subject_to="step_length=0.19")
    assert best.known.values["step_length"] == pytest.approx(0.19, rel=1e-6)


@pytest.mark.parametrize("optimiser", ["trust-region", "slsqp"])
def test_a_lost_gait_turns_the_search_back(optimiser):
    """On the steepest of these slopes no search finds a gait, on gentler ones the best lies."""
    steep = {"vary": {"slope": (0.01, 1.4)}, "maximise": "peak_normal"}
    best = best_of(optimiser=optimiser, **steep)
    assert best.lost > 0
    assert best.outcome is jb.optimise.Outcome.CONVERGED
    assert best.objective > best.history[0].objective
    for share in (0.998, 1.002):
        beside = jb.with_parameters(RIGID, {"slope": share * best.variables["slope"]})
        how = dict(parameters=(), radius_sensitivities=False)
        other = jb.find_gait(beside, best.gait.measures.state, **how)
        assert other.outcome is jb.gait.Search.FOUND
        assert float(other.measures.peak_normal) < best.objective


def test_where_no_gait_exists_the_last_one_before_is_the_best():
    """Level ground gives a passive walker no energy: the slowest gait is on the least slope."""
    slow = {"vary": {"slope": (-0.01, 0.03)}, "maximise": None, "minimise": "speed"}
    best = best_of(iterations=20, **slow)
    assert best.lost > 0
    assert 0.0 < best.variables["slope"] < 1e-3
    assert best.gait.outcome is jb.gait.Search.FOUND
    assert best.objective == pytest.approx(float(best.gait.measures.speed), rel=1e-6)


def test_a_gait_without_a_fold_is_no_lost_gait(tmp_path):
    """A rigid walker has no fold: a bound is met, and as an objective it is told as what it is."""
    options = {"vary": {"d": (0.08, 0.12)}, "iterations": 3}
    bound = best_of(subject_to="fold_distance>0.1", **options)
    assert bound.lost == 0
    assert bound.known.beyond_range == ("fold_distance",)
    assert bound.objective > bound.history[0].objective
    assert all(each.beyond_range == ("fold_distance",) for each in bound.history)
    path, runs = tmp_path / "runs.jsonl", []
    for _ in range(2):  # the second time as kept in the store
        best = best_of(maximise="fold_distance", store=path, **options)
        runs.append(best)
        assert best.outcome is jb.optimise.Outcome.BEYOND_RANGE
        assert str(best.outcome) == "beyond range"
        assert best.message.endswith("fold_distance: none from 0.0025 to 0.16 rad.")
        assert best.known.beyond_range == ("fold_distance",)
    first, again = (best.known for best in runs)
    jtu.tree_map(np.testing.assert_array_equal, again, first)


def test_restarts_are_searched_as_one_batch():
    best = best_of(restarts=1, seed=3, iterations=8)
    assert best.objective >= best_of().objective - 1e-6
    assert best.evaluations > 8


def test_a_store_is_resumed_where_it_was(tmp_path):
    path = tmp_path / "runs.jsonl"
    whole = best_of(subject_to="step_length<0.19")
    some = best_of(subject_to="step_length<0.19", iterations=3, store=path)
    lines = len(path.read_text().splitlines())
    assert lines == 1 + some.evaluations
    # A line that a killed run left half-written is passed over.
    with path.open("a") as file:
        file.write('{"u": [0.1')
    again = best_of(subject_to="step_length<0.19", store=path)
    assert again.variables == whole.variables
    assert again.evaluations == whole.evaluations
    assert len(path.read_text().splitlines()) == 2 + again.evaluations
    for other in (
        {"vary": {"d": (0.08, 0.13)}},
        {"accuracy": "tight"},
        {"subject_to": "spectral_radius<0.4"},
        {"subject_to": None},
        {"scatter": {"l": 0.01}},
    ):
        with pytest.raises(jb.ArgumentError, match="another problem"):
            best_of(**{"subject_to": "step_length<0.19"} | other, store=path)
    # Another bound of the same measure, another design to begin from: what is kept serves them.
    other_way = best_of(subject_to="step_length<0.185", store=path)
    assert other_way.objective == pytest.approx(
        best_of(subject_to="step_length<0.185").objective, rel=1e-9
    )


def test_a_store_is_of_the_laws_and_rules_of_its_scene(tmp_path):
    """Scenes whose numbers are all the same."""
    seed = jb.seed_scene()
    numbers = {f.name: getattr(seed.friction, f.name) for f in dataclasses.fields(seed.friction)}
    others = (
        dataclasses.replace(seed, friction=jb.laws.SmoothBengisuAkay(**numbers)),
        dataclasses.replace(seed, clearance=jb.laws.AlwaysTouching()),
        jb.with_parameters(seed, {"mu_static": 0.51}),
    )

    def begin(scene):
        path, vary = tmp_path / "a", {"d": (0.08, 0.12)}
        return jb.optimise_gait(scene, vary=vary, maximise="speed", iterations=1, store=path)

    begin(seed)
    for other in others:
        with pytest.raises(jb.ArgumentError, match="another problem"):
            begin(other)
    # What is varied takes other values in every design.
    known = len((tmp_path / "a").read_text().splitlines())
    begin(jb.with_parameters(seed, {"d": 0.11}))
    assert len((tmp_path / "a").read_text().splitlines()) > known


@pytest.mark.nightly
def test_a_front_keeps_the_evaluations_of_all_its_points(tmp_path):
    options = {"vary": {"d": (0.05, 0.2)}, "maximise": "speed", "subject_to": "step_length<0.3",
               "against": "spectral_radius", "bounds": [0.5, 0.45]}  # fmt: skip
    plain = jb.optimise.pareto_front(RIGID, **options)
    for _ in range(2):
        front = jb.optimise.pareto_front(RIGID, **options, store=tmp_path / "a")
        np.testing.assert_allclose(front.values("speed"), plain.values("speed"), rtol=1e-9)


def test_ctrl_c_keeps_the_best(monkeypatch):
    interrupt_after(monkeypatch, 3)
    best = best_of()
    assert best.outcome is jb.optimise.Outcome.INTERRUPTED
    assert best.objective >= best.history[0].objective


def test_a_start_outside_the_bounds_is_moved_onto_them():
    best = best_of(vary={"d": (0.11, 0.12)}, iterations=1)
    assert best.history[0].variables["d"] == pytest.approx(0.11)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"vary": {"q": (0.0, 1.0)}}, r"vary = 'q'"),
        ({"vary": {}}, r"at least one parameter"),
        ({"vary": {"d": (0.2, 0.1)}}, r"bounds of d = \(0.2, 0.1\) are empty"),
        ({"vary": {"m": (-1.0, 1.0)}}, r"m = -1"),
        ({"maximise": "beauty"}, r"maximise = 'beauty'"),
        ({"maximise": "slip_distance"}, r"roll without slip"),
        ({"minimise": "speed"}, r"either maximise or minimise"),
        ({"subject_to": ["speed<0.4", "speed>0.5"]}, r"contradict each other"),
        ({"subject_to": "speed"}, r"is not understood"),
        ({"subject_to": "speed<inf"}, r"subject_to = inf"),
        ({"subject_to": {"speed": (None, np.nan)}}, r"subject_to\['speed'\] = nan"),
        ({"subject_to": {"speed": (None, None)}}, r"None for none"),
        ({"subject_to": "speed<0.5", "optimiser": "optax"}, r"not allowed with optax"),
        ({"optimiser": "magic"}, r"optimiser = 'magic'"),
        ({"iterations": 0}, r"iterations = 0"),
    ],
)
def test_bad_inputs_are_refused_by_one_sentence(options, sentence):
    with pytest.raises(jb.ArgumentError, match=sentence):
        best_of(**options)


def test_a_start_without_a_gait_is_refused():
    uphill = jb.with_parameters(RIGID, {"slope": -0.1})
    with pytest.raises(jb.ArgumentError, match="the design to start from has no gait"):
        jb.optimise_gait(uphill, vary={"d": (0.09, 0.11)}, maximise="speed")
