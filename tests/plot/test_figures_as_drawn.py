"""All figures, against a description of them that was looked at: `figures_as_drawn.json`.

What a figure shows is right by the other tests of this folder; here nothing of it changes unseen:
sizes, words, scales, colours, dashes, widths, marks, legends and where every curve runs. After a
change that is wanted, `python -m tests.plot.test_figures_as_drawn` writes the description anew, and
its difference is looked at.
"""

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped import plot
from jaxbiped.continuation import BifurcationCurve, BifurcationPoint, BranchEvent
from tests.plot.described import figure_numbers
from tests.plot.test_basin_marks import _dataset as basin_dataset
from tests.plot.test_basin_marks import _gait as gait_at
from tests.plot.test_basin_marks import _row as gaits_of
from tests.plot.test_basins import AXES, CODES, X, Y, _disc, _fractions
from tests.plot.test_fit_charts import _fit as make_fit
from tests.plot.test_fit_charts import _optimum as make_optimum
from tests.plot.test_gait_charts import _gait as make_gait
from tests.plot.test_parameter_charts import (
    DOUBLING,
    POINTS,
    STOP,
    _doubled,
    branch_point,
    make_branch,
)
from tests.plot.test_pareto_front import make_front, unheld
from tests.plot.test_work_precision import ROWS
from tests.plot.test_work_precision import _run as make_run

PLACES = "at", "from", "box", "curve"
RECORD = Path(__file__).with_name("figures_as_drawn.json")
SEED = dict(K=1e6, c=2e5, n=1.5, mass=2.0)
FRICTION = dict(mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1000.0)


def _basin_of_many_gaits():
    """Two gaits of one cycle, of which one is projected, along a parameter."""
    axes = {"slope": np.array([0.01, 0.02, 0.03]), "theta_swing": np.linspace(0.0, 1.0, 5)}
    second = gait_at(0.8, 1.0)
    rows = [
        gaits_of(gait_at(0.2 + 0.1 * k, 0.0), *[second] * (k == 1), slope=0.01 * (k + 1))
        for k in range(3)
    ]
    return plot.basin(basin_dataset(rows, axes, gait=np.array([[0, 1, 0, 0, 0]] * 3)))


def _refined():
    refined = jb.basins.refine_boundary(_disc, (-1.0, -1.0), (1.0, 2.0), (4, 6), levels=3)
    return plot.refined_basin(refined, mark=(0.0, 0.0), **AXES)


def _events():
    """Bifurcations of all kinds on one branch."""
    kinds = (kind for kind in BranchEvent if kind.name != "NONE")
    return [BifurcationPoint(k, POINTS[i], -1.0 + 0j, 1e-9) for i, k in enumerate(kinds)]


def _radius():
    points = [branch_point(0.02 * k, 0.3 * k, error=0.01 * k) for k in (1, 2, 3)]
    return plot.branch(make_branch(points), "spectral_radius")


def _bifurcation_curves():
    values = np.array([[0.1, 1e5], [0.11, 1e6], [0.12, 1e7]])
    rest = (), np.ones(3), np.zeros(3), (STOP, STOP)
    along = ("slope", "K"), ("rad", "N/m^1.5")
    kinds = BranchEvent.FOLD, BranchEvent.NEIMARK_SACKER
    return plot.bifurcation_curves(
        [BifurcationCurve(kind, *along, values * (1 + k), *rest) for k, kind in enumerate(kinds)]
    )


def _multipliers_along(log=False):
    values = [
        [0.5j, -0.5j, 0.1], [-0.4 + 0.3j, -0.4 - 0.3j, 0.1], [-0.8, 0.1, -0.3], [-4.2, -0.2, 0.1]
    ]  # fmt: skip
    points = [
        branch_point(0.02 * k, 0.0)._replace(multipliers=np.array(row, complex))
        for k, row in enumerate(values, 1)
    ]
    kinds = BranchEvent.PERIOD_DOUBLING, BranchEvent.NEIMARK_SACKER
    events = [BifurcationPoint(kind, points[3], -1.0 + 0j, 1e-9) for kind in kinds]
    return plot.multipliers(make_branch(points, events, log=log))


def _undetermined_fit():
    return make_fit(
        intervals={"K": (-np.inf, 6.18e4), "J": (9.5e-3, 1.05e-2), "d": (0.1, 0.1)},
        undetermined=(),
        at_bounds=("d",),
    )


def _fit_data(count=2):
    points = [branch_point(0.02 * k, 0.5 - k, length=0.1 * k) for k in (1, 2, 3)]
    branch = make_branch(points, log=True)
    seen = [
        jb.identify.MeasuredGait(measures, conditions={"slope": slope})
        for slope, measures in (
            (0.02, {"step_length": (0.1, 0.01)}),
            (0.04, {"step_length": (0.2, 0.01), "period": (0.41, 0.02), "speed": (0.4, 0.01)}),
        )
    ]
    own = float(jb.parameter_values(branch.scene)["J"])
    return plot.fit_data(make_fit(estimates={"J": own}), seen[:count], branch)


def _optimum_of_a_sum():
    """An objective that is no measure: four quantities in two columns."""
    found = make_optimum()
    history = [each._replace(objective=2.0 + k) for k, each in enumerate(found.history)]
    return plot.optimisation(dataclasses.replace(found, history=history, objective=7.0))


def _three_elasticities():
    quantities = tuple(jb.laws.Quantity(name, f"${name[0]}$") for name in ("K", "c", "l", "mass"))
    return plot.elasticities(make_gait(quantities=quantities), ("period", "speed", "peak_normal"))


def _unstable_gait():
    errors = np.array([0.1, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4])
    values = (-1.6, 0.4 + 0.3j, 0.4 - 0.3j, 0.02, 0.0, 0.0)
    return make_gait(values=values, multiplier_errors=errors, bifurcation=np.asarray(2))


def _long_names():
    quantities = tuple(jb.laws.Quantity(f"{k}, shank.stop of the second leg") for k in "Kcl")
    return make_gait(quantities=(*quantities, jb.laws.Quantity("hip mass")))


def _runs():
    return [
        make_run(),
        make_run("index1", max_violation_m=0.0, state_error=2e-7),
        make_run(integrator="euler", by=1e-5, wall_s_run=0.02),
        make_run("index1", "euler", 1e-5, ending="failed", state_error=None),
    ]


def _laws_of_friction():
    own = jb.laws.friction_law_like("bengisu-akay", **FRICTION)
    return plot.friction_law(own, jb.laws.BrownMcPhee.like_seed(own), jb.laws.Viscous(k=3.0))


def _kelvin_voigt(**options):
    return plot.normal_law(jb.laws.normal_law_like("kelvin-voigt", **SEED), **options)


def _bristles():
    return plot.bristle_law(jb.laws.friction_law_like("lugre", **FRICTION), slip_speed=1e-5)


def _paper(draw, columns=1):
    with plot.figure_style("paper", columns=columns):
        return draw()


LABELS = dict(cycle_footsteps=[[1, 1, 1], [1, 1, 3]], gait=[[0, 1, 0], [0, 0, 0]])
BY_HAND = {
    "basin": lambda: plot.basin(CODES, X, Y, mark=(1.5, 0.5), title="A basin", **AXES),
    "basin of gaits": lambda: plot.basin(CODES, X, Y, **LABELS, **AXES),
    "basin along a parameter": _basin_of_many_gaits,
    "basin in a paper": lambda: _paper(lambda: plot.basin(CODES, X, Y, **AXES)),
    "refined basin": _refined,
    "fractions": lambda: plot.basin_fractions([1.0, 10.0, 1e3], _fractions(), name="K", log=True),
    "fractions, stacked": lambda: plot.basin_fractions(
        [1.0, 2.0, 3.0], _fractions(), name="slope", kind="stacked", confidence=0.9
    ),
    "branch": lambda: plot.branch(make_branch(POINTS, _events(), log=True)),
    "branch, radius": _radius,
    "branch, doubled": lambda: plot.branch(
        [make_branch(POINTS, [DOUBLING]), _doubled([BranchEvent.PERIOD_DOUBLING])], "omega_1"
    ),
    "branch, one point": lambda: _paper(lambda: plot.branch(make_branch(POINTS[:1]), "speed")),
    "bifurcation curves": _bifurcation_curves,
    "fit": lambda: plot.fit(make_fit()),
    "fit in a paper": lambda: _paper(lambda: plot.fit(_undetermined_fit())),
    "data of a fit": _fit_data,
    "data of a fit in a paper": lambda: _paper(lambda: _fit_data(1)),
    "optimisation": _optimum_of_a_sum,
    "optimisation in a paper": lambda: _paper(lambda: plot.optimisation(make_optimum())),
    "front": lambda: plot.pareto_front(unheld(make_front(), 1)),
    "front in a paper": lambda: _paper(lambda: plot.pareto_front(make_front())),
    "elasticities": lambda: plot.elasticities(make_gait(), ("period", "peak_normal")),
    "elasticities, long names in a paper": lambda: _paper(
        lambda: plot.elasticities(_long_names(), ("period", "speed", "step_length")), columns=2
    ),
    "elasticities in a paper": lambda: _paper(_three_elasticities, columns=2),
    "multipliers": lambda: plot.multipliers(make_gait()),
    "multipliers, unstable": lambda: plot.multipliers(_unstable_gait()),
    "multipliers in a paper": lambda: _paper(lambda: plot.multipliers(_unstable_gait())),
    "multipliers along a branch": _multipliers_along,
    "multipliers along a branch in a paper": lambda: _paper(lambda: _multipliers_along(True)),
    "orbit": lambda: plot.gait_orbit(make_gait()),
    "work and precision": lambda: plot.work_precision(ROWS, "state", floor=1e-7),
    "constraint methods": lambda: plot.constraint_runs(_runs()),
    "constraint methods in a paper": lambda: _paper(lambda: plot.constraint_runs(_runs())),
    "friction": _laws_of_friction,
    "friction in a paper": lambda: _paper(
        lambda: plot.friction_law(jb.seed_scene(v0=2e-5).friction)
    ),
    "bristles": _bristles,
    "walker": lambda: plot.walker(jb.models.hsu_chen()),
    "walker with feet of two spheres": lambda: plot.walker(jb.models.wisse()),
}
LAWS = {"normal law": _kelvin_voigt, "normal law in a paper": lambda: _paper(_kelvin_voigt)}
OF_A_WALK = {
    "leg angles": plot.leg_angles,
    "time series": lambda *walk: plot.time_series(*walk, "theta_2", "theta_1"),
    "phase portrait": lambda *walk: plot.phase_portrait(*walk, legs=(1, 2)),
    "penetrations": plot.penetrations,
    "contact forces": plot.contact_forces,
    "contact forces in a paper": lambda *walk: _paper(lambda: plot.contact_forces(*walk)),
    "strobe": lambda *walk: plot.gait_strobe(*walk, start=0.5, stop=1.7, count=3),
    "animation": lambda *walk: _still(plot.animate(*walk, frames_per_second=2.0)),
}


def _still(animation):
    """The last frame of an animation, which need not be saved."""
    animation._func(3)
    animation._draw_was_started = True
    return animation._fig


def assert_same(here, there, place, near=0.0):
    """Words are equal; numbers agree to 0.2 %, and places to 0.5 % of their axes."""
    if isinstance(here, dict) and isinstance(there, dict):
        assert sorted(here) == sorted(there), place
        for name in here:
            exact = 5e-3 if name in PLACES else 0.0
            if name == "limits":
                exact = 2e-3 * abs(there[name][1] - there[name][0])
            assert_same(here[name], there[name], f"{place}, {name}", exact)
    elif isinstance(here, list) and isinstance(there, list):
        assert len(here) == len(there), place
        for k, pair in enumerate(zip(here, there, strict=True)):
            assert_same(*pair, f"{place}[{k}]", near)
    elif isinstance(here, float | int) and isinstance(there, float | int):
        close = math.isclose(here, there, rel_tol=2e-3, abs_tol=near)
        assert close or (math.isnan(here) and math.isnan(there)), (place, here, there)
    else:
        assert here == there, place


def _described(name, figure, **options):
    return figure_numbers(figure, data="in a paper" not in name, **options)


def _dumped(described):
    return json.dumps(
        described, ensure_ascii=False, separators=(",", ":"), default=lambda number: number.item()
    )


def _is_as_recorded(name, figure, counted=True):
    recorded = json.loads(RECORD.read_text())[name]
    assert_same(json.loads(_dumped(_described(name, figure, counted=counted))), recorded, name)


@pytest.mark.parametrize("name", BY_HAND)
def test_results_are_drawn_as_recorded(name):
    _is_as_recorded(name, BY_HAND[name]())


@pytest.mark.parametrize("name", LAWS)
def test_a_drop_is_drawn_as_recorded(name):
    _is_as_recorded(name, LAWS[name](), counted=False)


@pytest.mark.parametrize("name", OF_A_WALK)
def test_a_walk_is_drawn_as_recorded(name, seed_walk):
    _is_as_recorded(name, OF_A_WALK[name](*seed_walk), counted=False)


def _write():
    scene = jb.seed_scene()
    walk = jb.simulate(scene, jb.seed_state(), duration=2.0, accuracy="tight")
    described = {name: _described(name, draw()) for name, draw in BY_HAND.items()}
    described |= {name: _described(name, draw(), counted=False) for name, draw in LAWS.items()}
    for name, draw in OF_A_WALK.items():
        described[name] = _described(name, draw(scene, walk), counted=False)
    lines = (f"{_dumped(n)}: {_dumped(x)}" for n, x in described.items())
    RECORD.write_text("{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    _write()
