"""Options of `jaxbiped walk`: every parameter of the seed's scene by its paper name."""

import dataclasses
from inspect import signature
from pathlib import Path

from jaxbiped._checks import check_writable_directory, check_writable_file
from jaxbiped.dynamics._state import State, checked_state, seed_state
from jaxbiped.scene._scene import Scene
from jaxbiped.scene._seed import seed_scene

_SEED = {
    parameter.name: parameter.default for parameter in signature(seed_scene).parameters.values()
}
_START = {name: float(value) for name, value in seed_state()._asdict().items()}


@dataclasses.dataclass(frozen=True)
class SceneOptions:
    """Parameters of the seed's scene (SI units)."""

    slope: float = _SEED["slope"]
    """Angle of the slope, downhill positive [rad]."""
    m: float = _SEED["m"]
    """Mass of one leg [kg]."""
    J: float = _SEED["J"]
    """Moment of inertia of one leg about its centre of mass [kg m^2]."""
    l: float = _SEED["l"]
    """Hip to sole [m]."""
    d: float = _SEED["d"]
    """Hip to the leg's centre of mass [m]."""
    r: float = _SEED["r"]
    """Foot radius [m]."""
    hip_mass: float = _SEED["hip_mass"]
    """Point mass at the hip [kg]."""
    g: float = _SEED["g"]
    """Gravitational acceleration [m/s^2]."""
    n: float = _SEED["n"]
    """Exponent of the contact law."""
    K: float = _SEED["K"]
    """Contact stiffness [N/m^n]."""
    c: float = _SEED["c"]
    """Contact damping [N s/m^2]."""
    mu_static: float = _SEED["mu_static"]
    """Static friction coefficient."""
    mu_kinetic: float = _SEED["mu_kinetic"]
    """Kinetic friction coefficient."""
    v0: float = _SEED["v0"]
    """Slip speed of the friction's peak [m/s]."""
    xi: float = _SEED["xi"]
    """Stribeck rate [s/m]."""

    def scene(self) -> Scene:
        """The scene that these parameters describe; raises `ArgumentError`."""
        return seed_scene(**dataclasses.asdict(self))


@dataclasses.dataclass(frozen=True)
class StartOptions:
    """Start in the slope's frame; the seed's own unless said otherwise."""

    hip_x: float = _START["hip_x"]
    """Hip, along the slope [m]."""
    hip_z: float = _START["hip_z"]
    """Hip, above the slope [m]."""
    theta_1: float = _START["theta_1"]
    """Angle of leg 1 from the slope's normal, foot ahead positive [rad]."""
    theta_2: float = _START["theta_2"]
    """Angle of leg 2 [rad]."""
    hip_vx: float = _START["hip_vx"]
    """Hip velocity along the slope [m/s]."""
    hip_vz: float = _START["hip_vz"]
    """Hip velocity away from the slope [m/s]."""
    omega_1: float = _START["omega_1"]
    """Rate of leg 1 [rad/s]."""
    omega_2: float = _START["omega_2"]
    """Rate of leg 2 [rad/s]."""

    def state(self) -> State:
        """The start; raises `ArgumentError`."""
        return checked_state(State(**dataclasses.asdict(self)))


@dataclasses.dataclass(frozen=True)
class OutputOptions:
    """Where results go."""

    out: Path | None = None
    """Folder for pictures, an animation and the trajectory."""
    json: Path | None = None
    """File for the numbers in SI units; - prints only them."""

    def check(self) -> None:
        """Raises `ArgumentError` where something cannot be written."""
        if self.out is not None:
            check_writable_directory("--out", self.out)
        if self.json is not None and str(self.json) != "-":
            check_writable_file("--json", self.json)


@dataclasses.dataclass(frozen=True)
class SolveOptions:
    """How long and how to solve."""

    duration: float = 10.0
    """Simulated time [s]."""
    solver: str = "rodas4"
    """Name of a solver: ours (rodas3p, rodas4, rodas4p, rodas5p) or one of diffrax's."""
    rtol: float = 1e-6
    """Relative tolerance."""
    atol: float | None = None
    """Absolute tolerance (SI units); a hundredth of the relative one unless given."""
    engine: str = "auto"
    """What computes: xla, lanes, or auto for the faster one that can; lanes do not save every step,
    which a table of footsteps needs."""
