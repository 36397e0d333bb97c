"""Parameters of a scene by name, and the identity of a scene that is made of them."""

import dataclasses
from collections import Counter
from collections.abc import Mapping
from typing import Any, TypeAlias, TypeVar

import equinox as eqx
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice, warn
from jaxbiped._identity import identity
from jaxbiped._parameter_declaration import parameter_infos, with_fields
from jaxbiped._quantity import Quantity
from jaxbiped._types import JsonObject, Parameter, Scalar
from jaxbiped.scene._bodies import Point
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._mechanism_pieces import path_texts
from jaxbiped.scene._scene import AbstractScene, AbstractWalkerScene
from jaxbiped.scene.laws._abstract_laws import AbstractNormalLaw

SomeScene = TypeVar("SomeScene", bound=eqx.Module)
_Path: TypeAlias = tuple[Any, ...]
"""Keys of a leaf, as JAX gives them."""

_FIRST = ("K", "c", "xi")
"""The parameters that sensitivities are first asked for."""


def parameter_names(scene: AbstractScene) -> tuple[str, ...]:
    """Names of a scene's parameters: K, c and xi first, then the others in the scene's order.

    A parameter has its own name, such as `K`; if two parts have a parameter of that name, the part
    is added, as in `normal.K`. One of several numbers has its index, as in `torque_1`. Parameters
    of a mechanism begin with the name of a body, as in `thigh.mass`, `shank.foot.radius` or
    `shank.stop.K`. Those of a walker with fields of its own have their paths, such as `m_thigh` or
    `stop.K`, with the prefix `walker.` if the scene has the same name. A redundant scene has the
    parameters of the scene that it models.

    Args:
        scene: a scene of any kind, a mechanism, or any other module of parameters.

    Returns:
        The names, one for each numeric leaf of the scene.

    Examples:
        >>> import jaxbiped as jb
        >>> jb.parameter_names(jb.seed_scene())[:5]
        ('K', 'c', 'xi', 'm', 'J')
    """
    return tuple(_parameters(scene))


def parameter_values(scene: AbstractScene) -> dict[str, Scalar]:
    """A scene's parameters by name (see `parameter_names`), as the leaves of the scene.

    Args:
        scene: a scene of any kind.

    Returns:
        Values by name, in SI units, in the order of `parameter_names`.

    Examples:
        >>> import jaxbiped as jb
        >>> float(jb.parameter_values(jb.seed_scene())["K"])
        1000000.0
    """
    return {name: leaf for name, (_, leaf) in _parameters(scene).items()}


def parameter_quantities(scene: AbstractScene) -> dict[str, Quantity]:
    """Words, symbol and unit of each of a scene's parameters, by name (see `parameter_names`).

    For a field that was not declared with `jaxbiped.laws.parameter`, only the name is known. If two
    parameters have one symbol, those of a part, such as a body, have its name as an index.

    Args:
        scene: a scene of any kind.

    Returns:
        A `Quantity` (words, symbol and SI unit) for each name.
    """
    paths = {name: path for name, (path, _) in _parameters(scene).items()}
    quantities = {name: _quantity(_modelled(scene), name, path) for name, path in paths.items()}
    shared = Counter(word.symbol or word.words for word in quantities.values())
    for name, quantity in quantities.items():
        part, dot, _ = name.rpartition(".")
        if dot and shared[quantity.symbol or quantity.words] > 1:
            quantities[name] = quantity.of_part(part)
    return quantities


def _quantity(part: object, name: str, path: _Path) -> Quantity:
    angular = _is_walker(part)  # a normal law in a walker is one of an angle
    of_mechanism = False
    for position, key in enumerate(path):
        if isinstance(key, jtu.SequenceKey):
            part = part[key.idx]  # type: ignore[index]
            continue
        if not dataclasses.is_dataclass(part):
            break  # an entry of a user's own dictionary
        infos = parameter_infos(type(part))
        if key.name in infos:
            found = _entry(infos[key.name].quantity, path[position + 1 :])
            if isinstance(part, Point):
                found = found._replace(words=f"{path[position - 1].name} {found.words}")
            if of_mechanism:
                found = found._replace(words=f"{found.words}, {name.rpartition('.')[0]}")
            return found.angular if angular and isinstance(part, AbstractNormalLaw) else found
        angular = angular or key.name == "walker"
        of_mechanism = of_mechanism or isinstance(part, Mechanism)
        part = getattr(part, key.name)
    return Quantity(name)


def _entry(quantity: Quantity, rest: _Path) -> Quantity:
    """A quantity, or one of several by its number."""
    if not rest:
        return quantity
    number = rest[0].idx + 1
    symbol = quantity.symbol[:-1] + f"_{{{number}}}$" if quantity.symbol else ""
    return Quantity(f"{quantity.words} {number}", symbol, quantity.unit)


def select_parameters(
    scene: PyTree, parameters: tuple[str, ...] | None
) -> tuple[tuple[str, ...], tuple[int, ...]]:
    """Names of the parameters asked for, all for None, and the positions of their leaves.

    Leaves of anything but a scene have names in the same way.

    Raises:
        ArgumentError: a name that the scene does not have.
    """
    is_plain = parameters is not None and not hasattr(parameters, "__iter__")
    if isinstance(parameters, str) or is_plain:
        name = parameters if isinstance(parameters, str) else "slope"
        raise ArgumentError(
            f"parameters = {parameters!r} is not allowed: give a tuple of names, such as "
            f"({name!r},)."
        )
    names = parameter_names(scene) if parameters is None else tuple(parameters)
    by_leaf = list(_leaves_by_name(scene))
    for name in names:
        check_choice("parameters", name, by_leaf)
    return names, tuple(by_leaf.index(name) for name in names)


def with_parameters(scene: SomeScene, values: Mapping[str, Parameter]) -> SomeScene:
    """The scene with other values of some parameters (see `parameter_names`), checked again.

    Args:
        scene: a scene of any kind.
        values: new values by name, SI units; arrays of shape (n,) make a batch of scenes for
            `vmap`.

    Returns:
        A new scene of the same kind; the given one is not changed.

    Raises:
        ArgumentError: the scene does not have a parameter of that name, or a value is not allowed.

    Examples:
        >>> import jaxbiped as jb
        >>> scene = jb.with_parameters(jb.seed_scene(), {"slope": 0.01, "K": 2e6})
        >>> float(scene.ground.slope), float(scene.normal.K)
        (0.01, 2000000.0)
    """
    changed = _modelled(scene)
    leaves = _leaves_by_name(changed)
    if not all(name in leaves for name in values):
        untied = _untied(changed)
        apart = {} if untied is None else _leaves_by_name(untied)
        for name in values:
            check_choice("parameter", name, leaves if name not in apart else apart)
        paired = {name: value for name, value in values.items() if name in leaves}
        changed = _untied(with_parameters(changed, paired))
        values = {name: value for name, value in values.items() if name not in leaves}
        leaves = apart
        warn(
            f"{', '.join(values)}: the sides differ, so the mirror is dropped, and a cycle of the "
            "walk is a stride instead of a step.",
            UserWarning,
        )
    changed = _replace(changed, {leaves[name][0]: value for name, value in values.items()})
    return scene.with_minimal(changed) if isinstance(scene, AbstractScene) else changed


def _untied(model: Any) -> Any:
    """A mechanism, or a scene with one, without its mirror; None where there is none to drop."""
    if isinstance(model, Mechanism):
        return model.untied() if model.structure.body_twins is not None else None
    if not isinstance(model, AbstractWalkerScene):
        return None
    walker = _untied(model.walker)
    return None if walker is None else _rebuilt(model, {"walker": walker})


def _replace(part: Any, values: dict[_Path, Parameter]) -> Any:
    """A part with other leaves, every part on the way to them checked anew."""
    if () in values:
        return values[()]
    inner: dict[Any, dict[_Path, Parameter]] = {}
    for path, value in values.items():
        inner.setdefault(path[0], {})[path[1:]] = value
    if not inner:
        return part
    if isinstance(part, tuple):
        changed = {key.idx: _replace(part[key.idx], rest) for key, rest in inner.items()}
        return tuple(changed.get(i, each) for i, each in enumerate(part))
    return _rebuilt(
        part, {key.name: _replace(getattr(part, key.name), rest) for key, rest in inner.items()}
    )


def _rebuilt(part: Any, fields: dict[str, Any]) -> Any:
    """A module with other fields, converted and checked as at first, whatever its `__init__` is."""
    for field in dataclasses.fields(part):
        if field.name in fields and "converter" in field.metadata:
            fields[field.name] = field.metadata["converter"](fields[field.name])
    changed = with_fields(part, **fields)
    for kind in type(changed).__mro__:
        if "__check_init__" in vars(kind):
            vars(kind)["__check_init__"](changed)
    return changed


def _parameters(scene: PyTree) -> dict[str, tuple[_Path, Scalar]]:
    """Paths and leaves of a scene's parameters by name, those first that are first asked for."""
    leaves = _leaves_by_name(scene)
    return {name: leaves[name] for name in _FIRST if name in leaves} | leaves


def _is_walker(model: Any) -> bool:
    """Whether a model is a mechanism or has one of its own, and is no scene of it."""
    own = isinstance(model, Mechanism) or hasattr(model, "mechanism")
    return own and not isinstance(model, AbstractScene)


def _modelled(scene: Any) -> Any:
    return scene.minimal if isinstance(scene, AbstractScene) else scene


def _leaves_by_name(scene: PyTree) -> dict[str, tuple[_Path, Scalar]]:
    """Paths and leaves of what is modelled, by name, in the order of the leaves."""
    modelled = _modelled(scene)
    leaves = jtu.tree_flatten_with_path(modelled)[0]
    if _is_walker(modelled):
        names = _walker_names(modelled)
    elif isinstance(modelled, AbstractWalkerScene):
        names = _scene_names(modelled, [path for path, _ in leaves])
    else:
        names = _shortest_names([path for path, _ in leaves])
    return dict(zip(names, leaves, strict=True))


def _scene_names(scene: AbstractWalkerScene, paths: list[_Path]) -> list[str]:
    """Names of a scene's leaves, of which the walker's lengthen none."""
    of_walker = [path[0].name == "walker" for path in paths]
    others = _shortest_names([p for p, inner in zip(paths, of_walker, strict=True) if not inner])
    rest = iter(others)
    own = (f"walker.{name}" if name in others else name for name in _walker_names(scene.walker))
    return [next(own) if inner else next(rest) for inner in of_walker]


def _walker_names(walker: Any) -> list[str]:
    """Names of a walker's leaves: those of its bodies, or the paths of its own fields."""
    if isinstance(walker, Mechanism):
        return list(walker.parameter_names())
    return [".".join(path_texts(path)) for path, _ in jtu.tree_flatten_with_path(walker)[0]]


def _shortest_names(paths: list[_Path]) -> list[str]:
    whole = [path_texts(path) for path in paths]
    own = [texts[-1] for texts in whole]
    return [texts[-1] if own.count(texts[-1]) == 1 else ".".join(texts) for texts in whole]


def scene_identity(scene: AbstractScene) -> JsonObject:
    """The numbers of a scene by name, and what it is made of besides: kind, laws, rules, method.

    Args:
        scene: one of any kind, whose numbers are known.

    Returns:
        "scene", its parameters and the constants of a constraint method by name; and "model".
    """
    numbers = {name: np.asarray(value).tolist() for name, value in parameter_values(scene).items()}
    if scene.redundant:
        constants = jtu.tree_flatten_with_path(scene.method)[0]  # type: ignore[attr-defined]
        numbers |= {f"method{jtu.keystr(at)}": np.asarray(x).tolist() for at, x in constants}
    return {"scene": numbers, "model": identity(scene)}
