"""Relaxed walkers: the scenes from which a homotopy begins, whose gait is known or easily found."""

import dataclasses
import functools
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple, TypeVar, cast

import equinox as eqx
import jax
import jax.tree_util as jtu

from jaxbiped._parameter_declaration import with_fields
from jaxbiped._types import as_float
from jaxbiped.dynamics._energy import is_driven
from jaxbiped.scene._joint_parts import Motor, Stop
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._ready_scenes import kneed_scene, seed_scene
from jaxbiped.scene._scene import AbstractWalkerScene, Scene, WalkerScene
from jaxbiped.scene._walker import Walker
from jaxbiped.scene.actuation._actuators import Actuation
from jaxbiped.scene.laws._abstract_laws import FRICTION_LAWS, NORMAL_LAWS
from jaxbiped.scene.laws._catalogue import friction_law_like, normal_law_like

_Law = TypeVar("_Law", bound=eqx.Module)
_LAWS: dict[str, tuple[Mapping[str, type], Callable[[str], Any]]] = {
    "normal": (NORMAL_LAWS, normal_law_like),
    "friction": (FRICTION_LAWS, friction_law_like),
}
"""Catalogues of the parts of a scene that are laws of contact, and what resembles the seed's."""
_LIGHT, _STRENGTHS = 1e-3, ("mass", "inertia", "stiffness", "damping", "torque")
"""Factor of what is taken in along a line, and what is."""


def has_seed_bodies(scene: AbstractWalkerScene) -> bool:
    """Whether a walker is one of the seed paper, with other numbers."""
    return isinstance(scene.walker, Walker)


def is_far_from_seed(scene: AbstractWalkerScene) -> bool:
    """Whether starts about the seed's mostly fall, and are dear: other bodies in stiff motion."""
    return scene.stiff and scene.minimal is scene and not has_seed_bodies(scene)


def relaxed(scene: Any) -> tuple[Any, Any] | None:
    """A scene whose walker walks more easily, and the given one; None where there is no such.

    Bodies that are no part of a leg have hardly any mass, and springs and latches on them are as
    weak. Mass centres of legs of one body lie on the line along it, and so do their feet.
    Motors and actuators hardly do anything; where there are any the ground slopes as the seed's.
    """
    mechanism = scene.mechanism
    light, straight = _light_pieces(mechanism), _straightened_pieces(mechanism)
    driven = is_driven(scene)
    if not light and not straight and not driven:
        return None
    whole = [_with_share(piece) for piece in mechanism.pieces]
    easy = list(whole)
    for k in light:
        easy[k] = _weakened(easy[k])
    for k, changed in straight.items():
        easy[k] = with_fields(easy[k], centre=changed)
    first, last = (
        dataclasses.replace(scene, walker=with_fields(mechanism, pieces=tuple(pieces)))
        for pieces in (easy, whole)
    )
    if driven:
        ground = dataclasses.replace(scene.ground, slope=seed_scene().ground.slope)
        first = dataclasses.replace(first, ground=ground, actuation=_idle(scene))
    return jtu.tree_map(as_float, first), jtu.tree_map(as_float, last)


def like_model(scene: Any) -> tuple[Any, Any] | None:
    """A scene with legs of a model of the same kind, and the given one; None without a model.

    They have the scene's size and weight, and the model's slope and laws of contact in proportion.
    Springs and latches hardly do anything.
    """
    mechanism, models = scene.mechanism, (seed_scene(), kneed_scene())
    kind = _kind_of_legs(mechanism)
    model = next((each for each in models if _kind_of_legs(each.mechanism) == kind), None)
    if model is None:
        return None
    size, own = _sizes(scene, model), model.mechanism
    weak = {
        k
        for k, j in zip(mechanism.structure.joint_pieces, mechanism.joints, strict=True)
        if not isinstance(j, Stop)
    }
    pieces = [_weakened(piece) if k in weak else piece for k, piece in enumerate(mechanism.pieces)]
    for k, like in _leg_pieces(mechanism, own):
        pieces[k] = _piece_like(pieces[k], like, size)
    root_mass = None if mechanism.root_mass is None else size.mass * own.root_mass
    begin = dataclasses.replace(
        scene,
        walker=with_fields(mechanism, pieces=tuple(pieces), root_mass=root_mass),
        ground=dataclasses.replace(scene.ground, slope=model.ground.slope),
        normal=_normal_like(scene.normal, model.normal, size, size.force, size.length),
        friction=_friction_like(scene.friction, model.friction, size),
        actuation=_idle(scene),
    )
    last = dataclasses.replace(scene, walker=mechanism)
    return jtu.tree_map(as_float, begin), jtu.tree_map(as_float, last)


class _Sizes(NamedTuple):
    """Masses, lengths and times of a walker in a model's, by its weight, its height and gravity."""

    mass: Any
    length: Any
    time: Any

    @property
    def force(self) -> Any:
        return self.mass * self.length / self.time**2


def _sizes(scene: Scene, model: Scene) -> _Sizes:
    mine, theirs = scene.mechanism, model.mechanism
    length = mine.height / theirs.height
    time = (length * model.ground.g / scene.ground.g) ** 0.5
    return _Sizes(mine.total_mass / theirs.total_mass, length, time)


def _kind_of_legs(mechanism: Mechanism) -> tuple[object, ...]:
    """By legs, how many bodies bear each foot, all of them the leg's own; and whether stops act."""
    structure = mechanism.structure
    chains = [[structure.chains[structure.feet[k]] for k in feet] for feet in structure.feet_of_leg]
    lengths = [
        [len(chain) * all(structure.leg_of_body(j) == leg for j in chain) for chain in own]
        for leg, own in enumerate(chains)
    ]
    return lengths, any(isinstance(part, Stop) for part in mechanism.joints)


def _leg_pieces(mechanism: Mechanism, model: Mechanism) -> Iterator[tuple[int, Any]]:
    """Numbers of the pieces of legs and their stops, each with the model's in its place."""
    structure, own = mechanism.structure, model.structure
    for mine, theirs in zip(structure.feet_of_leg, own.feet_of_leg, strict=True):
        for k, like in zip(mine, theirs, strict=True):
            yield structure.foot_pieces[k], model.pieces[own.foot_pieces[like]]
            chains = structure.chains[structure.feet[k]], own.chains[own.feet[like]]
            for j, body in zip(*chains, strict=True):
                yield structure.body_pieces[j], model.pieces[own.body_pieces[body]]
    stops = [part for part in model.joints if isinstance(part, Stop)]
    for k, part in zip(structure.joint_pieces, mechanism.joints, strict=True):
        if isinstance(part, Stop) and stops:
            yield k, stops[0]


def _piece_like(piece: Any, like: Any, size: _Sizes) -> Any:
    """A piece with a model's numbers; one that the model lacks vanishes."""
    units = dict(mass=size.mass, inertia=size.mass * size.length**2, radius=size.length)
    units |= dict(along=size.length, ahead=size.length, upper=1.0, lower=1.0)
    changed: dict[str, Any] = {}
    for name, value in vars(piece).items():
        other = getattr(like, name, None)
        if name in ("centre", "at") and value is not None and other is not None:
            changed[name] = _piece_like(value, other, size)
        elif name == "law" and other is not None:
            changed[name] = _normal_like(value, other, size, size.force * size.length, 1.0)
        elif name in units and value is not None:
            changed[name] = 0.0 * value if other is None else units[name] * other
    return with_fields(piece, **changed)


def _light_pieces(mechanism: Mechanism) -> set[int]:
    """Bodies that are no part of a leg, what acts on them, and motors."""
    structure = mechanism.structure
    legs = range(len(structure.legs))
    on_legs = {body for leg in legs for body in structure.bodies_of_leg(leg)}
    light = {j for j in range(len(structure.bodies)) if j not in on_legs}
    found = {structure.body_pieces[j] for j in light}
    for k, angle, part in zip(
        structure.joint_pieces, structure.joints, mechanism.joints, strict=True
    ):
        if isinstance(part, Motor) or light & {j for j, _ in angle.weights}:
            found.add(k)
    return found


def _straightened_pieces(mechanism: Mechanism) -> dict[int, Any]:
    """By the numbers of bodies and feet of legs of one body: centres on the line along it.

    A leg of several may need its mass centres ahead, as a knee that they keep at its stop.
    """
    structure, pieces = mechanism.structure, cast("tuple[Any, ...]", mechanism.pieces)
    alone = {j for j in structure.feet if structure.parents[j] < 0 and not structure.children[j]}
    straight = {j for j in alone if structure.feet.count(j) == 1}
    places = [
        *zip(range(len(structure.bodies)), structure.body_pieces, strict=True),
        *zip(structure.feet, structure.foot_pieces, strict=True),
    ]
    centres = {k: pieces[k].centre for j, k in places if j in straight}
    return {
        k: with_fields(centre, ahead=0.0 * centre.ahead)
        for k, centre in centres.items()
        if centre.ahead is not None
    }


def _with_share(piece: Any) -> Any:
    """The piece itself; a motor with its share written."""
    if not isinstance(piece, Motor) or piece.share is not None:
        return piece
    return with_fields(piece, share=as_float(1.0))


def _weakened(piece: Any) -> Any:
    names = ("share",) if isinstance(piece, Motor) else _STRENGTHS
    known = {name: getattr(piece, name, None) for name in names}
    return with_fields(piece, **{k: _LIGHT * x for k, x in known.items() if x is not None})


def seed_like(scene: WalkerScene) -> WalkerScene:
    """The seed's walker and ground, with the scene's laws, made to resemble the seed's."""
    laws = {name: how for name, how in _LAWS.items() if hasattr(scene, name)}
    with jax.ensure_compile_time_eval():
        own = jtu.tree_map(float, seed_scene())
        alike = {name: _like_seed(getattr(scene, name), *how) for name, how in laws.items()}
        begin = dataclasses.replace(
            scene, walker=own.walker, ground=own.ground, actuation=_idle(scene), **alike
        )
        return jtu.tree_map(as_float, begin)


def _idle(scene: WalkerScene) -> Actuation:
    """The scene's actuators at strength zero: the seed's walker is passive."""
    return None if scene.actuation is None else tuple(part.idle() for part in scene.actuation)


def _normal_like(law: Any, model: Any, size: _Sizes, force: Any, length: Any) -> Any:
    """A law with numbers that resemble a model's of Ristow and Schäfer, in these units."""
    like = functools.partial(
        normal_law_like,
        K=model.K * force / length**model.n,
        c=model.c * force * size.time / length**2,
        n=model.n,
        mass=2.0 * size.mass,
    )
    return _like_seed(law, NORMAL_LAWS, like)


def _friction_like(law: Any, model: Any, size: _Sizes) -> Any:
    pace = size.length / size.time
    like = functools.partial(friction_law_like, v0=model.v0 * pace, xi=model.xi / pace)
    return _like_seed(law, FRICTION_LAWS, like)


def _like_seed(law: _Law, catalogue: Mapping[str, type], like: Callable[[str], Any]) -> _Law:
    """A law of the catalogue with numbers that resemble the seed's; its own where these lack."""
    name = next((name for name, kind in catalogue.items() if kind is type(law)), None)
    if name is None:
        return law
    alike = like(name)
    own = [field.name for field in dataclasses.fields(law) if not field.metadata.get("static")]
    values = {name: getattr(alike, name) for name in own if getattr(law, name) is not None}
    known = {name: value for name, value in values.items() if value is not None}
    return dataclasses.replace(law, **known)
