"""Refused arguments of sweeps, labellings and starts, against the sentence that names each."""

import numpy as np
import pytest

import jaxbiped as jb
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker
from tests.sweep.walkers import gaitless

SCENE, RIGID = jb.seed_scene(), simplest_walker(0.009)
LABEL = gaitless(SCENE, jb.seed_state())
BOUNDS = {"theta_stance": (-0.1, 0.3), "omega_stance": (-2.0, 0.0), "hip_vx": (0.1, 0.9)}
grid, sample, given = jb.starts.grid, jb.starts.sample, jb.starts.GivenStarts


def states(*shapes):
    return jb.State(*[np.zeros(shape) for shape in shapes])


def label(**options):
    return jb.labelling(SCENE, **options)


def of_parameters(values, count=1):
    return LABEL(states(*[count] * 8), parameters=values)


@pytest.mark.parametrize(
    ("call", "reason"),
    [
        (lambda: label(footsteps=0), "footsteps = 0 .* whole number"),
        (lambda: label(footsteps=2.5), "footsteps = 2.5 .* whole number"),
        (lambda: label(accuracy="best"), "accuracy = 'best' is not known: choose one of draft"),
        (lambda: label(accuracy=0.0), "accuracy = 0 is not allowed"),
        (
            lambda: label(accuracy=2.0),
            "accuracy = 2 is not allowed: it is the fraction of the labels",
        ),
        (
            lambda: jb.labelling(RIGID, accuracy=1e-3, rtol=1e-6),
            "rtol = 1e-06 is not allowed beside accuracy = 0.001",
        ),
        (lambda: label(rtol=-1.0), "rtol = -1 .* above 0"),
        (lambda: label(engine="gpu"), "engine = 'gpu'"),
        (lambda: label(solver="kvaerno3"), "rodas3p to rodas5p"),
        (lambda: jb.labelling("walker"), "scene = 'walker' .* Scene"),
        (lambda: label(guess="seed"), "guess = 'seed' is not allowed"),
        (lambda: label(parameters={"hip_vx": [1.0]}), "'hip_vx' is not known"),
        (lambda: label(parameters={"K": [1e6, -1.0]}), "K = -1 .* above 0"),
        (lambda: label(parameters={"K": []}), r"K has values of shape \(0,\)"),
        (lambda: label(parameters={"K": [np.nan]}), "K = nan"),
        (lambda: LABEL(simplest_state(*STABLE)), "states = .* must be a State"),
        (lambda: LABEL(states(*[2] * 7, 3)), r"states has leaves of shapes \[\(2,\), \(3,\)\]"),
        (lambda: LABEL(jb.seed_state()), r"all of them must be \(n,\)"),
        (lambda: of_parameters({"K": [1e6]}, 2), r"parameters\['K'\] has shape"),
        (lambda: of_parameters({"K": [-1.0]}), "K = -1"),
        (lambda: of_parameters({"k": [1.0]}), "parameter = 'k' is not"),
        (lambda: jb.sweep(LABEL, grid(SCENE, {"hip_vx": [0.5]}), chunk=0), "chunk = 0"),
        (lambda: jb.sweep(LABEL, [1.0]), "starts = .* AbstractStarts"),
        (lambda: jb.sweep(LABEL, given(states(*[0] * 8))), "starts is empty"),
        (lambda: jb.labels.with_gaits_met(LABEL, None, count=0), "count = 0"),
        (lambda: grid(SCENE, {"theta": [0.1]}), "coordinate = 'theta' is not known"),
        (lambda: grid(SCENE, {}), "name at least one"),
        (lambda: grid(SCENE, {"hip_vx": []}), r"hip_vx has values of shape \(0,\)"),
        (lambda: grid(SCENE, {"hip_vx": [[0.1]]}), "must be"),
        (lambda: grid(SCENE, {"hip_vx": [0.1, np.nan]}), "hip_vx = nan .* a finite number"),
        (lambda: grid(SCENE, {"hip_vx": ["fast"]}), "hip_vx = .* is not a number"),
        (lambda: grid(SCENE, {"K": [1e6, -1.0]}), "K = -1 .* above 0"),
        (lambda: grid(RIGID, {"hip_z": [0.1]}), "'hip_z' is not known"),
        (lambda: sample(SCENE, {"hip_vx": (0.5, 0.1)}, 4), "hip_vx = 0.5:0.1 .* be less than"),
        (lambda: sample(SCENE, {"hip_vx": (0.5,)}, 4), "hip_vx = .* two numbers"),
        (lambda: sample(SCENE, {"hip_vx": (0.5, np.inf)}, 4), "hip_vx = inf"),
        (lambda: sample(SCENE, BOUNDS, 0), "count = 0 .* whole number above 0"),
        (lambda: sample(SCENE, BOUNDS, 4, method="best"), "method = 'best' .* sobol"),
        (lambda: sample(SCENE, {"c": (-5.0, 1.0)}, 4), "c = -5"),
        (lambda: given([1.0]), "states = .* must be a State"),
        (lambda: given(states(*[2] * 7, 3)), r"leaves of shapes \[\(2,\)"),
        (lambda: given(simplest_state(*STABLE)), r"all of them must be \(n,\)"),
        (lambda: jb.gait_sweep(SCENE, {}), "over"),
        (lambda: jb.gait_sweep(SCENE, {"stiffness": [1.0]}), "stiffness"),
        (lambda: jb.gait_sweep(SCENE, {"K": []}), "K"),
        (lambda: jb.gait_sweep(SCENE, {"K": [-1.0]}), "K"),
        (lambda: jb.gait_sweep(SCENE, {"K": [[1.0]]}), "K"),
    ],
)
def test_bad_arguments_are_refused_in_one_sentence(call, reason):
    with pytest.raises(jb.ArgumentError, match=reason) as raised:
        call()
    assert str(raised.value).endswith(".")
