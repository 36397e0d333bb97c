"""Units in tables, against dimensions: a rate has its quantity's unit over a second, and so on."""

import pytest

import jaxbiped as jb
from jaxbiped.dynamics._state import STATE_QUANTITIES
from jaxbiped.optimise._objectives import OBJECTIVES
from jaxbiped.plot import _parameter_charts, _symbols
from jaxbiped.solve._accuracy import units_of
from jaxbiped.sweep._store import FIELDS
from jaxbiped.sweep.starts._coordinates import START_QUANTITIES, state_coordinates

METRES, SECONDS, KILOGRAMS = 2.0, 3.0, 5.0
"""Units of another system, in SI's."""
SIZES = {"m": METRES, "s": SECONDS, "kg": KILOGRAMS, "rad": 1.0, "1": 1.0, "": 1.0,
         "N": KILOGRAMS * METRES / SECONDS**2, "J": KILOGRAMS * METRES**2 / SECONDS**2}  # fmt: skip


def size(unit):
    """Of a unit such as "kg m^2/s", in the other system."""
    found = 1.0
    for k, part in enumerate(unit.split("/")):
        for factor in part.split(" "):
            base, _, power = factor.partition("^")
            found *= SIZES[base] ** (float(power or 1.0) * (1.0 if k == 0 else -1.0))
    return found


RATES = {"hip_x": "hip_vx", "hip_z": "hip_vz", "theta_1": "omega_1", "theta_2": "omega_2"}


def test_rates_of_the_state_have_the_units_of_rates():
    for name, rate in RATES.items():
        assert STATE_QUANTITIES[rate].unit == f"{STATE_QUANTITIES[name].unit}/s"
    for name, leaf in state_coordinates(jb.seed_scene()).items():
        own = START_QUANTITIES.get(name, STATE_QUANTITIES[leaf])
        assert own.unit == STATE_QUANTITIES[leaf].unit
    # By what errors are measured in: lengths, √(l/g) and their quotients.
    scene = jb.with_parameters(jb.seed_scene(), {"l": 0.4 * METRES, "g": 9.8 * METRES / SECONDS**2})
    inverse = units_of(scene, jb.seed_state()).inverse
    for name, each in inverse._asdict().items():
        assert 1.0 / float(each) == pytest.approx(size(STATE_QUANTITIES[name].unit)), name


BY_DIMENSION = {
    "period": "s", "time": "s", "step_length": "m", "distance": "m", "slip_distance": "m",
    "foot_clearance": "m", "speed": "m/s", "peak_normal": "N", "impact_loss": "J",
    "friction_loss": "J", "motor_work": "J", "fold_distance": "rad", "doubling_distance": "rad",
}  # fmt: skip


@pytest.mark.parametrize(
    "table",
    [
        {name: each.quantity.unit for name, each in OBJECTIVES.items()},
        {name: unit for name, (_, _, unit, _) in FIELDS.items() if name != "cycle_footsteps"},
        {name: each.unit for name, each in _parameter_charts._MEASURES.items()},
    ],
    ids=["objectives", "fields of a sweep", "measures of a branch"],
)
def test_measures_have_the_units_of_what_they_are(table):
    for name, unit in table.items():
        assert unit == BY_DIMENSION.get(name, ""), name


def test_axes_of_figures_have_the_units_of_what_they_are():
    told = {"TIME": "s", "HORIZONTAL": "m", "HEIGHT": "m", "PENETRATION": "m",
            "NORMAL_FORCE": "N", "TANGENTIAL_FORCE": "N", "SLIP_SPEED": "m/s",
            "FORCE_RATIO": ""}  # fmt: skip
    for name, unit in told.items():
        assert getattr(_symbols, name).unit == unit, name
    assert (_symbols.angle_of("leg").unit, _symbols.rate_of("leg").unit) == ("rad", "rad/s")
