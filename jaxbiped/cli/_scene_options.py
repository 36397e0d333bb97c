"""Options that describe a scene: the walker, the model, its laws, their parameters, actuators."""

import dataclasses
import re
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import arg

import jaxbiped as jb
from jaxbiped._checks import ArgumentError, check_choice, check_pair
from jaxbiped.cli._declarations import Argument, fields, registered, signature
from jaxbiped.cli._named_numbers import named_text, numbers_in, units_of
from jaxbiped.cli._options import Check, Field, Options, among, one_of
from jaxbiped.cli._walkers import SEED as SEED_WALKER
from jaxbiped.cli._walkers import WALKERS, check_walker, walker_of
from jaxbiped.models import MODELS

if TYPE_CHECKING:
    AnyScene = jb.Scene | jb.RigidScene | jb.RedundantScene

MATCHED = {"normal": ("K", "c", "n"), "friction": ("mu_static", "mu_kinetic", "v0", "xi")}
"""Parameters that laws of each kind are matched to."""
CLEARANCES = {"stance-rotation": "StanceRotation", "always-touching": "AlwaysTouching"}
_OF_WALKER = ("m", "J", "l", "d", "r", "hip_mass")
"""Parameters of the seed's walker."""
_NUMBERED = re.compile(r"_\d+$")
_OF_GROUND = ("slope", "g")
"""Parameters for which a published walker has its own values. Default: None."""


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
        kind: Any = float
        help_, default = parameter.help, parameter.default
        if name in _OF_GROUND:
            kind, default = float | None, None
            help_ += f" If omitted: that of a published walker, otherwise {parameter.default}."
        yield name, Field(Annotated[kind, arg(help=help_), Check(parameter.info.check)], default)


def _actuator_fields() -> Iterator[tuple[str, Field]]:
    for name, part in registered("actuation").items():
        said = []
        for own, (default, _, info) in fields(part).items():
            words = f" {info.quantity.words} [{info.quantity.unit}]" if info else ""
            said.append(f"{own}={'...' if default is None else default}{words}")
        checked = Annotated[
            tuple[str, ...], arg(help="; ".join(said) + "."), Check(named_text, each=True)
        ]
        yield name.replace("-", "_"), Field(checked, ())


class ActuationOptions(Options, made=dict(_actuator_fields())):
    """What drives the walker beside gravity, each by its numbers as name=value (SI units)."""

    @property
    def given(self) -> dict[str, dict[str, Any]]:
        """Values of the actuators that were asked for, by their names; raises `ArgumentError`."""
        return {
            name: _actuator_values(name, home, texts)
            for name, home in registered("actuation").items()
            if (texts := getattr(self, name.replace("-", "_")))
        }

    def check(self) -> None:
        """Raises `ArgumentError` for a name that an actuator lacks, or a value that is none."""
        super().check()
        _ = self.given

    def actuation(self) -> tuple[Any, ...] | None:
        """The actuators that were asked for, None where none was; raises `ArgumentError`."""
        kinds = jb.actuation.ACTUATORS
        return tuple(kinds[name](**values) for name, values in self.given.items()) or None


def _actuator_values(option: str, home: str, texts: tuple[str, ...]) -> dict[str, Any]:
    values: dict[str, Any] = {}
    declared = fields(home)
    for text in texts:
        name, value = named_text(option, text)
        check_choice(f"{option}'s name", name, declared)
        values[name] = value
        if info := declared[name].info:
            numbers = numbers_in(option, name, value, info.quantity.unit, count=0)
            for number in numbers:
                info.check(name, number)
            values[name] = numbers if len(numbers) > 1 else numbers[0]
    for name, (default, _, info) in declared.items():
        if default is None and info is not None and name not in values:
            raise ArgumentError(f"{option} needs {name}=value, its {info.quantity.words}.")
    return values


class SceneOptions(Options, made=dict(_parameter_fields())):
    """The model: the seed's scene, with its parameters under the paper's names (SI units)."""

    walker: Annotated[str, Check(check_walker)] = SEED_WALKER
    """Walker: seed, kneed, with-torso, or a published walker with its own scene, such as garcia
    (see jaxbiped models); or FILE.py:NAME, a Mechanism in a file, a module with a method
    mechanism(), or a function without arguments that returns one of these."""
    clearance: Annotated[str | None, among(*CLEARANCES)] = None
    """Which foot may touch: stance-rotation (while its leg rotates as a stance leg), or
    always-touching. If omitted: the walker's own rule."""
    model: Annotated[str | None, among("compliant", "rigid")] = None
    """Kind of feet: compliant, or rigid (they roll without slip and strike without rebound). If
    omitted: those of a published walker, otherwise compliant."""
    formulation: Annotated[str, among("minimal", "redundant")] = "minimal"
    """Coordinates: minimal, or redundant (each leg has its own, joined at the hip by a method)."""
    method: Annotated[str | None, one_of("constraints.CONSTRAINT_METHODS")] = None
    """Method that holds the hip in redundant coordinates: standard, baumgarte, penalty, augmented,
    index1 (used if omitted), index1aug or described."""
    orientation: Annotated[str, one_of("constraints.ORIENTATIONS")] = "angle"
    """Orientation of a leg in redundant coordinates: angle, or euler (parameters)."""
    normal: str = "ristow-schafer"
    """Law of the normal force (see jaxbiped models), matched to K, c and n under the weight."""
    friction: str = "bengisu-akay"
    """Law of friction, matched to mu-static, mu-kinetic, v0 and xi."""
    set: tuple[str, ...] = ()
    """Any parameters as name=value, set after the laws were matched."""
    driven: ActuationOptions

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself, before a scene is made."""
        super().check()
        check_choice("normal", self.normal, registered("laws", "normal"))
        check_choice("friction", self.friction, registered("laws", "friction"))
        if self._on_seed:
            check_pair("l", self.values["l"], "r", self.values["r"])
        for name, value in self.named_values(self.check_parameter).items():
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
        said = {name: getattr(self, name) for name in SEED}
        return {name: SEED[name].default if x is None else x for name, x in said.items()}

    def check_parameter(self, option: str, name: str, *others: str) -> str | None:
        """The unit of a parameter; None for a walker whose parameters only its scene knows.

        Raises:
            ArgumentError: a name that neither the scene of these options nor `others` have.
        """
        if self.walker != SEED_WALKER:
            return None
        parts = ["Walker", "Ground", *map(registered("actuation").get, self.driven.given)]
        if not self.rolls:
            parts += [registered("laws", kind)[getattr(self, kind)] for kind in MATCHED]
        infos = {base: entry.info for part in parts for base, entry in fields(str(part)).items()}
        units = {base: info.quantity.unit for base, info in infos.items() if info}
        base = name.rpartition(".")[2]
        if base not in units and _NUMBERED.sub("", base) not in units:
            check_choice(option, name, (*others, *units))
        return units.get(base, units.get(_NUMBERED.sub("", base)))

    @property
    def rolls(self) -> bool:
        if self.model is not None:
            return self.model == "rigid"
        own = MODELS.get(self.walker)
        return own is not None and own.rigid

    @property
    def _on_seed(self) -> bool:
        """Whether the walker has the parameters of the seed's."""
        return self.walker in WALKERS and not WALKERS[self.walker].own_parameters

    def _check_that_all_is_used(self) -> None:
        rolls = self.rolls
        if rolls and self.formulation == "redundant":
            raise ArgumentError(
                'formulation = redundant is not allowed with model = "rigid": it rolls in minimal '
                "coordinates."
            )
        chosen = 'model = "rigid"' if rolls else 'formulation = "minimal"'
        unused: list[tuple[str, tuple[str, ...], str]] = []
        if not self._on_seed:
            why = "that has parameters of its own, for --set."
            unused.append((f"walker = {self.walker!r}", _OF_WALKER, why))
        if rolls:
            contact = ("normal", "friction", "n", "K", "c", "clearance", *MATCHED["friction"])
            unused.append((chosen, contact, "its feet have no laws of contact."))
        if self.formulation == "minimal":
            why = "it has no constraints" + (
                "." if rolls else "; --formulation redundant has them."
            )
            unused.append((chosen, ("method", "orientation"), why))
        for told, options, why in unused:
            for name in options:
                if (value := getattr(self, name)) != getattr(SceneOptions, name):
                    raise ArgumentError(f"{name} = {value} is not allowed with {told}: {why}")

    def named_values(self, unit: Callable[[str, str], str | None]) -> dict[str, float]:
        """The parameters that were set by name, with their units; raises `ArgumentError`."""
        named = (named_text("set", text, ", such as K=2e6") for text in self.set)
        return {
            name: numbers_in("set", name, value, unit("parameter", name))[0]
            for name, value in named
        }

    def scene(self) -> "AnyScene":
        """The scene that these options describe; raises `ArgumentError`."""
        self.check()
        own = self._own_scene()
        walker = walker_of("walker", self.walker, own.walker)
        rolls = self.rolls
        scene: Any = jb.RigidScene(walker, own.ground) if rolls else self._with_laws(own, walker)
        driven = self.driven.actuation()
        scene = dataclasses.replace(scene, actuation=own.actuation if driven is None else driven)
        units = units_of(jb.parameter_quantities(scene))
        scene = jb.with_parameters(scene, self.named_values(lambda _, name: units.get(name, "")))
        if self.formulation == "minimal":
            return scene
        method = jb.constraints.CONSTRAINT_METHODS[self.method or "index1"]()
        return jb.RedundantScene(scene, method, self.orientation)

    def _own_scene(self) -> Any:
        """The published scene, or else the seed's, on the ground that the options give."""
        model = MODELS.get(self.walker)
        if model is None:
            values = self.values
            if not self._on_seed:
                values = {name: x for name, x in values.items() if name not in _OF_WALKER}
            return jb.seed_scene(**values)
        said = {name: x for name in _OF_GROUND if (x := getattr(self, name)) is not None}
        return jb.with_parameters(model.make(), said)

    def _with_laws(self, own: Any, walker: Any) -> "jb.Scene":
        import jax.tree_util as jtu
        import numpy as np

        from jaxbiped.scene._mechanism import mechanism_of

        # By NumPy: JAX would compile a program for each operation.
        mass = mechanism_of(jtu.tree_map(np.asarray, walker)).total_mass
        normal = self._law("normal", {"mass": mass, "g": own.ground.g})
        rule = own.clearance if self._on_seed else None
        if self.clearance is not None:
            rule = getattr(jb.laws, CLEARANCES[self.clearance])()
        return jb.Scene(walker, own.ground, normal, self._law("friction", {}), rule)

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


def minimal(sentence: str, *, compliant: bool = False) -> Check:
    """Refuses redundant coordinates, and rigid feet where it must be compliant, in a sentence."""

    def check(_: str, scene: SceneOptions) -> None:
        if scene.formulation != "minimal" or (compliant and scene.rolls):
            raise ArgumentError(sentence)

    return Check(check)


def compliant_and_minimal(what: str) -> Check:
    """Refuses rigid feet and redundant coordinates: what others are, such as "compared"."""
    here = "walker, model or formulation is not allowed here"
    return minimal(f"{here}: compliant and minimal are {what}.", compliant=True)
