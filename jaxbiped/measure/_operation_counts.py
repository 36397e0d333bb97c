"""Operation counts: how many operations a scene's vector field takes."""

from typing import Any

from jaxbiped.compiler import count_operations
from jaxbiped.dynamics._bristle_state import state_type
from jaxbiped.dynamics._minimal_motion import vector_field
from jaxbiped.dynamics._rigid_state import RigidState
from jaxbiped.dynamics._rolling import rolling_field
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.scene._scene import Scene


def operation_counts(scene: Scene | RigidScene) -> dict[str, int]:
    """Operations of one evaluation of the scene's vector field, by name, most frequent first.

    Counted after equal operations are shared, constants folded, and all that depends on the scene
    alone is left out: what the lane engine computes for each stage of a step. An elementary
    function counts as the arithmetic that it is made of.

    Args:
        scene: the walker, compliant or rigid.

    Returns:
        How many times each operation is done, by its name.
    """
    rigid = isinstance(scene, RigidScene)
    kind: Any = RigidState if rigid else state_type(scene)  # type: ignore[arg-type]
    field: Any = rolling_field if rigid else vector_field
    state = kind(*[0.0] * len(kind._fields))
    return count_operations(lambda y, args: field(0.0, y, args), state, scene)
