"""Labels of mechanisms, against SciPy's LSODA and a judge that sees feet alone."""

import jax
import numpy as np
import pytest
from _mechanisms import cases
from _scalar_field import rates_of
from reference.mechanism_labels import FELL_FORWARD, WALKING, fates, lsoda_of

import jaxbiped as jb
from jaxbiped.basins import Label
from tests.mechanism_numbers import tree_of

pytestmark = pytest.mark.nightly
COUNT = 24
FELL = {Label.FELL_FORWARD, Label.STUMBLED, Label.STOPPED}
"""Labels of starts that fall in the end if the motion goes on."""


@pytest.mark.filterwarnings("ignore:Excess work")
@pytest.mark.parametrize("name", ["seed", "kneed"])
def test_who_walks_is_who_walks_by_other_means(name):
    case = cases()[name]
    scene, kind = case.scene, type(case.guess)
    gait = jb.find_gait(scene, case.guess, parameters=(), radius_sensitivities=False)
    starts = starts_about(case, gait.measures.state)
    labelling = jb.labelling(scene, guess=gait.measures.state, footsteps=30)
    labels = [Label(int(code)) for code in labelling(kind(*starts.T)).label]
    rates = rates_of(
        lambda *y: tuple(jb.dynamics.vector_field(0.0, kind(*y), scene)), len(kind._fields)
    )
    found = fates(
        tree_of(scene),
        starts,
        float(gait.measures.period),
        float(scene.mechanism.height),
        lsoda_of(rates, 1e-7),
    )
    assert [each is Label.WALKING for each in labels] == [each == WALKING for each in found]
    assert 5 < found.count(WALKING) < COUNT - 5
    fallen = [label for label, fate in zip(labels, found, strict=True) if fate == FELL_FORWARD]
    assert len(fallen) > 5
    assert set(fallen) <= FELL


def starts_about(case, state):
    """Starts (n, 2 k) about a gait's, standing on one foot."""
    at = {name: float(leaf) for name, leaf in state._asdict().items()}
    noise, starts = np.random.default_rng(1), []
    for _ in range(COUNT):
        pose = {
            name: value + noise.uniform(-1.0, 1.0) * (0.12 if name.startswith("theta") else 0.5)
            for name, value in at.items()
            if name.startswith(("theta", "omega"))
        }
        start = case.scene.state(**pose, standing=case.standing)
        starts.append([float(leaf) for leaf in jax.tree.leaves(start)])
    return np.array(starts) - np.eye(len(at))[1] * 1e-6
