"""Commands in a second process, against what JAX and LLVM count: nothing is compiled again.

Counted are the compilations that JAX reports, those of single operations among them, and the
modules that lanes give to LLVM.
"""

import json
import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow

COUNTED = """
import atexit, json, sys
import jax
from jaxbiped.compiler.runtime import _machine_code
told, module = [], _machine_code._module

def note(event, _, **about):
    if event.endswith("backend_compile_duration"):
        told.append(about.get("fun_name", event))

def compiled(*given):
    told.append("lanes")
    return module(*given)

_machine_code._module, _machine_code.EFFORT = compiled, 0
jax.monitoring.register_event_duration_secs_listener(note)
atexit.register(lambda: print("COMPILED", json.dumps(told), file=sys.stderr))
from jaxbiped.cli import main
main(sys.argv[1:])
"""
STARTS = "--x theta_swing=-0.5:0.3:3 --y omega_swing=-2:4:2"
CONSTRAINTS = "--duration 0.01 --repeats 1 --integrators rodas4:1e-4 --methods standard"
COMMANDS = {
    "walk": "walk --duration 0.5 --out OUT",
    "rigid walk": "walk --duration 1 --model rigid --out OUT",
    "gait": "gait --out OUT",
    "published walk": "walk --walker garcia --slope 0.01 --duration 10",
    "continue": "continue --model rigid --max-points 2 --out OUT",
    "optimise": "optimise --model rigid --vary d --maximise speed --iterations 1 --basin 16 "
    "--footsteps 4",
    "fit": "fit MEASURED --model rigid --vary d",
    "basin": f"basin {STARTS} --out OUT",
    "rigid basin": f"basin --model rigid {STARTS}",
    "models": "models",
    "constraints": f"constraints {CONSTRAINTS} --out OUT",
    "trade": "trade --duration 0.1 --repeats 1 --out OUT",
    "doctor": "doctor",
}
LANDING = ("walk", "gait")
"""Those that a change waits for: one for each kind of program."""


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name in LANDING else [pytest.mark.nightly])
        for name in COMMANDS
    ],
)
def test_the_second_process_compiles_nothing(name, tmp_path):
    measured = tmp_path / "measured.json"
    measured.write_text(
        json.dumps({"gaits": [{"period_s": [0.44, 1e-3], "step_length_m": [0.19, 1e-3]}]})
    )
    environment = os.environ | {"JAXBIPED_CACHE": str(tmp_path / "cache")}

    def compiled(turn):
        places = {"OUT": str(tmp_path / turn), "MEASURED": str(measured)}
        words = [places.get(word, word) for word in COMMANDS[name].split()]
        ran = subprocess.run(
            [sys.executable, "-c", COUNTED, *words], capture_output=True, text=True, env=environment
        )
        told = [line for line in ran.stderr.splitlines() if line.startswith("COMPILED")]
        assert told, ran.stderr
        return json.loads(told[0].removeprefix("COMPILED "))

    assert compiled("first")
    assert compiled("second") == []
