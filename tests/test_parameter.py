"""Parameters with words, unit and range, against checks, docstrings and the laws' powers."""

import inspect
import math
import re

import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped._parameter_declaration import parameter_infos
from jaxbiped._quantity import ParameterInfo, si_number
from jaxbiped.scene.laws import Quantity

SEED = jb.seed_scene()
NORMALS = {
    name: jb.laws.normal_law_like(name, K=1e6, c=1e7, n=1.5, mass=2.0)
    for name in jb.laws.NORMAL_LAWS
}
FRICTIONS = {
    name: jb.laws.friction_law_like(name, mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1e3)
    for name in jb.laws.FRICTION_LAWS
} | {"brown-mcphee, viscous": jb.laws.BrownMcPhee(0.5, 0.4, 1e-4, mu_v=1.0, N_t=1.0)}
METHODS = {name: kind() for name, kind in jb.constraints.CONSTRAINT_METHODS.items()}
SCENES = {
    **{
        name: jb.Scene(SEED.walker, SEED.ground, law, SEED.friction)
        for name, law in NORMALS.items()
    },
    **{
        name: jb.Scene(SEED.walker, SEED.ground, SEED.normal, law)
        for name, law in FRICTIONS.items()
    },
    **{name: jb.RedundantScene(SEED, method) for name, method in METHODS.items()},
    "rigid": jb.RigidScene(SEED.walker, SEED.ground),
    "linkage": jb.dynamics.LinkageScene(
        jb.dynamics.walker_linkage(SEED.walker), jb.constraints.Index1()
    ),
}


def _part_and_field(tree, path):
    """The part that declares the leaf at a path, and the field's name."""
    part, found = tree, None
    for key in path:
        if isinstance(key, jtu.GetAttrKey):
            found = part, key.name
            part = getattr(part, key.name)
        else:
            part = part[key.idx]
    return found


def _documented(part):
    """Units by parameter, from the docstrings of a part's class and its bases."""
    text = "\n".join(inspect.getdoc(kind) or "" for kind in type(part).__mro__)
    found = re.findall(r"^    (\w+): ((?!\n    \w)[^\[])*?\[([^\]]+)\]", text, flags=re.MULTILINE)
    return {name: unit for name, _, unit in found}


@pytest.mark.parametrize("name", SCENES)
def test_every_numeric_leaf_says_what_it_is_in_the_unit_of_its_docstring(name):
    leaves = jtu.tree_flatten_with_path(SCENES[name])[0]
    assert len(leaves) > 7
    for path, _ in leaves:
        part, field = _part_and_field(SCENES[name], path)
        quantity = parameter_infos(part)[field].quantity
        assert quantity.words
        assert quantity.symbol
        assert quantity.unit_in_text == _documented(part)[field]


def _power(function, at):
    """The exponent of a power law."""
    return float(np.log2(function(jnp.asarray(2.0 * at)) / function(jnp.asarray(at))))


@pytest.mark.parametrize("name", NORMALS)
def test_units_of_stiffness_and_damping_are_those_of_the_laws_powers(name):
    """K δᵉ is a force, so K is in N/mᵉ; a damper D δᵉ δ̇ has D in N s/m^(1+e)."""
    law = NORMALS[name]
    infos = parameter_infos(law)

    def exponent(parameter):
        written = infos[parameter].quantity.unit.partition("/m")[2].removeprefix("^")
        return float(getattr(law, written) if written.isidentifier() else written or 1.0)

    elastic = _power(law.elastic_force, 1e-3)
    assert exponent("K") == pytest.approx(elastic, abs=1e-6)
    (damping,) = set(infos) & {"c", "D", "gamma", "hysteresis"} or {None}
    if damping in ("c", "D", "gamma"):

        def damper(depth):
            return law.force(depth, jnp.asarray(1e-3)) - law.elastic_force(depth)

        assert exponent(damping) == pytest.approx(1.0 + _power(damper, 1e-3), abs=1e-6)


def test_the_unit_of_a_stiffness_follows_its_own_law():
    units = {
        name: jb.parameter_quantities(SCENES[name])["K"].unit for name in ("kelvin-voigt", "tsuji")
    }
    assert units == {"kelvin-voigt": "N/m", "tsuji": "N/m^1.5"}
    assert jb.starts.coordinate_quantities(SEED)["K"].unit == "N/m^n"
    assert jb.starts.coordinate_quantities(SEED)["theta_stance"].unit == "rad"


@pytest.mark.parametrize(
    ("unit", "text", "figure"),
    [
        ("N s/m^2", "N·s/m²", "N s/m²"),
        ("N/m^n", "N/mⁿ", "N/m$^n$"),
        ("N s/m^1.25", "N·s/m^1.25", "N s/m$^{1.25}$"),
        ("N/m^p", "N/m^p", "N/m$^p$"),
        ("", "–", "–"),
    ],
)
def test_a_unit_as_text_and_in_a_figure(unit, text, figure):
    quantity = Quantity("x", "$x$", unit)
    assert (quantity.unit_in_text, quantity.unit_in_figure) == (text, figure)


class Ranged(jb.laws.AbstractFrictionLaw):
    """A friction law whose parameters show every kind of range."""

    positive: float = jb.laws.parameter("a", "$a$", "N", positive=True, default=1.0)
    natural: float = jb.laws.parameter("b", "$b$", "s/m", minimum=0.0, default=0.0)
    from_two: float = jb.laws.parameter("c", "$c$", minimum=2.0, default=2.0)
    small: float = jb.laws.parameter("d", "$d$", "rad", size_below=1.0, default=0.0)
    any_number: float = jb.laws.parameter("e", default=0.0)
    point: tuple = jb.laws.parameter("f", "$f$", "m", several=True, default=(0.0, 0.0))
    optional: float | None = jb.laws.parameter("h", "$h$", "m", positive=True, default=None)

    def force(self, normal_force, slip_speed):
        return -self.natural * normal_force * slip_speed

    def switches(self, slip_speed):
        return ()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (dict(positive=0.0), "positive = 0 is not allowed: it must be a finite number above 0 N."),
        (
            dict(natural=[0.0, -1.0]),
            "natural = -1 (one of 1 such entries) is not allowed: it must be a finite number of "
            "at least 0 s/m.",
        ),
        (dict(from_two=1.0), "from_two = 1 is not allowed: it must be at least 2."),
        (dict(small=-1.0), "small = -1 is not allowed: it must be between -1 and 1 (radians)."),
        (
            dict(any_number=np.inf),
            "any_number = inf is not allowed: it must be a finite number.",
        ),
        (dict(point=(0.0, np.nan)), "point = nan is not allowed: it must be a finite number."),
        (
            dict(optional=-1.0),
            "optional = -1 is not allowed: it must be a finite number above 0 m.",
        ),
        (dict(positive="much"), "positive = 'much' is not a number."),
    ],
)
def test_a_law_of_the_users_own_refuses_what_its_parameters_do_not_allow(given, said):
    with pytest.raises(jb.ArgumentError) as refused:
        Ranged(**given)
    assert str(refused.value) == said


def test_a_parameter_is_a_float_array_and_what_is_none_is_not_modelled():
    law = Ranged(natural=1)
    assert law.natural.dtype == jnp.float64
    assert law.optional is None
    assert len(jtu.tree_leaves(law)) == 7


class Plain(jb.laws.AbstractFrictionLaw):
    """A law with a field that carries nothing, and numbers in a list."""

    k: object
    more: list

    def force(self, normal_force, slip_speed):
        return -self.k * normal_force * slip_speed

    def switches(self, slip_speed):
        return ()


def test_of_a_plain_field_the_name_is_known():
    scene = jb.Scene(SEED.walker, SEED.ground, SEED.normal, Plain(jnp.ones(()), [jnp.ones(())]))
    quantities = jb.parameter_quantities(scene)
    assert quantities["k"] == Quantity("k")
    assert set(quantities) == set(jb.parameter_names(scene))


@pytest.mark.parametrize(
    ("text", "unit", "number"),
    [
        ("0.02", "rad", 0.02), ("-1e-6", "rad", -1e-6), ("2deg", "rad", math.radians(2.0)),
        ("-.5 °", "rad", math.radians(-0.5)), ("1e3mrad", "rad", 1.0),
        ("90deg/s", "rad/s", math.pi / 2),
        ("12.5cm", "m", 0.125), ("3.6km/h", "m/s", 1.0), ("500 ms", "s", 0.5), ("250g", "kg", 0.25),
        ("3us", "s", 3e-6), ("3 µs", "s", 3e-6), ("4ms", "s", 4e-3), ("7mm", "m", 7e-3),
        ("5cm/s", "m/s", 0.05), ("6mm/s", "m/s", 6e-3), ("2kN", "N", 2e3), ("3mrad", "rad", 3e-3),
        ("180°/s", "rad/s", math.pi), ("7kg", "kg", 7.0), ("36km/h", None, 10.0),
        ("2 N/m^n", "N/m^n", 2.0), ("inf", "s", math.inf), ("20mm", None, 0.02),
    ],
)  # fmt: skip
def test_a_number_may_have_a_unit(text, unit, number):
    assert si_number(text, unit) == pytest.approx(number, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "unit", "said"),
    [
        ("abc", "rad", "'abc' is not a number"), ("", "s", "'' is not a number"),
        ("2cm", "rad", "'2cm' is not a number in rad, mrad, deg, °"),
        ("0,5", "m", "'0,5' is not a number in m, cm, mm"), ("2deg", "", "'2deg' is not a number"),
    ],
)  # fmt: skip
def test_a_number_of_another_unit_is_none(text, unit, said):
    with pytest.raises(ValueError, match=re.escape(said) + "$"):
        si_number(text, unit)


@pytest.mark.parametrize(
    ("limits", "bad", "said"),
    [
        ({}, math.inf, "a = inf is not allowed: it must be a finite number."),
        ({"positive": True}, 0.0, "a = 0 is not allowed: it must be a finite number above 0 kg."),
        (
            {"minimum": 0.0},
            -1.0,
            "a = -1 is not allowed: it must be a finite number of at least 0 kg.",
        ),
        ({"minimum": 1.0}, 0.5, "a = 0.5 is not allowed: it must be at least 1."),
        ({"size_below": 2.0}, -2.0, "a = -2 is not allowed: it must be between -2 and 2 (kg)."),
    ],
)
def test_each_limit_of_a_parameter_has_its_sentence(limits, bad, said):
    info = ParameterInfo(Quantity("mass", "$m$", "kg"), **limits)
    info.check("a", 1.5)
    with pytest.raises(jb.ArgumentError, match=f"^{re.escape(said)}$"):
        info.check("a", bad)
