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


def test_parameters_of_one_symbol_name_their_part():
    """Of bodies and of their stops; parameters of one symbol alone keep it."""
    legs = [
        jb.Body(f"{name}_{i}", mass=0.2, inertia=1e-3, centre=0.1, **place)
        for i in (1, 2)
        for name, place in (("thigh", {}), ("shank", {"parent": f"thigh_{i}", "at": 0.2}))
    ]
    walker = jb.Mechanism(
        root="hip",
        root_mass=1.0,
        bodies=tuple(legs),
        feet=tuple(jb.Foot(f"shank_{i}", centre=0.1, radius=0.1) for i in (1, 2)),
        joints=tuple(
            jb.Stop(f"shank_{i}", upper=0.2, law=jb.laws.RistowSchafer(K=3e2, c=3e3, n=1.0))
            for i in (1, 2)
        ),
        mirror=(("thigh_1", "thigh_2"), ("shank_1", "shank_2")),
    )
    known = jb.parameter_quantities(dataclasses.replace(jb.seed_scene(), walker=walker))
    symbols = {name: each.symbol for name, each in known.items() if each.symbol}
    assert len(set(symbols.values())) == len(symbols), symbols
    assert symbols["thigh.mass"] == r"$m_{\mathrm{thigh}}$"
    assert symbols["slope"] == r"$\alpha$"
    label = Figure().text(0.0, 0.0, " ".join(symbols.values()))
    label.figure.canvas.draw()
    quantity = jb.laws.Quantity("gain", r"$k_\mathrm{p}$").of_part("hip_1")
    assert quantity == ("gain, hip_1", r"$k_{\mathrm{p},\mathrm{hip\_1}}$", "")


def test_rows_and_titles():
    assert row_label("friction.mu_static") == r"static friction, $\mu_0$"
    assert row_label("strangeness") == "strangeness"
    for law in LAWS.values():
        assert (
            " " in law_name(object.__new__(law)) or law.__name__.istitle() or law is jb.laws.LuGre
        )
    assert law_name(jb.laws.Frictionless()) == "Frictionless"
