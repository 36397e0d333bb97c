"""Options that describe a scene and a start: the model, its laws, their parameters, actuators."""

import dataclasses
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import arg

import jaxbiped as jb
from jaxbiped._checks import ArgumentError, check_choice, check_finite, check_pair
from jaxbiped.cli._declarations import (
    Argument,
    fields,
    registered,
    signature,
)
from jaxbiped.cli._options import Check, Field, Options, among, one_of

if TYPE_CHECKING:
    AnyScene = jb.Scene | jb.RigidScene | jb.RedundantScene

MATCHED = {"normal": ("K", "c", "n"), "friction": ("mu_static", "mu_kinetic", "v0", "xi")}
"""Parameters that laws of each kind are matched to."""


def _seed_parameters() -> dict[str, Argument]:
    """The parameters of the seed's scene by their paper names, with their values there."""
    declared: dict[str, Argument] = {}
    for part in ("Walker", "Ground", "laws.RistowSchafer", "laws.BengisuAkay"):
        declared |= fields(part)
    return {
        name: declared[name]._replace(default=keyword.default)
        for name, keyword in signature("seed_scene").items()
    }


SEED = _seed_parameters()


def _parameter_fields() -> Iterator[tuple[str, Field]]:
    for name, parameter in SEED.items():
        assert parameter.info is not None
        checked = Annotated[float, arg(help=parameter.help), Check(parameter.info.check)]
        yield name, Field(checked, parameter.default)


def _actuator_fields() -> Iterator[tuple[str, Field]]:
    for name, part in registered("actuation").items():
        said = []
        for own, (default, _, info) in fields(part).items():
            words = f" {info.quantity.words} [{info.quantity.unit}]" if info else ""
            said.append(f"{own}={'...' if default is None else default}{words}")
        checked = Annotated[
            tuple[str, ...], arg(help="; ".join(said) + "."), Check(_named_text, each=True)
        ]
        yield name.replace("-", "_"), Field(checked, ())


def _named_text(option: str, text: str, example: str = "") -> tuple[str, str]:
    """Name and value of name=value; raises `ArgumentError`."""
    name, given, value = (part.strip() for part in text.partition("="))
    if not name or not given:
        raise ArgumentError(
            f"{option.replace('_', '-')} = {text!r} is not allowed: write name=value{example}."
        )
    return name, value


def _numbers(option: str, name: str, text: str, parts: list[str]) -> list[float]:
    """The parts of a text as numbers; raises `ArgumentError`."""
    try:
        return [float(part) for part in parts]
    except ValueError:
        raise ArgumentError(
            f"{option} = '{name}={text}' is not allowed: {name} must be a number, and {text!r} is "
            "none."
        ) from None


class ActuationOptions(Options, made=dict(_actuator_fields())):
    """What drives the walker beside gravity, each by its numbers as name=value (SI units)."""

    def actuation(self) -> tuple[Any, ...] | None:
        """The actuators that were asked for, None where none was; raises `ArgumentError`."""
        parts = (
            _actuator(name, kind, texts)
            for name, kind in jb.actuation.ACTUATORS.items()
            if (texts := getattr(self, name.replace("-", "_")))
        )
        return tuple(parts) or None


def _actuator(option: str, kind: Any, texts: tuple[str, ...]) -> Any:
    from jaxbiped._parameter_declaration import parameter_infos

    infos = parameter_infos(kind)
    values: dict[str, Any] = {}
    known = {field.name: field for field in dataclasses.fields(kind)}
    for text in texts:
        name, value = _named_text(option, text)
        check_choice(f"{option}'s name", name, known)
        values[name] = value
        if name in infos:
            numbers = _numbers(option, name, value, value.split(","))
            values[name] = numbers if len(numbers) > 1 else numbers[0]
    for name, field in known.items():
        if field.default is dataclasses.MISSING and name not in values:
            raise ArgumentError(f"{option} needs {name}=value, its {infos[name].quantity.words}.")
    return kind(**values)


class SceneOptions(Options, made=dict(_parameter_fields())):
    """What is modelled: the seed's scene with its parameters by their paper names (SI units)."""

    model: Annotated[str, among("compliant", "rigid")] = "compliant"
    """compliant, or rigid: feet that roll without slip and strike without rebound."""
    formulation: Annotated[str, among("minimal", "redundant")] = "minimal"
    """minimal, or redundant: each leg has coordinates of its own, joined at the hip by a method."""
    method: Annotated[str | None, one_of("constraints.CONSTRAINT_METHODS")] = None
    """How redundant coordinates hold the hip: standard, baumgarte, penalty, augmented, index1 (the
    usual one), index1aug or described."""
    orientation: Annotated[str, one_of("constraints.ORIENTATIONS")] = "angle"
    """How redundant coordinates write a leg's orientation: angle, or euler (parameters)."""
    normal: str = "ristow-schafer"
    """Law of the normal force (see jaxbiped models), matched to K, c and n under the weight."""
    friction: str = "bengisu-akay"
    """Law of friction, matched to mu-static, mu-kinetic, v0 and xi."""
    set: tuple[str, ...] = ()
    """Any parameters by name, as name=value, after the laws were matched."""
    driven: ActuationOptions

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself, before a scene is made."""
        super().check()
        check_choice("normal", self.normal, registered("laws", "normal"))
        check_choice("friction", self.friction, registered("laws", "friction"))
        check_pair("l", self.values["l"], "r", self.values["r"])
        for name, value in self.named_values().items():
            own = name.rpartition(".")[2]
            if own in SEED and self.values[own] != SEED[own].default:
                raise ArgumentError(
                    f"{own} = {self.values[own]:g} is not allowed with set = '{name}={value:g}': "
                    "give one of them."
                )
        self._check_that_all_is_used()

    @property
    def values(self) -> dict[str, float]:
        """The seed's parameters, by their paper names."""
        return {name: getattr(self, name) for name in SEED}

    def _check_that_all_is_used(self) -> None:
        rolls = self.model == "rigid"
        if rolls and self.formulation == "redundant":
            raise ArgumentError(
                'formulation = redundant is not allowed with model = "rigid": it rolls in minimal '
                "coordinates."
            )
        chosen = 'model = "rigid"' if rolls else 'formulation = "minimal"'
        mend = "" if rolls else "; --formulation redundant has them"
        unused = {}
        if rolls:
            contact = ("normal", "friction", "n", "K", "c", *MATCHED["friction"])
            unused = dict.fromkeys(contact, "its feet have no laws of contact.")
        if self.formulation == "minimal":
            unused |= dict.fromkeys(("method", "orientation"), f"it has no constraints{mend}.")
        for name, why in unused.items():
            if (value := getattr(self, name)) != getattr(SceneOptions, name):
                raise ArgumentError(f"{name} = {value} is not allowed with {chosen}: {why}")

    def named_values(self) -> dict[str, float]:
        """The parameters that were set by name; raises `ArgumentError`."""
        named = (_named_text("set", text, ", such as K=2e6") for text in self.set)
        return {name: _numbers("set", name, value, [value])[0] for name, value in named}

    def scene(self) -> "AnyScene":
        """The scene that these options describe; raises `ArgumentError`."""
        self.check()
        own = jb.seed_scene(**self.values)
        rolls = self.model == "rigid"
        scene: Any = jb.RigidScene(own.walker, own.ground) if rolls else self._with_laws(own)
        scene = dataclasses.replace(scene, actuation=self.driven.actuation())
        scene = jb.with_parameters(scene, self.named_values())
        if self.formulation == "minimal":
            return scene
        method = jb.constraints.CONSTRAINT_METHODS[self.method or "index1"]()
        return jb.RedundantScene(scene, method, self.orientation)

    def _with_laws(self, own: "jb.Scene") -> "jb.Scene":
        import jax.tree_util as jtu
        import numpy as np

        # By NumPy: JAX would compile a program for each operation.
        mass = jtu.tree_map(np.asarray, own.walker).total_mass
        normal = self._law("normal", {"mass": mass, "g": self.values["g"]})
        return dataclasses.replace(own, normal=normal, friction=self._law("friction", {}))

    def _law(self, kind: str, others: Mapping[str, Any]) -> Any:
        """A law matched to the parameters; raises `ArgumentError` for one that it cannot use."""
        import jax.tree_util as jtu
        import numpy as np

        like: Any = getattr(jb.laws, f"{kind}_law_like")
        values = {name: self.values[name] for name in MATCHED[kind]}
        law = like(getattr(self, kind), **values, **others)
        for name, value in values.items():
            usual = SEED[name].default
            if value != usual:
                other = like(getattr(self, kind), **values | {name: usual}, **others)
                if jtu.tree_all(jtu.tree_map(np.array_equal, law, other)):
                    raise ArgumentError(
                        f"{name} = {value:g} is not allowed with {kind} = {getattr(self, kind)}: "
                        "that law has no use for it."
                    )
        return law


def minimal(sentence: str) -> Check:
    """Refuses redundant coordinates with this sentence."""
    return Check(lambda _, scene: _require(scene.formulation == "minimal", sentence))


def compliant_and_minimal(what: str) -> Check:
    """Refuses rigid feet and redundant coordinates: what others are, such as "compared"."""
    sentence = f"model or formulation is not allowed here: compliant and minimal are {what}."
    usual = ("compliant", "minimal")
    return Check(lambda _, scene: _require((scene.model, scene.formulation) == usual, sentence))


def _require(holds: bool, sentence: str) -> None:
    if not holds:
        raise ArgumentError(sentence)


class StartOptions(Options):
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
        return {name: x for name, x in vars(self).items() if x is not None}

    def check(self) -> None:
        """Raises `ArgumentError` for a number that is not finite."""
        for name, value in self.given.items():
            check_finite(f"state.{name}", value)

    def guess(self, scene: "AnyScene") -> Any:
        """The start if any of it was said; else None, which leaves it to a search."""
        return self.state(scene) if self.given else None

    def state(self, scene: "AnyScene") -> Any:
        """The start, of the kind that the scene needs; raises `ArgumentError`.

        A rigid walker takes the place and the legs' angles and rates.
        """
        from jaxbiped._types import as_float
        from jaxbiped.cli._default_start import default_start

        self.check()
        start = default_start(scene)
        own = {name: as_float(x) for name, x in self.given.items() if name in start._fields}
        return start._replace(**own)
