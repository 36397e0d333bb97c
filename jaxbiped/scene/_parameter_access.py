"""Parameters of a scene by name, and the identity of a scene that is made of them."""

import dataclasses
from collections.abc import Mapping
from typing import Any, TypeAlias, TypeVar

import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._identity import identity
from jaxbiped._parameter_declaration import parameter_infos
from jaxbiped._quantity import Quantity
from jaxbiped._types import JsonObject, Parameter, Scalar
from jaxbiped.scene._scene import AbstractScene

SomeScene = TypeVar("SomeScene", bound=AbstractScene)
_Path: TypeAlias = tuple[Any, ...]
"""Keys of a leaf, as JAX gives them."""

_FIRST = ("K", "c", "xi")
"""The parameters that sensitivities are first asked for."""


def parameter_names(scene: AbstractScene) -> tuple[str, ...]:
    """Names of a scene's parameters: K, c and xi first, the others in the scene's order.

    A name is the parameter's own, `K`; where two parts have one of that name, `normal.K`; one of
    several has its number, `torque_1`. Those of a redundant scene are those of what it models.

    Args:
        scene: of any kind.

    Returns:
        The names, one for each numeric leaf of the scene.

    Examples:
        >>> import jaxbiped as jb
        >>> jb.parameter_names(jb.seed_scene())[:5]
        ('K', 'c', 'xi', 'm', 'J')
    """
    return tuple(_parameters(scene))


def parameter_values(scene: AbstractScene) -> dict[str, Scalar]:
    """A scene's parameters by name (see `parameter_names`), their own leaves.

    Args:
        scene: of any kind.

    Returns:
        Values by name, SI units, in the order of `parameter_names`.

    Examples:
        >>> import jaxbiped as jb
        >>> float(jb.parameter_values(jb.seed_scene())["K"])
        1000000.0
    """
    return {name: leaf for name, (_, leaf) in _parameters(scene).items()}


def parameter_quantities(scene: AbstractScene) -> dict[str, Quantity]:
    """What each of a scene's parameters is, with its unit, by name (see `parameter_names`).

    Of a law's field that is no `jaxbiped.laws.parameter` no more is known than its name.

    Args:
        scene: of any kind.

    Returns:
        A `Quantity` (words, symbol and SI unit) by each name.
    """
    known = _parameters(scene).items()
    return {name: _quantity(scene.minimal, name, path) for name, (path, _) in known}


def _quantity(part: object, name: str, path: _Path) -> Quantity:
    for position, key in enumerate(path):
        if isinstance(key, jtu.SequenceKey):
            part = part[key.idx]  # type: ignore[index]
            continue
        if not dataclasses.is_dataclass(part):
            break  # an entry of a user's own dictionary
        infos = parameter_infos(part)
        if key.name in infos:
            return _entry(infos[key.name].quantity, path[position + 1 :])
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
    if isinstance(parameters, str):
        raise ArgumentError(
            f"parameters = {parameters!r} is not allowed: give a tuple of names, such as "
            f"({parameters!r},)."
        )
    names = tuple(_parameters(scene) if parameters is None else parameters)
    by_leaf = list(_leaves_by_name(scene))
    for name in names:
        check_choice("parameters", name, by_leaf)
    return names, tuple(by_leaf.index(name) for name in names)


def with_parameters(scene: SomeScene, values: Mapping[str, Parameter]) -> SomeScene:
    """The scene with other values of these parameters (see `parameter_names`), checked anew.

    Args:
        scene: of any kind.
        values: new values by name, SI units; arrays of shape (n,) make a batch of scenes for
            `vmap`.

    Returns:
        A new scene of the same kind; the one given is not changed.

    Raises:
        ArgumentError: a name that the scene does not have, or a value that is not allowed.

    Examples:
        >>> import jaxbiped as jb
        >>> scene = jb.with_parameters(jb.seed_scene(), {"slope": 0.01, "K": 2e6})
        >>> float(scene.ground.slope), float(scene.normal.K)
        (0.01, 2000000.0)
    """
    leaves, changed = _leaves_by_name(scene), scene.minimal
    for name, value in values.items():
        check_choice("parameter", name, leaves)
        changed = _replace(changed, leaves[name][0], value)
    return scene.with_minimal(changed)


def _replace(part: Any, path: _Path, value: Parameter) -> Any:
    if not path:
        return value
    key, rest = path[0], path[1:]
    if isinstance(key, jtu.SequenceKey):
        return tuple(
            _replace(each, rest, value) if i == key.idx else each for i, each in enumerate(part)
        )
    return dataclasses.replace(part, **{key.name: _replace(getattr(part, key.name), rest, value)})


def _parameters(scene: PyTree) -> dict[str, tuple[_Path, Scalar]]:
    """Paths and leaves of a scene's parameters by name, those first that are first asked for."""
    leaves = _leaves_by_name(scene)
    return {name: leaves[name] for name in _FIRST if name in leaves} | leaves


def _leaves_by_name(scene: PyTree) -> dict[str, tuple[_Path, Scalar]]:
    """Paths and leaves of what is modelled, by name, in the order of the leaves."""
    modelled = scene.minimal if isinstance(scene, AbstractScene) else scene
    leaves = jtu.tree_flatten_with_path(modelled)[0]
    whole = [_texts(path) for path, _ in leaves]
    own = [texts[-1] for texts in whole]
    names = [texts[-1] if own.count(texts[-1]) == 1 else ".".join(texts) for texts in whole]
    return dict(zip(names, leaves, strict=True))


def _texts(path: _Path) -> list[str]:
    """Names along a path; an entry of several is told by its number, from 1 on."""
    texts: list[str] = []
    for key in path:
        if isinstance(key, jtu.SequenceKey) and texts:
            texts[-1] += f"_{key.idx + 1}"
        else:
            texts.append(str(getattr(key, "name", key)))
    return texts


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
