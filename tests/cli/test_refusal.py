"""What the command line refuses, against one sentence on stderr and exit code 2."""

import json
from pathlib import Path

import jax
import numpy as np
import pytest

from jaxbiped.cli import Report, main, one_sentence
from tests.cli.commands import refused

MOVED = "the study of extreme cases is experiments/extremes.py in jaxbiped's repository."


def _rows(table):
    """Command lines, and words that stand in the sentence that refuses each."""
    return [tuple(line.split(" | ")) for line in table.strip("\n").splitlines()]


MORE = ("", " --quick --json -", " --help")
EARLY = _rows("""
walk --slop 3 | --slop | perhaps you meant --slope
walk --slope abc | --slope = 'abc' is not a number.
walk --hip-z abc | --hip-z = 'abc' is not a number.
basin --samples 1.5 | --samples = '1.5' is not a whole number.
basin --chunk many | --chunk = 'many' is not a whole number.
walk --out | --out | missing value
gait --format png --format pdf | --format is given 2 times: give all its values after one.
wlak | wlak | walk, gait, continue, optimise, fit, basin
 | walk, gait, continue, optimise, fit, basin
walk --duration inf | duration = inf | finite
walk --model rigid --duration inf | duration = inf | finite
walk --duration 0 | duration | 0 | above 0
walk --max-solver-steps 0 | max_solver_steps = 0 | whole number above 0
walk --solver euler9 | solver | euler9 | rodas4
walk --n 0 | n = 0 is not allowed: it must be at least 1.
walk --set K=abc | K must be a number | 'abc'
walk --set =3 | set = '=3' | name=value
walk --set xi | set = 'xi'
walk --model rigid --method index1 | method = index1 | rigid
walk --method index1 | method = index1 | --formulation redundant
walk --r 0.5 | l = 0.4 and r = 0.5 | l must be at least r
walk --l 0.05 | l | 0.05 | r = 0.08
walk --set K=1e6 --K 2e6 | K = 2e+06 | set = 'K=1e+06' | one of them
walk --accuracy draft --rtol 1e-8 | rtol = 1e-08 | accuracy = draft
walk --dt 1e-6 --rtol 1e-8 | rtol = 1e-08 | dt = 1e-06
walk --rtol -1 | rtol | -1 | above 0
walk --json ~/no/such | no/such' cannot be written
walk --json /no/such/folder/x.json | --json | /no/such/folder/x.json | folder
walk --theta-1 nan | theta_1 | nan | finite
walk --K -1 | K | -1 | above 0
walk --model soft | model = 'soft'
walk --walker three-legs | walker = 'three-legs' | with-torso, garcia, | or FILE.py:NAME
walk --walker nowhere.py:w | nowhere.py:w' cannot be read
gait --walker kneed --l 0.5 | l = 0.5 is not allowed with walker = 'kneed'
walk --state theta_1 | write name=value
walk --standing 2 | standing = '2' is not allowed without state
walk --normal hertzz | normal = 'hertzz'
walk --model rigid --K 5 | K = 5.0 is not allowed with model
walk --formulation maximal | formulation = 'maximal'
walk --formulation redundant --method glue | method = 'glue'
walk --formulation redundant --model rigid | formulation = redundant
walk --formulation redundant --orientation up | orientation = 'up'
gait --footsteps -2 | footsteps = -2 | whole number above 0
gait --footsteps 0 | footsteps | 0 | above 0
gait --friction glue | friction = 'glue'
gait --section lunch | section | lunch | mid-stance
gait --accuracy nonsense | accuracy | nonsense | balanced, tight
gait --K -1 | K | -1 | above 0
gait --json /no/such/folder/x.json | --json | /no/such/folder/x.json | folder
gait --method index1 | method = index1 is not allowed with formulation
gait --hip-spring k | write name=value
continue --footsteps 0 | footsteps = 0
continue --accuracy fast | accuracy = 'fast'
basin --x theta_swing=0.1:0.1:4 | axis 'theta_swing=0.1:0.1:4' is empty
basin --x theta_swing=0:1:0 | = 0 is not allowed
basin --x theta_swing | write name=first:last:count
basin --x theta_swing=0:nan:3 | is empty
basin --starts nowhere.csv --x g=1:2:3 | give one or the other
basin --formulation redundant | formulation = "redundant" is not allowed for a basin
basin --footsteps 0 | footsteps = 0
basin --accuracy high | accuracy = 'high' is not known
basin --workers 0 | workers = 0
basin --chunk 0 | chunk = 0
basin --samples 0 | samples = 0
basin --sampling dice --samples 4 | sampling = 'dice' is not known
constraints --integrators euler:fast | write SOLVER:TOLERANCE or SOLVER:dt=STEP
constraints --integrators euler | integrator = 'euler'
constraints --methods glue | methods = 'glue'
constraints --repeats 0 | repeats = 0 is not allowed
constraints --duration -1 | duration = -1 is not allowed
constraints --model rigid | compliant and minimal are compared
trade --model rigid | compliant and minimal are measured
trade --formulation redundant | compliant and minimal are measured
trade --duration -1 | duration = -1
trade --repeats 0 | repeats = 0
optimise --vary d --optimiser magic | optimiser = 'magic'
fit none.json --vary J | none.json
walk --slope 2 | slope = 2
walk --dt 0 | dt = 0 | above 0
gait --engine gpu | engine = 'gpu'
continue --from nan | from = nan | finite
models --json /nowhere/models.json | --json | /nowhere/models.json
constraints --json /nowhere/constraints.json | --json | /nowhere/constraints.json
walk --set foo=3 | parameter = 'foo'
walk --walker kneed --m 2 | m = 2.0 is not allowed with walker = 'kneed'
walk --state theta_1=x | theta_1 must be a number
walk --state theta_1=0.1 --theta-1 0.2 | theta_1 is given twice
walk --clearance never | clearance = 'never'
walk --model rigid --clearance always-touching | clearance = always-touching
gait --hip-spring q=1 | 'q' is not known: choose one of k, b, theta_0
gait --hip-spring b=1 | hip-spring needs k=value
gait --hip-spring k=-1 | k = -1
gait --hip-torque torque=much | torque must be a number, and 'much' is not a number
continue --along slop | along = 'slop' is not known
continue --from 0.1 --to 0.1 | the range is empty
basin --x knee=0:1:3 | coordinate = 'knee' is not known
basin --starts nowhere.csv | starts = 'nowhere.csv' cannot be read (no such file
optimise --maximise speed --model rigid --vary q | vary = 'q' is not known
optimise --maximise speed --model rigid --vary d=0.2 | write d=low:high
continue --along slpe | along = 'slpe' is not known | perhaps slope is meant
continue --along slope --from 1deg --to 60mm | '60mm' is not a number in rad, mrad, deg
continue --from abc | 'abc' is not a number
continue --model rigid --along K | along = 'K' is not known: choose one of m, J
basin --x foo=0:1:3 | coordinate = 'foo' is not known: choose one of theta_stance
basin --more foo=0:1:3 | 'foo' is not known
basin --x theta_swing=-30cm:45deg:3 | axis 'theta_swing=-30cm:45deg:3' | theta_swing=-30deg:5deg:200
optimise --vary d --maximise speeed | maximise = 'speeed' is not known | perhaps speed is meant
optimise --vary d --minimise raduis | minimise = 'raduis' is not known
optimise --vary d --maximise speed --subject-to 'speeed<1' | subject_to = 'speeed' is not known
optimise --vary d --maximise speed --front 'speeed<1:2:3' | front = 'speeed' is not known
optimise --vary d --maximise speed --front 'period=1:2:3' | a measure with < or >
optimise --vary d --maximise speed --front 'period<2:1:3' | is empty
optimise --vary d --maximise speed --search alone | search = 'alone' is not known
optimise --vary d=5cm:2kg --maximise speed | '2kg' is not a number in m, cm, mm
optimise --vary d --maximise speed --bifurcations slpoe | bifurcations = 'slpoe'
walk --hip-spring k=abc | hip-spring = 'k=abc' | k must be a number, and 'abc' is not
walk --hip-spring theta_0=2cm k=1 | '2cm' is not a number in rad
walk --hip-spline torque=1,x | 'x' is not a number
walk --slope 2cm | --slope = '2cm' is not a number in rad, mrad, deg
walk --duration 5m | '5m' is not a number in s, ms
walk --set slope=2s | '2s' is not a number in rad
walk --state theta_1=2cm | '2cm' is not a number in rad
walk --state theta_3=1 | theta_3' is not known: choose one of hip_x
walk --state theta_1=0 --standing 3 | standing = '3'
constraints --integrators euler:dt=1m | integrator = 'euler:dt=1m'
trade --set K=2kg | '2kg' is not a number in N/m^n
""") + [(f"extremes{more}", "extremes is no longer a command", MOVED) for more in MORE]
"""Those that are refused before JAX is imported (see `test_declarations`)."""
LATE = _rows("""
walk --solver euler | solver = euler | dt = 1e-6
walk --solver euler --dt 1e-6 | 10 s | max_solver_steps = 1048576
walk --model rigid --dt 1e-6 | dt = 1e-06 | rigid
walk --J 0 | J = 0 | hip_mass = 0
walk --set v0=-1 | v0 = -1
walk --walker kneed --theta-1 0.1 | theta_1' is not known: choose one of hip_x
walk --walker kneed --state omega_nose=1 | omega_nose
walk --walker with-torso --state theta_torso=1 | theta_torso
walk --normal hertz --c 1 | c = 1 | normal = hertz
walk --out /dev/null/pictures | --out | /dev/null/pictures | directory
walk --hip-z 0.2 | hip_z = 0.2 | 0.196 m below the ground | 0.3956
walk --hip-z 0 | hip_z = 0 | below the ground
walk --hip-z -5 | hip_z = -5 | below the ground
walk --model rigid --solver rodas5p | solver = rodas5p
gait --friction coulomb --xi 9 | xi = 9 | friction = coulomb
gait --model rigid --section mid-stance | HeelStrike
gait --hip-torque torque=1,2 | torque
gait --hip-torque torque=1 reaction=hand | reaction = 'hand'
gait --hip-spline torque=1 | two or more
gait --push-off impulse=1 | needs rigid
gait --model rigid --foot-preload extension=0.1 | needs compliant
continue --along K --from -1 --to 1e6 | K = -1 is not allowed
continue --formulation redundant | redundant coordinates
basin --x K=-1:1:3 | K = -1
basin --x g=1:2:3 --y g=1:2:3 | g is named by two axes
basin --model rigid --x hip_z=0:1:3 | coordinate = 'hip_z' is not known
basin --accuracy 2 | accuracy = 2 is not allowed: it is the fraction of the labels
basin --store /dev/null | store = '/dev/null' is a file
constraints --out /proc/nowhere | --out
trade --out /proc/nowhere | --out
optimise --maximise speed --model rigid --vary d=0.2:0.1 | bounds of d = (0.2, 0.1) are empty
optimise --maximise speed --model rigid --vary hip_mass | hip_mass needs bounds
optimise --maximise speed --model rigid --vary d --minimise period | either maximise or minimise
optimise --maximise speed --model rigid --vary d --subject-to 'speed<0.1' 'speed>0.2' | contradict
optimise --maximise speed --model rigid --vary d --subject-to 'slip_distance<1' | roll without slip
""")
"""Those that a scene, a start or a folder refuses."""


@pytest.mark.parametrize("refusal", EARLY + LATE, ids=lambda row: row[0])
def test_each_sentence_names_what_is_wrong(refusal, capsys):
    command, *words = refusal
    line = refused(command, capsys)
    assert [word for word in words if word not in line] == []


def test_a_box_with_borders_and_colours_is_the_same_sentence():
    plain = """
 Unrecognized options
 --------------------------------
  Unrecognized options: --slop, 3
  --------------------------------
  Perhaps you meant:
      --slope FLOAT
          Angle of the slope.
"""
    framed = """
\x1b[31m╭─\x1b[0m \x1b[31;1mUnrecognized options\x1b[0m ─────────╮
│ Unrecognized options: \x1b[1m--slop, 3\x1b[0m │
│ ─────────────────────────────── │
│ Perhaps you meant:              │
│     --slope FLOAT               │
╰─────────────────────────────────╯
"""
    expected = "unrecognized options: --slop, 3; perhaps you meant --slope."
    assert one_sentence(plain) == one_sentence(framed) == expected


def test_what_is_no_box_still_says_something():
    assert "--help" in one_sentence("")


@pytest.mark.parametrize("arguments", [["--version"], ["version"]])
def test_the_version(arguments, capsys):
    main(arguments)
    assert capsys.readouterr().out.strip().count(".") == 2


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("JAXBIPED_THREADS", "two", "a whole number of threads above 0"),
        ("JAXBIPED_THREADS", "0", "a whole number of threads above 0"),
        ("JAXBIPED_VECTOR_BITS", "100", "128, 256 or 512"),
        ("JAXBIPED_CACHE_BYTES", "1e9", "a whole number of bytes"),
    ],
)
def test_an_environment_variable_that_is_not_understood(name, value, words, capsys, monkeypatch):
    monkeypatch.setenv(name, value)
    line = refused("walk --duration 0.1", capsys)
    assert f"{name} = {value!r}" in line
    assert words in line


def test_a_platform_that_jax_does_not_find(capsys, monkeypatch):
    def none():
        raise RuntimeError("Unknown backend")

    monkeypatch.setenv("JAX_PLATFORMS", "abacus")
    monkeypatch.setattr(jax, "devices", none)
    line = refused("walk --duration 0.1", capsys)
    assert "JAX_PLATFORMS = 'abacus'" in line


def test_numbers_are_strict_json(capsys):
    """What is no finite number is null, as RFC 8259 has no word for it."""
    Report(Path("-")).finish({"a": [np.nan, np.float64("inf"), 1], "b": np.arange(2.0)})
    assert json.loads(capsys.readouterr().out, parse_constant=pytest.fail) == {
        "a": [None, None, 1],
        "b": [0.0, 1.0],
    }
