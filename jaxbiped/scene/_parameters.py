"""Parameters of a scene by name."""

import dataclasses
from collections.abc import Mapping
from typing import Any, TypeVar

import jax.tree_util as jtu

from jaxbiped._checks import check_choice
from jaxbiped.scene._redundant_scene import RedundantScene
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.scene._scene import Scene

SomeScene = TypeVar("SomeScene", bound=Scene | RigidScene | RedundantScene)

_FIRST = ("K", "c", "xi")
"""The parameters that sensitivities are first asked for."""


def parameter_names(scene: Scene | RigidScene | RedundantScene) -> tuple[str, ...]:
    """Names of a scene's parameters: K, c and xi first, the others in the scene's order.

    A name is the parameter's own, `K`; where two parts have one of that name, `normal.K`. Those of
    a redundant scene are those of what it models.

    Args:
        scene: of any kind.

    Returns:
        The names, one for each numeric leaf of the scene.

    Examples:
        >>> import jaxbiped as jb

        >>> jb.parameter_names(jb.seed_scene())[:5]
        ('K', 'c', 'xi', 'm', 'J')
    """
    if isinstance(scene, RedundantScene):
        return parameter_names(scene.scene)
    names = _names_by_leaf(scene)
    first = [name for name in _FIRST if name in names]
    return (*first, *(name for name in names if name not in first))


def parameter_values(scene: Scene | RigidScene) -> dict[str, Any]:
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
    by_leaf = dict(zip(_names_by_leaf(scene), jtu.tree_leaves(scene), strict=True))
    return {name: by_leaf[name] for name in parameter_names(scene)}


def select_parameters(
    scene: Scene | RigidScene, parameters: tuple[str, ...] | None
) -> tuple[tuple[str, ...], tuple[int, ...]]:
    """Names of the parameters asked for, all for None, and the positions of their leaves.

    Raises:
        ArgumentError: a name that the scene does not have.
    """
    by_leaf = _names_by_leaf(scene)
    names = parameter_names(scene) if parameters is None else tuple(parameters)
    for name in names:
        check_choice("parameters", name, by_leaf)
    return names, tuple(by_leaf.index(name) for name in names)


def with_parameters(scene: SomeScene, values: Mapping[str, Any]) -> SomeScene:
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
    if isinstance(scene, RedundantScene):
        modelled = with_parameters(scene.scene, values)
        return dataclasses.replace(scene, scene=modelled)
    names = _names_by_leaf(scene)
    paths = [path for path, _ in jtu.tree_flatten_with_path(scene)[0]]
    for name, value in values.items():
        check_choice("parameter", name, names)
        part, field = (key.name for key in paths[names.index(name)])
        changed = dataclasses.replace(getattr(scene, part), **{field: value})
        scene = dataclasses.replace(scene, **{part: changed})
    return scene


def _names_by_leaf(scene: Scene | RigidScene) -> list[str]:
    paths = [path for path, _ in jtu.tree_flatten_with_path(scene)[0]]
    own = [_format(path[-1:]) for path in paths]
    return [
        name if own.count(name) == 1 else _format(path)
        for name, path in zip(own, paths, strict=True)
    ]


def _format(path: tuple[Any, ...]) -> str:
    return ".".join(str(getattr(key, "name", key)) for key in path)
