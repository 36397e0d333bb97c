"""Operation counts: how many operations one call of a function takes in a lane."""

from collections import Counter
from collections.abc import Callable

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped.compiler.ir._graph import Block, Value
from jaxbiped.compiler.passes._liveness import Liveness
from jaxbiped.compiler.runtime._program import inputs_of, lower_function

_NO_WORK = ("input", "const", "part", "held", "taken")


def count_operations(
    function: Callable[[PyTree, PyTree], PyTree], varying: PyTree, invariant: PyTree
) -> dict[str, int]:
    """Operations of `function(varying, invariant)` by name, most frequent first.

    What depends on `invariant` alone is left out. Leaves are replaced by numbers.
    """
    number = jax.ShapeDtypeStruct((), jnp.float64)
    shapes = jtu.tree_map(lambda _: number, (varying, invariant))
    once = Block(invariant=True)
    every = Block(once)
    arrays = [inputs_of(every, number) for _ in jtu.tree_leaves(varying)]
    parameters = [inputs_of(once, number) for _ in jtu.tree_leaves(invariant)]
    results = lower_function(every, function, shapes, [*arrays, *parameters])
    needed = Liveness([value for array in results for value in array.ravel()])
    counts: Counter[str] = Counter()
    _add(counts, every, needed)
    return dict(counts.most_common())


def _add(counts: Counter[str], block: Block, needed: Liveness) -> None:
    for value in block.values:
        if value in needed and value.op not in _NO_WORK:
            counts[value.op] += 1
        for inner in (arg for arg in value.args if isinstance(arg, Block)):
            _add(counts, inner, Liveness(_results(value)))


def _results(value: Value) -> list[Value]:
    lists = [arg for arg in value.args if isinstance(arg, list | tuple)]
    return [v for each in lists for v in each if isinstance(v, Value)]
