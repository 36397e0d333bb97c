"""Units in tables, against dimensions: a rate has its quantity's unit over a second, and so on."""

import re

import pytest

import jaxbiped as jb
from jaxbiped.optimise import NAMED_COSTS, OBJECTIVES
from tests.drawn import labels_of
from tests.plot.test_parameter_charts import POINTS, make_branch
from tests.sweep.walkers import ByFormula, as_kind, gaitless

SCENE = jb.seed_scene()
RATES = {"hip_x": "hip_vx", "hip_z": "hip_vz", "theta_1": "omega_1", "theta_2": "omega_2"}
ROLES = {"swing": "1", "stance": "2"}


@pytest.fixture(scope="module")
def walk():
    return jb.simulate(SCENE, jb.seed_state(), duration=0.1)


def test_rates_of_the_state_have_the_units_of_rates(walk):
    table = jb.measure.trajectory_dataset(SCENE, walk)
    units = {name: table[name].attrs["units"] for name in jb.State._fields}
    for name, rate in RATES.items():
        assert units[rate] == f"{units[name]}/s"
    for name, quantity in jb.starts.coordinate_quantities(SCENE).items():
        word, _, role = name.rpartition("_")
        leaf = f"{word}_{ROLES[role]}" if role in ROLES else name
        if leaf in units:
            assert quantity.unit == units.get(leaf), name


BY_DIMENSION = {
    "period": "s", "time": "s", "step_length": "m", "distance": "m", "slip_distance": "m",
    "foot_clearance": "m", "speed": "m/s", "peak_normal": "N", "impact_loss": "J",
    "friction_loss": "J", "motor_work": "J", "fold_distance": "rad", "doubling_distance": "rad",
    "weight": "N", "slope": "rad", "torque_squared": "N^2 m^2 s", "absolute_work": "J",
    "push_off_squared": "N^2 s^2", "jerk": "rad^2/s^5", "peak_torque": "N m", "peak_power": "W",
    "joint_range": "rad", "landing_speed": "m/s",
}  # fmt: skip


def swept_units():
    """Units of the fields of a sweep."""
    labelling = as_kind(ByFormula, gaitless(SCENE, jb.seed_state()))
    starts = jb.starts.grid(SCENE, {"theta_swing": [0.1]})
    table = jb.sweep(labelling, starts, look_for_gaits=False)
    own = (set(table.data_vars) & set(jb.labels.Labelled._fields)) - {"cycle_footsteps"}
    return {name: table[name].attrs.get("units", "") for name in own}


def unit_in(label):
    """The unit that a label ends with, in brackets; a dash for none."""
    return re.search(r"\(([^()]*)\)$", label)[1].replace("–", "")


def branch_units():
    """Units of the measures that figures of a branch draw."""
    names = ("period", "step_length", "speed", "peak_normal", "spectral_radius")
    figures = {name: jb.plot.branch(make_branch(POINTS), name) for name in names}
    return {name: unit_in(figure.axes[0].get_ylabel()) for name, figure in figures.items()}


@pytest.mark.parametrize(
    "table",
    [
        {name: each.quantity.unit for name, each in (OBJECTIVES | NAMED_COSTS).items()},
        swept_units(),
        branch_units(),
    ],
    ids=["objectives", "fields of a sweep", "measures of a branch"],
)
def test_measures_have_the_units_of_what_they_are(table):
    for name, unit in table.items():
        assert unit == BY_DIMENSION.get(name, ""), name


def test_axes_of_figures_have_the_units_of_what_they_are(walk):
    units = {"time": "s", "penetration": "mm", "normal": "N", "tangential": "N", "speed": "m/s",
             "angle": "rad", "rate": "rad/s", "friction over load": ""}  # fmt: skip
    drawn = (
        jb.plot.contact_forces(SCENE, walk), jb.plot.penetrations(SCENE, walk),
        jb.plot.leg_angles(SCENE, walk), jb.plot.phase_portrait(SCENE, walk),
        jb.plot.friction_law(SCENE.friction), jb.plot.normal_law(SCENE.normal),
    )  # fmt: skip
    labels = [label for figure in drawn for label in labels_of(figure)]
    for word, unit in units.items():
        found = {unit_in(label) for label in labels if word in label.partition(",")[0]}
        assert found == {unit}, (word, labels)
