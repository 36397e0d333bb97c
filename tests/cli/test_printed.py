"""What commands print, against texts that were looked at: `printed.txt`.

Nothing is simulated: the results are written down here, with numbers of all sizes and some that are
not known. After a change that is wanted, `python -m tests.cli.test_printed` writes the texts anew,
and their difference is looked at.
"""

import contextlib
import dataclasses
import io
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped._files import strict_json
from jaxbiped.basins import FatalShock
from jaxbiped.cli import COMMANDS, _basin, _constraints, _continue, _gait, _models, _trade, _walk
from jaxbiped.cli import _parameter_search as _search
from jaxbiped.cli._options import OutputOptions
from jaxbiped.cli._report import Report, columns, table, words
from jaxbiped.cli._scene_options import SceneOptions
from jaxbiped.cli._start_options import StartOptions
from jaxbiped.continuation import BifurcationPoint, BranchEvent, NearestBifurcation
from jaxbiped.optimise import Certificate
from jaxbiped.optimise._certificate import OtherEngine, PushedWalk
from jaxbiped.trade import Row, Truth
from tests.cli.commands import run
from tests.plot.test_fit_charts import _fit as make_fit
from tests.plot.test_fit_charts import _optimum as make_optimum
from tests.plot.test_gait_charts import _gait as make_gait
from tests.plot.test_parameter_charts import DOUBLING, POINTS, make_branch

WALL = {"import": 1.23, "compile": 4.56, "run": 0.789, "total": 5.67}


def _walk_lines(report, numbers=None, error=None, **rest):
    step = {"leg": "1", "time_s": 0.44, "period_s": 0.4412345, "length_m": 0.179, "speed_m_s": 0.4}
    own = {"peak_normal_N": 310.26, "max_penetration_m": 6.9e-4, "double_support_s": 1.34e-4}
    solver = {"name": "rodas4", "engine": "lanes", "accepted": 120, "rejected": 7, "attempted": 90}
    known = {
        "ending": "walking",
        "duration_s": 3.14159,
        "slope_rad": 0.02,
        "energy_residual_J": -1.25e-7,
        "gravity_work_J": 0.98765,
        "solver": solver,
        "wall_s": WALL,
        "warnings": ["the first", "the second"],
        "steps": [step | own, step | own | {"leg": "2", "time_s": 0.881}],
    }
    _walk._say(report, known | (numbers or {}) | rest, SimpleNamespace(error=error))


def _rigid_walk_lines(report):
    steps = [
        {"time_s": 0.01 * k, "period_s": 0.4412, "length_m": 0.18, "speed_m_s": 0.408}
        for k in range(1, 27)
    ]
    cost = {"cost_of_transport": 0.0212345, "motor_work_J": 12.3456, "warnings": []}
    _walk_lines(report, {"model": "rigid", "steps": steps, "footsteps": 5000} | cost)


def _redundant_walk_lines(report):
    held = dict(
        method="described", max_violation_m=1.23e-13, max_violation_rate=4.5e-12,
        max_hip_force_N=151.6, start_correction_m=1e-9, start_correction_m_s=2e-8,
    )  # fmt: skip
    _walk_lines(report, constraints=held, warnings=[], steps=[])


def _gait_lines(report):
    wide = make_gait(bifurcation=np.asarray(2))
    one = np.ones(4)
    state = jb.State(*(0.5 * one for _ in range(8)))
    values = wide.elasticities._replace(state=state)
    gait = dataclasses.replace(
        wide, evaluations=np.asarray(3), elasticities=values, unit_multiplier_error=np.asarray(1e-9)
    )
    known = {
        "period_s": 0.44083491, "step_length_m": 0.179227, "speed_m_s": 0.40656,
        "peak_normal_N": 312.3456, "residual": 1.23e-9, "solver_steps": 700, "engine": "lanes",
        "unit_multiplier_error": 1e-9, "spectral_radius": 0.4570644, "stable": True,
        "search": "found by the start", "wall_s": WALL,
        "elasticities": _gait._by_parameter(gait.parameters, gait.elasticities),
    }  # fmt: skip
    _gait._print(report, known, gait)
    driven = {"assumptions": dict(needed_friction=0.25, impact_friction=0.5, least_normal_N=2.0,
              lowest_clearance_m=-0.002, lifting_m_s=0.1)}  # fmt: skip
    driven |= {"cost_of_transport": 0.02, "motor_work_J": 0.5, "elasticities": {}}
    calm = dataclasses.replace(
        gait,
        bifurcation=np.asarray(0),
        multipliers=np.array([np.inf, -0.5]),
        multiplier_errors=np.array([np.nan, 1e-3]),
    )
    _gait._print(report, known | {"stable": False} | driven, calm)


def _failure_lines(report):
    numbers = {"residual": 0.0123, "search": "searched", "ending": "not converged",
               "walk_ending": "fell forward", "state": {"hip_x": 0.1, "hip_z": None}}  # fmt: skip
    lost = SimpleNamespace(evaluations=np.asarray(12), walk_ending=np.asarray(1))
    report.say(_gait._failure(numbers, lost))
    once = SimpleNamespace(evaluations=np.asarray(1), walk_ending=np.asarray(0))
    report.say(_gait._failure(numbers | {"residual": None}, once))


def _branch_lines(report):
    limit = BifurcationPoint(BranchEvent.LIMIT, POINTS[3], 0.5 + 0.25j, 1e-3)
    _continue._print(report, make_branch(POINTS, [DOUBLING, limit]), WALL)
    many = [POINTS[0]._replace(value=0.01 * k) for k in range(1, 31)]
    _continue._print(report, make_branch(many), WALL)


def _optimum_lines(report):
    optimum = make_optimum()
    _search._print(report, optimum.scene, optimum, "speed")
    report.say(*_search._certificate_lines(_certificate(optimum)))
    known = optimum.known._replace(beyond_range=frozenset({"step_length"}))
    bare = dataclasses.replace(optimum, history=[], known=known)
    _search._print(report, bare.scene, bare, "speed")
    nothing = _certificate(optimum)._replace(
        basin=None, fatal_push=None, walk=None, other_engine=None, nearest_bifurcations=(),
        failed={}, stable=False,
    )  # fmt: skip
    report.say(*_search._certificate_lines(nothing))


def _certificate(optimum):
    near = NearestBifurcation("slope", BranchEvent.FOLD, 0.0312345, 1.5, 1.0 + 0j, 1e-5)
    push = FatalShock(0.123456, np.array([0.1, -0.2]), *[np.zeros(2), 1, np.zeros(2)], *[0.0] * 5)
    return Certificate(
        optimality=optimum.optimality._replace(residual=1.5e-6, error=2.5e-7, excess=0.0),
        multipliers=np.array([0.4 + 0.3j, 0.4 - 0.3j, 0.1, 0.01]),
        multiplier_errors=np.array([1e-4, 2e-4, 3e-5, 4e-6]),
        unit_multiplier_error=1e-8,
        stable=True,
        sensitivity_norm=(1.2345, 1e-3),
        basin=jb.basins.Fraction(0.75, 0.21, 0.98, 3),
        fatal_push=push,
        walk=PushedWalk(0.01, 20, 20, 1e-5, True),
        other_engine=OtherEngine("xla", True, 1e-9, 2e-9, 3e-9),
        nearest_bifurcations=(
            near,
            near._replace(kind=None, along="d", value=np.nan),
            near._replace(along="mu", ratio=np.nan),
        ),
        failed={"basin": "interrupted"},
    )


def _basin_lines(report):
    gait = {"cycle_footsteps": 1, "duration_s": 0.4408349, "step_length_m": 0.179227,
            "multipliers": [[0.3, 0.4]], "radius": None, "parameters": {}}  # fmt: skip
    numbers = {
        "counts": {"walking period-1": 30, "fell forward": 33},
        "fractions": {"walking period-1": [0.476, 0.358, 0.597], "fell forward": [0.524, 0.4, 0.6]},
        "gaits": [gait, gait | {"radius": 0.0123456, "parameters": {"slope": 0.02, "K": 1e6}}],
        "starts": 63, "labelled_in_this_run": 21, "starts_per_s": 1234.5, "mean_footsteps": 12.34,
        "solver_steps": 6300, "engine": "lanes",
    }  # fmt: skip
    _basin._print(report, numbers)
    errors = dict(starts=63, wanted=1e-2, relabelled=4, changed=1, in_doubt=2, wrong=1e-3,
                  wrong_high=2e-2, rtol=1e-6, met=True)  # fmt: skip
    _basin._print(report, numbers | {"gaits": [], "label_errors": errors})


def _constraint_lines(report):
    run = _constraints.ConstraintRun(
        method="standard", integrator="rodas4", rtol=1e-6, dt_s=None, ending="walking",
        max_violation_m=1e-9, max_violation_rate=2e-8, state_error=3e-6, wall_s_run=0.5, steps=100,
        engine="lanes",
    )  # fmt: skip
    other = run._replace(method="index1", wall_s_run=0.75)
    euler = run._replace(method="index1", integrator="euler", rtol=None, dt_s=1e-5)
    report.say(*(_constraints._line([run, other, euler][:k]) for k in (1, 2, 3)))


def _trade_lines(report):
    errors = {"state": 2e-5, "step_time": 3e-6, "energy": None}
    rows = [
        Row("rodas4p (lanes)", "draft", "ok", errors, 0.01, 0.02, 1.5, 321, 1),
        Row("rodas4p (lanes)", "tight", "ok", {"state": 1e-9}, 0.1, 0.3, None, 3210, 1),
        Row("rodas5p (xla)", "tight", "not installed", {}),
    ]
    _trade._say(report, "walk", rows, Truth({}, {}, {"state": 1e-12, "energy": None}))
    _trade._say(report, "gait", [], None)


def _table_lines(report):
    rows = [[str(k), "x" * k] for k in range(7)]
    report.say(table(["n", "marks"], rows, most=5))
    report.say(columns({"a": "{0[0]:.2f}", "b": "{0[1]}"}, [(1.0, None), (np.nan, "b")]))
    report.say(words("{0.x:.3f} of {0.y}", SimpleNamespace(x=1.23456, y=np.inf)))
    report.wrote(["a.png", "b.png"])


def _model_lines(report):
    stiff = {"K": {"value": 1e6, "unit": "N/mⁿ"}, "n": {"value": 1.5, "unit": "–"}}
    walker = {"name": "seed", "words": "two legs", "states": 8, "operations": 321}
    law = {"name": "hertz", "operations": 300, "parameters": stiff}
    _models._print(
        report,
        {
            "walkers": [walker | {"bodies": ["1", "2"], "parameters": stiff}],
            "normal": [law, law | {"name": "ristow-schafer", "parameters": {}}],
            "friction": [law | {"name": "viscous"}],
            "actuation": [
                {"name": "hip-spring", "units": {"k": "N·m/rad", "b": "N·m·s"}},
                {"name": "push-off", "units": {}},
            ],
            "rungs": [{"name": "rigid", "states": 5, "operations": 99}],
        },
    )


def _number_lines(report):
    """What programs read."""
    optimum = make_optimum()
    limit = BifurcationPoint(BranchEvent.LIMIT, POINTS[3], 0.5 + 0.25j, 1e-3)
    for numbers in (
        _continue.branch_numbers(make_branch(POINTS[2:4], [DOUBLING, limit])),
        _search._optimum_numbers(optimum, _certificate(optimum), "speed", "maximise"),
    ):
        report.say(strict_json(numbers))


def _option_lines(report):
    """Every option of every command with its default."""
    for group in (OutputOptions, SceneOptions, StartOptions):
        report.say(group.__name__, *(f"    {line}" for line in _defaults_of(group)))
    for name, command in COMMANDS.items():
        if command is not None:
            report.say(name, *(f"    {line}" for line in _defaults_of(command)))


def _defaults_of(kind):
    for field in dataclasses.fields(kind):
        group = field.default_factory
        if group in (OutputOptions, SceneOptions, StartOptions):
            yield group.__name__
        elif field.default is dataclasses.MISSING and group is not dataclasses.MISSING:
            yield from _defaults_of(group)
        else:
            default = "needed" if field.default is dataclasses.MISSING else repr(field.default)
            yield f"{field.name} = {default}"


PRINTED = {
    "walk": _walk_lines,
    "rigid walk": _rigid_walk_lines,
    "redundant walk": _redundant_walk_lines,
    "gait": _gait_lines,
    "lost gait": _failure_lines,
    "branch": _branch_lines,
    "optimum": _optimum_lines,
    "basin": _basin_lines,
    "constraints": _constraint_lines,
    "trade": _trade_lines,
    "tables": _table_lines,
    "models": _model_lines,
    "numbers": _number_lines,
    "options": _option_lines,
}
RECORD = Path(__file__).with_name("printed.txt")


def printed(name):
    with contextlib.redirect_stdout(io.StringIO()) as told:
        PRINTED[name](Report(None))
    return "".join(f"{line.rstrip()}\n" for line in told.getvalue().splitlines())


def _written():
    return "".join(f"===== {name}\n{printed(name)}" for name in PRINTED)


@pytest.mark.parametrize("name", PRINTED)
def test_a_command_prints_what_was_looked_at(name):
    recorded = RECORD.read_text(encoding="utf-8").split(f"===== {name}\n")[1]
    assert printed(name).rstrip() == recorded.partition("\n=====")[0].rstrip()


def test_what_a_fit_leaves_open_is_printed(tmp_path, capsys, monkeypatch):
    path = tmp_path / "measured.json"
    path.write_text('{"gaits": [{"period_s": [0.44, 0.001]}]}')
    open_ends = dict(undetermined=("d",), one_sided=("J", "K"), at_bounds=("K",))
    for changes, lines in (
        (
            open_ends,
            [
                "these data do not determine d",
                "limited on one side only: J, K",
                "held by a bound: K",
            ],
        ),
        (dict(undetermined=(), at_bounds=()), []),
    ):
        monkeypatch.setattr(jb, "fit_gait", lambda *_, changes=changes, **__: make_fit(**changes))
        assert run("fit", path, "--vary", "K,J,d") == 0
        assert capsys.readouterr().out.splitlines() == [
            "parameter    unit  estimate  standard error  95 % from       to",
            "        K   N/m^n     60000             600      58800    61800",
            "        J  kg m^2      0.01          0.0002     0.0095   0.0105",
            "        d       m       0.1         unknown    unknown  unknown",
            "converged after 9 scenes; chi squared 5.25 at 2 degrees of freedom (p = 0.072)",
            *lines,
        ]


if __name__ == "__main__":
    RECORD.write_text(_written(), encoding="utf-8")
