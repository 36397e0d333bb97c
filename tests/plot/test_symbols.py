"""Words, symbols and units of what figures draw, against every coordinate and parameter."""

import dataclasses
import re

import pytest
from matplotlib.figure import Figure

import jaxbiped as jb
from jaxbiped.plot._symbols import QUANTITIES, axis_label, law_name, row_label

LAWS = {**jb.laws.NORMAL_LAWS, **jb.laws.FRICTION_LAWS}


def test_every_coordinate_and_parameter_has_words_a_symbol_and_a_unit():
    names = set(jb.State._fields) | set(jb.starts.coordinate_names(jb.seed_scene()))
    for law in LAWS.values():
        names |= {field.name for field in dataclasses.fields(law)}
    assert names <= set(QUANTITIES)
    figure = Figure()
    for name in names:
        words, symbol, _ = QUANTITIES[name]
        assert "_" not in words
        assert symbol.startswith("$")
        assert symbol.endswith("$")
        label = axis_label(name)
        assert "^" not in re.sub(r"\$.*?\$", "", label)
        figure.text(0.0, 0.0, label)
    # Draws every symbol: one that is no mathematics is an error here.
    figure.canvas.draw()


def test_symbols_of_one_scene_differ():
    for normal in jb.laws.NORMAL_LAWS.values():
        for friction in jb.laws.FRICTION_LAWS.values():
            own = {f.name for law in (normal, friction) for f in dataclasses.fields(law)}
            own |= {"m", "J", "l", "d", "r", "hip_mass", "slope", "g"}
            symbols = [QUANTITIES[name].symbol for name in own]
            assert len(set(symbols)) == len(symbols)


@pytest.mark.parametrize(
    ("said", "label"),
    [
        (("theta_swing",), r"swing leg angle, $\theta_1$ (rad)"),
        (("normal.K",), r"contact stiffness, $K$ (N/m$^n$)"),
        (("K", "N/m"), "K (N/m)"),
        (("my own words",), "my own words"),
        (("push", "N s"), "push (N s)"),
        (("mu",), r"friction coefficient, $\mu$ (–)"),
        (("D",), "contact damping, $D$ (N s/m)"),
        (("gamma",), r"contact damping, $\gamma$ (SI)"),
    ],
)
def test_axes_say_words_symbol_and_unit(said, label):
    assert axis_label(*said) == label


def test_rows_and_titles():
    assert row_label("friction.mu_static") == r"static friction, $\mu_0$"
    assert row_label("strangeness") == "strangeness"
    for law in LAWS.values():
        assert (
            " " in law_name(object.__new__(law)) or law.__name__.istitle() or law is jb.laws.LuGre
        )
    assert law_name(jb.laws.Frictionless()) == "Frictionless"
