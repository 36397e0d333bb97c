"""How many operations a scene's vector field takes."""

from collections import Counter
from typing import Any

import jax
import jax.numpy as jnp
import jax.tree_util as jtu

from jaxbiped.dynamics._bristles import state_type
from jaxbiped.dynamics._motion import vector_field
from jaxbiped.dynamics._rigid_state import RigidState
from jaxbiped.dynamics._rolling import rolling_field
from jaxbiped.lanes._graph import Block, Value
from jaxbiped.lanes._needed import Needed
from jaxbiped.lanes._program import emitted, inputs_of
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.scene._scene import Scene

_NO_WORK = ("input", "const", "part", "held", "taken")


def operation_counts(scene: Scene | RigidScene) -> dict[str, int]:
    """Operations of one evaluation of the scene's vector field, by name, most frequent first.

    Counted after equal operations are shared, constants folded, and all that depends on the scene
    alone is left out: what the lane engine computes for each stage of a step. An elementary
    function counts as the arithmetic that it is made of.
    """
    rigid = isinstance(scene, RigidScene)
    kind: Any = RigidState if rigid else state_type(scene)  # type: ignore[arg-type]
    field: Any = rolling_field if rigid else vector_field
    number = jax.ShapeDtypeStruct((), jnp.float64)
    state = kind(*[number] * len(kind._fields))
    given = jtu.tree_map(lambda _: number, scene)
    once = Block(invariant=True)
    every = Block(once)
    arrays = [inputs_of(every, number) for _ in state]
    parameters = [inputs_of(once, number) for _ in jtu.tree_leaves(given)]
    results = emitted(
        every, lambda y, args: field(0.0, y, args), (state, given), [*arrays, *parameters]
    )
    needed = Needed([value for array in results for value in array.ravel()])
    counts: Counter[str] = Counter()
    _add(counts, every, needed)
    return dict(counts.most_common())


def _add(counts: Counter[str], block: Block, needed: Needed) -> None:
    for value in block.values:
        if value in needed and value.op not in _NO_WORK:
            counts[value.op] += 1
        for inner in (arg for arg in value.args if isinstance(arg, Block)):
            _add(counts, inner, Needed(_results(value)))


def _results(value: Value) -> list[Value]:
    lists = [arg for arg in value.args if isinstance(arg, list | tuple)]
    return [v for each in lists for v in each if isinstance(v, Value)]
