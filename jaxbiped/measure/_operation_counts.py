"""Operation counts: how many operations a scene's vector field takes."""

from jaxbiped.compiler import count_operations
from jaxbiped.dynamics._state import field_of, state_type
from jaxbiped.scene._scene import RigidScene, Scene


def operation_counts(scene: Scene | RigidScene) -> dict[str, int]:
    """Operations of one evaluation of the scene's vector field, by name, most frequent first.

    These are the operations that the lanes engine computes for each stage of a step: equal
    operations are shared, constants are folded, and operations that depend on the scene alone are
    left out. An elementary function counts as the arithmetic of which it consists.

    Args:
        scene: the walker, compliant or rigid.

    Returns:
        The number of times that each operation occurs, by name.
    """
    kind, field = state_type(scene), field_of(scene)
    state = kind(*[0.0] * len(kind._fields))
    return count_operations(lambda y, args: field(0.0, y, args), state, scene)
