"""Words, symbols and units of what axes show: one table for all figures.

Symbols are the paper's; those of laws that it does not have are the ones of their sources.
"""

from jaxbiped._parameter_declaration import parameter_infos
from jaxbiped._quantity import Quantity
from jaxbiped.dynamics._state import STATE_QUANTITIES, state_quantity
from jaxbiped.scene._ground import Ground
from jaxbiped.scene._walker import Walker
from jaxbiped.scene.laws._abstract_laws import FRICTION_LAWS, NORMAL_LAWS
from jaxbiped.scene.laws.friction._stribeck import BengisuAkay
from jaxbiped.scene.laws.normal._ristow_schafer import RistowSchafer
from jaxbiped.sweep.starts._coordinates import START_QUANTITIES

TIME = Quantity("time", r"$t$", "s")
HORIZONTAL = Quantity("horizontal position", r"$X$", "m")
HEIGHT = Quantity("height", r"$Z$", "m")
NORMAL_FORCE = Quantity("normal force", r"$F_N$", "N")
TANGENTIAL_FORCE = Quantity("tangential force", r"$F_T$", "N")
PENETRATION = Quantity("penetration", r"$\delta$", "m")
SLIP_SPEED = Quantity("slip speed", r"$V_T$", "m/s")
FORCE_RATIO = Quantity("friction over load", r"$F_T/F_N$")


def angle_of(noun: str) -> Quantity:
    """The angle of a "leg" or a "body"."""
    return Quantity(f"{noun} angle", r"$\theta$", "rad")


def rate_of(noun: str) -> Quantity:
    """The rate of a "leg" or a "body"."""
    return Quantity(f"{noun} rate", r"$\omega$", "rad/s")


def _of_parts() -> dict[str, Quantity]:
    """Parameters of the parts of scenes by their own names, the seed's where laws share one.

    What the seed's scene does not have and laws have in several units is "SI" by its name alone.
    """
    found: dict[str, Quantity] = {}
    for law in (*NORMAL_LAWS.values(), *FRICTION_LAWS.values()):
        for name, info in parameter_infos(law).items():
            same = found.setdefault(name, info.quantity).unit == info.quantity.unit
            found[name] = found[name] if same else found[name]._replace(unit="SI")
    for part in (Walker, Ground, RistowSchafer, BengisuAkay):
        found |= {name: info.quantity for name, info in parameter_infos(part).items()}
    return found


QUANTITIES = {**STATE_QUANTITIES, **START_QUANTITIES, **_of_parts()}
"""Coordinates of the state and parameters of scenes by the names that the code gives them."""

_LAWS = {
    "KelvinVoigt": "Kelvin and Voigt",
    "RistowSchafer": "Ristow and Schäfer",
    "SmoothRistowSchafer": "Ristow and Schäfer, smooth",
    "KuwabaraKono": "Kuwabara and Kono",
    "HuntCrossley": "Hunt and Crossley",
    "RegularisedCoulomb": "Coulomb, regularised",
    "Ambrosio": "Ambrósio",
    "BengisuAkay": "Bengisu and Akay",
    "SmoothBengisuAkay": "Bengisu and Akay, smooth",
    "BrownMcPhee": "Brown and McPhee",
}


def axis_label(name: str | Quantity, unit: str = "") -> str:
    """What an axis says: of a quantity or a name of the table all of it, unless a unit is given.

    Any other name is taken for words, with the unit behind them, if there is one.
    """
    quantity = quantity_of(name)
    if quantity is not None and (not unit or isinstance(name, Quantity)):
        return quantity.on_axis(unit or None)
    return f"{name} ({unit})" if unit else str(name)


def row_label(name: str | Quantity) -> str:
    """Words and symbol of a quantity or a name of the table; any other name itself."""
    quantity = quantity_of(name)
    return str(name) if quantity is None else quantity.in_row()


_SCENE_PARTS = ("", "walker", "ground", "normal", "friction")
"""Parts of a scene of which there is one: only other parts, such as bodies, are named in words."""


def quantity_of(name: str | Quantity) -> Quantity | None:
    """The entry of a name in the table; for a name such as `part.name` it names the part."""
    if not isinstance(name, str):
        return name
    part, _, last = name.rpartition(".")
    quantity = QUANTITIES.get(last) or state_quantity(name)
    return quantity if quantity is None or part in _SCENE_PARTS else quantity.of_part(part)


def law_name(law: object) -> str:
    """The name of a law of contact in words."""
    name = type(law).__name__
    return _LAWS.get(name, name)
