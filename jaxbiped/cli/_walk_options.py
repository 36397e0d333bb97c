"""Options of `jaxbiped walk` and `gait`: the model, its laws and their parameters."""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jaxbiped._checks import (
    ArgumentError,
    check_choice,
    check_count,
    check_finite,
    check_pair,
    check_positive,
)
from jaxbiped._files import check_writable_directory, check_writable_file
from jaxbiped.cli._actuation_options import ActuationOptions
from jaxbiped.cli._choices import (
    CONSTRAINT_METHODS,
    FORMULATIONS,
    MODELS,
    ORIENTATIONS,
    SEED,
    SOLVERS,
    friction_law_names,
    normal_law_names,
)
from jaxbiped.cli._option_checks import check_accuracy, check_engine
from jaxbiped.cli._option_fields import Engine, Group, group

if TYPE_CHECKING:
    from jaxbiped.dynamics._state import WalkerState
    from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene

MOST_STEPS = 1 << 20
"""Solver's steps that nobody asked for more than: about 25 minutes of the seed's walk."""
_STEPS_OF_TEN_SECONDS = 65536


_OF_CONTACT = ("n", "K", "c", "mu_static", "mu_kinetic", "v0", "xi")


@dataclasses.dataclass(frozen=True)
class SceneOptions:
    """What is modelled: the seed's scene with its parameters by their paper names (SI units)."""

    model: str = "compliant"
    """compliant, or rigid: feet that roll without slip and strike without rebound."""
    formulation: str = "minimal"
    """minimal, or redundant: each leg has coordinates of its own, joined at the hip by a method."""
    method: str | None = None
    """How redundant coordinates hold the hip: standard, baumgarte, penalty, augmented, index1 (the
    usual one), index1aug or described."""
    orientation: str = "angle"
    """How redundant coordinates write a leg's orientation: angle, or euler (parameters)."""
    normal: str = "ristow-schafer"
    """Law of the normal force (see jaxbiped models), matched to K, c and n under the weight."""
    friction: str = "bengisu-akay"
    """Law of friction, matched to mu-static, mu-kinetic, v0 and xi."""
    set: tuple[str, ...] = ()
    """Any parameters by name, as name=value, after the laws were matched."""

    slope: float = SEED["slope"].value
    """Angle of the slope, downhill positive [rad]."""
    m: float = SEED["m"].value
    """Mass of one leg [kg]."""
    J: float = SEED["J"].value
    """Moment of inertia of one leg about its centre of mass [kg m^2]."""
    l: float = SEED["l"].value
    """Hip to sole [m]."""
    d: float = SEED["d"].value
    """Hip to the leg's centre of mass [m]."""
    r: float = SEED["r"].value
    """Foot radius [m]."""
    hip_mass: float = SEED["hip_mass"].value
    """Point mass at the hip [kg]."""
    g: float = SEED["g"].value
    """Gravitational acceleration [m/s^2]."""
    n: float = SEED["n"].value
    """Exponent of the contact law."""
    K: float = SEED["K"].value
    """Contact stiffness [N/m^n]."""
    c: float = SEED["c"].value
    """Contact damping [N s/m^2]."""
    mu_static: float = SEED["mu_static"].value
    """Static friction coefficient."""
    mu_kinetic: float = SEED["mu_kinetic"].value
    """Kinetic friction coefficient."""
    v0: float = SEED["v0"].value
    """Slip speed of the friction's peak [m/s]."""
    xi: float = SEED["xi"].value
    """Stribeck rate [s/m]."""

    driven: Group[ActuationOptions] = group(ActuationOptions)

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself, before a scene is made."""
        check_choice("model", self.model, MODELS)
        check_choice("formulation", self.formulation, FORMULATIONS)
        if self.method is not None:
            check_choice("method", self.method, CONSTRAINT_METHODS)
        check_choice("orientation", self.orientation, ORIENTATIONS)
        check_choice("normal", self.normal, normal_law_names())
        check_choice("friction", self.friction, friction_law_names())
        for name, parameter in SEED.items():
            parameter.info.check(name, getattr(self, name))
        check_pair("l", self.l, "r", self.r)
        for name, value in self.named_values().items():
            own = name.rpartition(".")[2]
            if own in SEED and getattr(self, own) != SEED[own].value:
                raise ArgumentError(
                    f"{own} = {getattr(self, own):g} is not allowed with set = '{name}={value:g}': "
                    "give one of them."
                )
        self.driven.check()
        self._check_that_all_is_used()

    def _check_that_all_is_used(self) -> None:
        usual, rolls = SceneOptions(), self.model == "rigid"
        if rolls and self.formulation == "redundant":
            raise ArgumentError(
                'formulation = redundant is not allowed with model = "rigid": it rolls in minimal '
                "coordinates."
            )
        for name in ("normal", "friction", *_OF_CONTACT) if rolls else ():
            value = getattr(self, name)
            if value != getattr(usual, name):
                raise ArgumentError(
                    f'{name} = {value} is not allowed with model = "rigid": its feet have no laws '
                    "of contact."
                )
        chosen = 'model = "rigid"' if rolls else 'formulation = "minimal"'
        mend = "" if rolls else "; --formulation redundant has them"
        for name in ("method", "orientation") if self.formulation == "minimal" else ():
            value = getattr(self, name)
            if value != getattr(usual, name):
                raise ArgumentError(
                    f"{name} = {value} is not allowed with {chosen}: it has no constraints{mend}."
                )

    def named_values(self) -> dict[str, float]:
        """The parameters that were set by name; raises `ArgumentError`."""
        return dict(map(_named_value, self.set))

    def scene(self) -> "Scene | RigidScene | RedundantScene":
        """The scene that these options describe; raises `ArgumentError`."""
        from jaxbiped.cli._described import described_scene

        self.check()
        return described_scene(self)


def _named_value(text: str) -> tuple[str, float]:
    name, given, value = (part.strip() for part in text.partition("="))
    if not name or not given:
        raise ArgumentError(f"set = {text!r} is not allowed: write name=value, such as K=2e6.")
    try:
        return name, float(value)
    except ValueError:
        raise ArgumentError(
            f"set = {text!r} is not allowed: {name} must be a number, and {value!r} is none."
        ) from None


@dataclasses.dataclass(frozen=True)
class StartOptions:
    """Start in the slope's frame; the seed's own, fitted to the scene, unless said otherwise."""

    hip_x: float | None = None
    """Hip, along the slope [m]; the seed's is 0."""
    hip_z: float | None = None
    """Hip, above the slope [m]; the seed's is 0.395, fitted to legs and ground."""
    theta_1: float | None = None
    """Angle of leg 1 from the slope's normal, foot ahead positive [rad]; the seed's is -0.2479."""
    theta_2: float | None = None
    """Angle of leg 2 [rad]; the seed's is 0.1655."""
    hip_vx: float | None = None
    """Hip velocity along the slope [m/s]; the seed's is 0.49797, fitted to the legs."""
    hip_vz: float | None = None
    """Hip velocity away from the slope [m/s]; the seed's is 0.05853, fitted likewise."""
    omega_1: float | None = None
    """Rate of leg 1 [rad/s]; the seed's is -0.0052."""
    omega_2: float | None = None
    """Rate of leg 2 [rad/s]; the seed's is -1.2565."""

    @property
    def given(self) -> dict[str, float]:
        """The numbers that were said."""
        return {name: x for name, x in dataclasses.asdict(self).items() if x is not None}

    def check(self) -> None:
        """Raises `ArgumentError` for a number that is not finite."""
        for name, value in self.given.items():
            check_finite(f"state.{name}", value)

    def state(self, scene: "Scene | RigidScene | RedundantScene") -> "WalkerState":
        """The start, of the kind that the scene needs; raises `ArgumentError`.

        A rigid walker takes the place and the legs' angles and rates.
        """
        from jaxbiped.cli._described import described_start

        self.check()
        return described_start(self, scene)


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
    solver: str = "rodas4p"
    """Name of a solver: ours (rodas3p, rodas4, rodas4p, rodas5p) or one of diffrax's."""
    accuracy: str | None = None
    """In place of tolerances: draft, balanced or tight; or a relative error, such as 1e-4."""
    rtol: float | None = None
    """Relative tolerance; 1e-6 unless given."""
    atol: float | None = None
    """Absolute tolerance (SI units); a hundredth of the relative one unless given."""
    dt: float | None = None
    """Steps of this size [s], in place of tolerances; what --solver euler needs."""
    max_solver_steps: int | None = None
    """Cap on the solver's steps: unless given 65536 for each ten seconds, at most 1048576."""
    engine: Engine = "auto"

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself."""
        check_choice("solver", self.solver, SOLVERS)
        check_accuracy(self.accuracy)
        check_engine(self.engine)
        for name, unit in (("rtol", ""), ("atol", ""), ("dt", "s")):
            value = getattr(self, name)
            if value is not None:
                check_positive(name, value, unit)
        for name in ("accuracy", "dt") if self.rtol is not None else ():
            if getattr(self, name) is not None:
                raise ArgumentError(
                    f"rtol = {self.rtol:g} is not allowed with {name} = {getattr(self, name)}: "
                    "give one of them."
                )
        self.most_steps()

    def wanted(self) -> float | None:
        """The relative error asked for; None where tolerances decide. Raises `ArgumentError`."""
        if self.accuracy is None:
            return None
        from jaxbiped.simulate._accurate_walk import check_accurate_walk
        from jaxbiped.solve._accuracy import accuracy_told

        return check_accurate_walk(accuracy_told(self.accuracy), atol=self.atol, dt=self.dt)

    def tolerances(self) -> dict[str, Any]:
        """What decides on the steps' sizes, as `simulate` takes it; raises `ArgumentError`."""
        if self.wanted() is not None:
            return {}
        if self.accuracy is not None:
            return {"accuracy": self.accuracy, "atol": self.atol}
        return {"rtol": self.relative, "atol": self.atol}

    @property
    def relative(self) -> float:
        """The relative tolerance, where no accuracy is given."""
        return 1e-6 if self.rtol is None else self.rtol

    def most_steps(self) -> int:
        """The cap on the solver's steps; raises `ArgumentError`."""
        check_positive("duration", self.duration, "s")
        if self.max_solver_steps is not None:
            check_count("max_solver_steps", self.max_solver_steps)
            return self.max_solver_steps
        if self.dt is not None:
            return MOST_STEPS
        return int(min(MOST_STEPS, _STEPS_OF_TEN_SECONDS * max(1.0, self.duration / 10.0)))
