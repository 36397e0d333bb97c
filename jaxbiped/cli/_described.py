"""Scene, start and actuators that options describe."""

import dataclasses
from typing import Any

import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._parameter_declaration import parameter_infos
from jaxbiped._types import as_float
from jaxbiped.cli._actuation_options import ActuationOptions, named_text
from jaxbiped.cli._choices import SEED
from jaxbiped.cli._default_start import default_start
from jaxbiped.cli._walk_options import SceneOptions, StartOptions
from jaxbiped.constraints._constraint_methods import method_named
from jaxbiped.dynamics._state import WalkerState
from jaxbiped.scene._ground import Ground
from jaxbiped.scene._parameter_access import with_parameters
from jaxbiped.scene._ready_scenes import seed_scene
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.scene._walker import Walker
from jaxbiped.scene.actuation._abstract_actuator import AbstractActuator, Actuation
from jaxbiped.scene.actuation._catalogue import ACTUATORS
from jaxbiped.scene.laws._catalogue import friction_law_like, normal_law_like


def described_scene(options: SceneOptions) -> Scene | RigidScene | RedundantScene:
    """The scene that these options describe; raises `ArgumentError`."""
    scene = _rigid(options) if options.model == "rigid" else _compliant(options)
    scene = dataclasses.replace(scene, actuation=options.driven.actuation())
    scene = with_parameters(scene, options.named_values())
    if isinstance(scene, RigidScene) or options.formulation == "minimal":
        return scene
    return RedundantScene(scene, method_named(options.method or "index1"), options.orientation)


def _compliant(options: SceneOptions) -> Scene:
    own = seed_scene(**{name: getattr(options, name) for name in SEED})
    # By NumPy: JAX would compile a program for each operation.
    mass = jtu.tree_map(np.asarray, own.walker).total_mass
    normal = _law_like(options, "normal", ("K", "c", "n"), mass=mass, g=options.g)
    friction = _law_like(options, "friction", ("mu_static", "mu_kinetic", "v0", "xi"))
    return dataclasses.replace(own, normal=normal, friction=friction)


def _law_like(options: SceneOptions, kind: str, names: tuple[str, ...], **others: Any) -> Any:
    """A law matched to these parameters; raises `ArgumentError` for one that it has no use for."""
    like: Any = normal_law_like if kind == "normal" else friction_law_like
    values = {name: getattr(options, name) for name in names}
    law = like(getattr(options, kind), **values, **others)
    for name, value in values.items():
        usual = SEED[name].value
        if value != usual:
            other = like(getattr(options, kind), **values | {name: usual}, **others)
            if jtu.tree_all(jtu.tree_map(np.array_equal, law, other)):
                raise ArgumentError(
                    f"{name} = {value:g} is not allowed with {kind} = {getattr(options, kind)}: "
                    f"that law has no use for it."
                )
    return law


def _rigid(options: SceneOptions) -> RigidScene:
    body = {name: getattr(options, name) for name in ("m", "J", "l", "d", "r", "hip_mass")}
    return RigidScene(walker=Walker(**body), ground=Ground(slope=options.slope, g=options.g))


def described_start(
    options: StartOptions, scene: Scene | RigidScene | RedundantScene
) -> WalkerState:
    """The start, of the kind that the scene needs."""
    start = default_start(scene)
    own = {name: as_float(x) for name, x in options.given.items() if name in start._fields}
    return start._replace(**own)


def described_actuation(options: ActuationOptions) -> Actuation:
    """The actuators that were asked for, None where none was; raises `ArgumentError`."""
    parts = []
    for name, kind in ACTUATORS.items():
        texts = getattr(options, name.replace("-", "_"))
        if texts:
            parts.append(_actuator(name, kind, texts))
    return tuple(parts) or None


def _actuator(
    option: str, kind: type[AbstractActuator], texts: tuple[str, ...]
) -> AbstractActuator:
    infos, values = parameter_infos(kind), {}
    fields = {field.name: field for field in dataclasses.fields(kind)}
    for text in texts:
        name, value = named_text(option, text)
        check_choice(f"{option}'s name", name, fields)
        values[name] = _value(option, name, value) if name in infos else value
    for name, field in fields.items():
        if field.default is dataclasses.MISSING and name not in values:
            raise ArgumentError(f"{option} needs {name}=value, its {infos[name].quantity.words}.")
    return kind(**values)


def _value(option: str, name: str, text: str) -> Any:
    """A number, or several between commas."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        raise ArgumentError(
            f"{option} = '{name}={text}' is not allowed: {name} must be a number, and {text!r} is "
            "none."
        ) from None
    return numbers if len(numbers) > 1 else numbers[0]
