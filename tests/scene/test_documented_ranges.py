"""Ranges of parameters, against what the docstrings of their classes say is refused."""

import dataclasses
import re

import pytest

import jaxbiped as jb
from jaxbiped._parameter_declaration import parameter_infos
from tests.mechanisms import WALKERS
from tests.test_parameter import FRICTIONS, METHODS, NORMALS

PARTS = {
    **NORMALS,
    **FRICTIONS,
    **METHODS,
    "ground": jb.seed_scene().ground,
    "walker": jb.seed_scene().walker,
    "knees": jb.models.hsu_chen().walker,
    "hip-spring": jb.actuation.HipSpring(k=1.0, b=1.0),
    "hip-pulse": jb.actuation.HipPulse(pulse=1.0),
    "push-off": jb.actuation.PushOff(impulse=0.1),
    "foot-preload": jb.actuation.FootPreload(extension=0.01, span=0.2),
    "link": jb.constraints.LinkBody(mass=1.0, inertia=0.01),
    "body": WALKERS["unequal"].bodies[1],
    "foot": WALKERS["kneed"].feet[0],
    "spring": WALKERS["torso"].joints[0],
    "latch": WALKERS["five"].joints[-1],
}
GROUPS = {
    "coefficient": lambda name, unit: name.startswith("mu_") and not name.endswith("_v"),
    "mass": lambda name, unit: unit == "kg",
    "length": lambda name, unit: unit == "m" and name.startswith("l_"),
    "inertia": lambda name, unit: unit == "kg m^2",
    "width": lambda name, unit: name.endswith("width"),
    "them": lambda name, unit: name in ("stiffness", "damping"),
    "torque": lambda name, unit: "torque" in name,
    "radius": lambda name, unit: name == "radius",
    "share": lambda name, unit: name == "share",
}
"""What docstrings call several parameters."""
SAID = re.compile(r"([^;.]*?)\s(?:is |are )?(not above 0|below 0|below 1)(?=[,;. ])")


def refused(part):
    """By parameter what its class says is refused: "not above 0", "below 0" or "below 1"."""
    units = {name: info.quantity.unit for name, info in parameter_infos(part).items()}
    documents = ((kind.__doc__ or "").partition("Raises:")[2] for kind in type(part).__mro__)
    text = " ".join(" ".join(documents).split()).replace("ω", "omega").replace("ζ", "zeta")
    said = [(set(re.findall(r"\w+", re.split(r"\bis\b", w)[-1])), r) for w, r in SAID.findall(text)]
    # What must be above another parameter must be above zero.
    ranges = dict.fromkeys(re.findall(r"(\w+) is not above [a-z]", text), "not above 0")
    for words, range_ in said:
        ranges |= {name: range_ for name in units if name in words and name not in ranges}
    for words, range_ in said:
        for group in words & GROUPS.keys():
            fits = [name for name, unit in units.items() if GROUPS[group](name, unit)]
            ranges |= {name: range_ for name in fits if name not in ranges}
    for words, range_ in said:
        ranges |= {name: range_ for name in units if "another" in words and name not in ranges}
    return ranges


@pytest.mark.parametrize("name", PARTS)
def test_a_parameter_is_refused_where_its_docstring_says_so(name):
    part = PARTS[name]
    infos, ranges = parameter_infos(part), refused(part)
    limited = {n for n, info in infos.items() if info.positive or info.minimum is not None}
    assert limited == set(ranges)
    for parameter, words in ranges.items():
        limit = float(words[-1])
        bad = [limit - 1e-9, *([limit] if words.startswith("not") else [])]
        for value in bad:
            with pytest.raises(jb.ArgumentError, match=rf"^{parameter} = "):
                dataclasses.replace(part, **{parameter: value})
        infos[parameter].check(parameter, limit + (1e-9 if words.startswith("not") else 0.0))


@pytest.mark.parametrize("slope", [1.5707963267948967, -1.5707963267948967, 2.0])
def test_a_slope_is_less_than_a_right_angle(slope):
    with pytest.raises(jb.ArgumentError, match=r"^slope = "):
        jb.Ground(slope=slope)
    assert float(jb.Ground(slope=0.999 * slope / abs(slope)).slope) != 0.0
