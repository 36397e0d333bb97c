"""Summary of a result in a line: how it ended, its shape, precision and memory, and what ran it.

And what a notebook shows of it, which `jaxbiped.plot` draws: through the public name, when it is
first asked for, as this lies below all that draws.
"""

import collections
import enum
import importlib

import equinox as eqx
import jax
import jax.tree_util as jtu
import numpy as np
from jaxtyping import ArrayLike, PyTree

from jaxbiped._types import Numbers

_UNITS = ("B", "kB", "MB", "GB", "TB")


def summary(
    result: PyTree, *, like: Numbers, code: ArrayLike, names: type[enum.IntEnum], engine: str
) -> str:
    """The class of a result and what is in it, as `repr` of a result prints it.

    Args:
        result: pytree whose arrays count for the memory.
        like: the array whose shape and precision stand for the result's.
        code: of how each simulation ended, an array of the batch's shape.
        names: what the codes mean.
        engine: what computed it.
    """
    size = sum(leaf.nbytes for leaf in jtu.tree_leaves(eqx.filter(result, eqx.is_array)))
    return (
        f"{type(result).__name__}({_outcomes(code, names)}, engine={engine}, "
        f"shape={tuple(like.shape)}, dtype={like.dtype}, {_memory(size)})"
    )


def notebook_html(shown: object) -> str:
    """HTML of a result or a scene, see `jaxbiped.plot.notebook_html`."""
    # By its name: an import would make the keys of kept programs depend on all that draws.
    html: str = importlib.import_module("jaxbiped.plot").notebook_html(shown)
    return html


def _outcomes(code: ArrayLike, names: type[enum.IntEnum]) -> str:
    """The outcome, of a batch how many of each, the most frequent first."""
    if isinstance(code, jax.core.Tracer):
        return "traced"
    codes = np.ravel(np.asarray(code))
    if np.ndim(code) == 0:
        return str(names(int(codes[0])))
    counts = collections.Counter(codes.tolist()).most_common()
    return ", ".join(f"{count} {names(each)}" for each, count in counts) or "nothing"


def _memory(size: float) -> str:
    place = 0
    while size >= 1000.0 and place + 1 < len(_UNITS):
        size, place = size / 1000.0, place + 1
    return f"{size:.3g} {_UNITS[place]}"
