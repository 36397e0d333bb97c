"""Words, symbols and units of what axes show: one table for all figures.

Symbols are the paper's; those of laws that it does not have are the ones of their sources.
"""

from typing import Any, NamedTuple


class Quantity(NamedTuple):
    """What an axis says of a quantity; "–" is the unit of what has none."""

    words: str
    symbol: str
    unit: str

    def on_axis(self, unit: str | None = None) -> str:
        """Words, symbol and unit, its own unless given another."""
        return f"{self.words}, {self.symbol} ({self.unit if unit is None else unit})"

    def in_row(self) -> str:
        """Words and symbol, where there is no room for more."""
        return f"{self.words}, {self.symbol}"


TIME = Quantity("time", r"$t$", "s")
HORIZONTAL = Quantity("horizontal position", r"$X$", "m")
HEIGHT = Quantity("height", r"$Z$", "m")
LEG_ANGLE = Quantity("leg angle", r"$\theta$", "rad")
LEG_RATE = Quantity("leg rate", r"$\omega$", "rad/s")
NORMAL_FORCE = Quantity("normal force", r"$F_N$", "N")
TANGENTIAL_FORCE = Quantity("tangential force", r"$F_T$", "N")
PENETRATION = Quantity("penetration", r"$\delta$", "m")
SLIP_SPEED = Quantity("slip speed", r"$V_T$", "m/s")
FORCE_RATIO = Quantity("friction over load", r"$F_T/F_N$", "–")

QUANTITIES = {
    # the state
    "hip_x": Quantity("hip along the slope", r"$x_S$", "m"),
    "hip_z": Quantity("hip above the slope", r"$z_S$", "m"),
    "hip_vx": Quantity("hip velocity along the slope", r"$\dot x_S$", "m/s"),
    "hip_vz": Quantity("hip velocity off the slope", r"$\dot z_S$", "m/s"),
    "theta_1": Quantity("angle of leg 1", r"$\theta_1$", "rad"),
    "theta_2": Quantity("angle of leg 2", r"$\theta_2$", "rad"),
    "omega_1": Quantity("rate of leg 1", r"$\omega_1$", "rad/s"),
    "omega_2": Quantity("rate of leg 2", r"$\omega_2$", "rad/s"),
    # starts of a sweep: leg 1 swings, leg 2 stands
    "theta_swing": Quantity("swing leg angle", r"$\theta_1$", "rad"),
    "theta_stance": Quantity("stance leg angle", r"$\theta_2$", "rad"),
    "omega_swing": Quantity("swing leg rate", r"$\omega_1$", "rad/s"),
    "omega_stance": Quantity("stance leg rate", r"$\omega_2$", "rad/s"),
    # the walker and the ground
    "m": Quantity("leg mass", r"$m$", "kg"),
    "J": Quantity("leg inertia", r"$J$", "kg m²"),
    "l": Quantity("leg length", r"$l$", "m"),
    "d": Quantity("hip to mass centre", r"$d$", "m"),
    "r": Quantity("foot radius", r"$r$", "m"),
    "hip_mass": Quantity("hip mass", r"$m_S$", "kg"),
    "slope": Quantity("slope", r"$\alpha$", "rad"),
    "g": Quantity("gravity", r"$g$", "m/s²"),
    # laws of the normal force
    "K": Quantity("contact stiffness", r"$K$", r"N/m$^n$"),
    "n": Quantity("contact exponent", r"$n$", "–"),
    "c": Quantity("contact damping", r"$c$", "N s/m²"),
    "D": Quantity("contact damping", r"$D$", "N s/m"),
    "gamma": Quantity("contact damping", r"$\gamma$", "SI"),
    "hysteresis": Quantity("hysteresis", r"$\chi/v^-$", "s/m"),
    "depth_width": Quantity("rounding of depth", r"$w_\delta$", "m"),
    "force_width": Quantity("rounding of force", r"$w_F$", "N"),
    # laws of friction
    "mu": Quantity("friction coefficient", r"$\mu$", "–"),
    "mu_static": Quantity("static friction", r"$\mu_0$", "–"),
    "mu_kinetic": Quantity("kinetic friction", r"$\mu$", "–"),
    "mu_dynamic": Quantity("kinetic friction", r"$\mu$", "–"),
    "v0": Quantity("slip at the peak", r"$v_0$", "m/s"),
    "v1": Quantity("slip of full friction", r"$v_1$", "m/s"),
    "xi": Quantity("decay of friction", r"$\xi$", "s/m"),
    "v_s": Quantity("Stribeck speed", r"$v_s$", "m/s"),
    "v_d": Quantity("build-up speed", r"$v_d$", "m/s"),
    "v_t": Quantity("slip at the peak", r"$v_t$", "m/s"),
    "k": Quantity("friction per slip", r"$k$", "s/m"),
    "k_v": Quantity("viscous friction", r"$k_v$", "s/m"),
    "mu_v": Quantity("viscous friction", r"$\mu_v$", "N s/m"),
    "N_t": Quantity("load of full viscosity", r"$N_t$", "N"),
    "p": Quantity("exponent of the fall", r"$p$", "–"),
    "sigma_0": Quantity("bristle stiffness", r"$\sigma_0$", "1/m"),
    "sigma_1": Quantity("bristle damping", r"$\sigma_1$", "s/m"),
    "sigma_2": Quantity("viscous friction", r"$\sigma_2$", "s/m"),
    "engaging_load": Quantity("engaging load", r"$F_e$", "N"),
    "relaxation": Quantity("bristle relaxation", r"$\kappa$", "1/s"),
}
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


def axis_label(name: str, unit: str = "") -> str:
    """What an axis says: of a name of the table all of it, unless a unit is given.

    Any other name is taken for words, with the unit behind them, if there is one.
    """
    if not unit and _qualified_symbol(name) in QUANTITIES:
        return QUANTITIES[_qualified_symbol(name)].on_axis()
    return f"{name} ({unit})" if unit else name


def row_label(name: str) -> str:
    """Words and symbol of a name of the table; any other name itself."""
    return (
        QUANTITIES[_qualified_symbol(name)].in_row()
        if _qualified_symbol(name) in QUANTITIES
        else name
    )


def _qualified_symbol(name: str) -> str:
    """A parameter's own name, where it is told from its namesake as `part.name`."""
    return name.rpartition(".")[2]


def law_name(law: Any) -> str:
    """The name of a law of contact in words."""
    name = type(law).__name__
    return _LAWS.get(name, name)
