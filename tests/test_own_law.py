"""A law of the user's own, against what the package's laws show without any table."""

import dataclasses

import numpy as np
import pytest
from matplotlib.figure import Figure

import jaxbiped as jb
from jaxbiped.plot import basin, elasticities
from tests.saved_parts import Grip
from tests.sweep.walkers import gaitless

SCENE = dataclasses.replace(jb.seed_scene(), friction=Grip(5000.0))


def test_in_a_sweep():
    axes = {"theta_stance": [0.15, 0.16], "grip": [4000.0, 5000.0]}
    labelling = gaitless(SCENE, jb.seed_state(), footsteps=1)
    found = jb.sweep(labelling, jb.starts.grid(SCENE, axes), look_for_gaits=False)
    assert found.grip.attrs["units"] == "s/m"
    assert found.theta_stance.attrs["units"] == "rad"
    sampled = jb.starts.sample(SCENE, {"grip": (4000.0, 5000.0)}, 2)
    found = jb.sweep(labelling, sampled, look_for_gaits=False)
    assert found.start_grip.attrs["units"] == "s/m"


@pytest.mark.slow
def test_in_a_sweep_of_gaits_and_in_the_chart_of_a_gaits_elasticities():
    gait = jb.find_gait(SCENE, parameters=("grip", "K"), radius_sensitivities=False)
    rows = {label.get_text() for label in elasticities(gait, "period").axes[0].get_yticklabels()}
    assert rows == {"grip per slip, $G$", "contact stiffness, $K$"}
    swept = jb.gait_sweep(
        SCENE, {"grip": [5000.0]}, parameters=("grip",), radius_sensitivities=False
    )
    assert swept.grip.attrs["units"] == "s/m"


def test_on_an_axis():
    quantities = jb.starts.coordinate_quantities(SCENE)
    axes = Figure().subplots()
    basin(
        np.zeros((2, 2), int), [0.0, 1.0], [0.0, 1.0],
        names=(quantities["theta_stance"], quantities["grip"]), ax=axes,
    )  # fmt: skip
    assert axes.get_ylabel() == "grip per slip, $G$ (s/m)"
    assert axes.get_xlabel() == r"stance leg angle, $\theta_2$ (rad)"
