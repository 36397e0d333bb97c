"""`jaxbiped constraints`, against the methods' own properties."""

import json
import time

import numpy as np
import pytest

from jaxbiped.cli import _constraints as command
from jaxbiped.cli._constraints import ConstraintRun, time_run
from tests.cli.commands import one_line, outputs_of, run
from tests.drawn import assert_is_drawn, points_of


@pytest.mark.slow
def test_compares_methods_and_integrators(capsys, tmp_path, stages_at_once):
    flags = ("--methods", "standard", "described", "--duration", "0.05")
    integrators = ("--integrators", "euler:dt=1e-5", "euler:dt=2e-3")
    outputs = outputs_of(tmp_path, "constraints", *flags, *integrators)
    assert outputs.code == 0
    (figure,) = outputs.figures.values()
    assert_is_drawn(figure, unitless={"method"})
    assert "4 of 4 runs" in capsys.readouterr().err
    assert outputs.numbers["complete"]
    runs = outputs.numbers["runs"]
    ran = [(run["method"], run["dt_s"]) for run in runs]
    assert ran == [(name, dt) for dt in (1e-5, 2e-3) for name in ("standard", "described")]
    marks = points_of(figure.axes[0], "euler, steps of 1e-05 s")[0]
    np.testing.assert_allclose(marks[0, 0], runs[0]["max_violation_m"])
    for each in runs:
        assert (each["integrator"], each["engine"]) == ("euler", "lanes")
        assert each["wall_s_run"] > 0.0
    assert runs[0]["ending"] == runs[1]["ending"] == "walking"
    # A step that the contact's stiffness does not stand is told, not dropped.
    assert runs[2]["ending"] != "walking"
    assert runs[1]["max_violation_m"] < 1e-15 < runs[0]["max_violation_m"]
    assert runs[0]["state_error"] < 1e-2
    assert runs[0]["steps"] == pytest.approx(5000, abs=2)


def _done(method, integrator, seconds):
    return ConstraintRun(
        method=method, integrator=integrator.solver, rtol=integrator.rtol, dt_s=integrator.dt,
        ending="walking", max_violation_m=1e-9,
        max_violation_rate=1e-8, state_error=1e-6, wall_s_run=seconds, steps=100, engine="lanes",
    )  # fmt: skip


def test_rows_come_as_they_are_done_and_ctrl_c_keeps_them(monkeypatch, capsys, tmp_path):
    shown = []

    def compared(scene, start, *, integrators, methods, **options):
        assert len(integrators) == 3
        for method, seconds in zip(methods[:2], (0.5, 0.75), strict=True):
            yield _done(method, integrators[0], seconds)
            shown.append(capsys.readouterr())
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "compare_constraints", compared)
    written = tmp_path / "constraints.json"
    assert run("constraints", "--json", str(written)) == 130
    head, standard = shown[0].out.splitlines()
    (baumgarte,) = shown[1].out.splitlines()
    assert len(head) == len(standard) == len(baumgarte)
    assert standard.split()[0] == "standard"
    assert baumgarte.split()[-2:] == ["0.750", "1.50"]
    assert one_line(capsys)[1] == "jaxbiped: Interrupted: 2 of 21 runs are done."
    told = json.loads(written.read_text())
    assert not told["complete"]
    assert [run["method"] for run in told["runs"]] == ["standard", "baumgarte"]


def test_runs_that_take_long_are_not_repeated(monkeypatch):
    now = iter(range(0, 1000, 3))
    monkeypatch.setattr(time, "perf_counter", lambda: 0.1 * next(now))
    asked = []
    assert time_run(lambda: asked.append(1), repeats=3)[1] == pytest.approx(0.3)
    assert len(asked) == 3
    asked.clear()
    assert time_run(lambda: asked.append(1), repeats=100)[1] == pytest.approx(0.3)
    assert len(asked) == 4
    now = iter([0.0, 0.3, 1.0, 1.1, 2.0, 2.2])
    monkeypatch.setattr(time, "perf_counter", lambda: next(now))
    assert time_run(lambda: None, repeats=3)[1] == pytest.approx(0.1)


@pytest.mark.nightly
def test_walk_tells_of_the_hip(tmp_path):
    flags = ("--formulation", "redundant", "--method", "described", "--duration", "1.3")
    outputs = outputs_of(tmp_path, "walk", *flags)
    assert outputs.code == 0
    assert outputs.numbers["steps"][0]["period_s"] == pytest.approx(0.4415, abs=5e-4)
    held = outputs.numbers["constraints"]
    assert held["method"] == "described"
    assert held["max_violation_m"] < 1e-12
    assert held["max_hip_force_N"] == pytest.approx(150.0, rel=0.05)
    assert (outputs.folder / "strobe.png").exists()
    assert (outputs.folder / "trajectory.nc").exists()
