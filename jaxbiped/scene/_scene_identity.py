"""Identity of a scene: all that numbers computed from it depend on, ready for JSON.

Whatever outlives a call or a process (stores, kept evaluations) is known by it.
"""

import jax.tree_util as jtu
import numpy as np

from jaxbiped._identity import identity
from jaxbiped._types import JsonObject
from jaxbiped.scene._abstract_scene import AbstractScene
from jaxbiped.scene._parameters import parameter_values


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
