"""Summary of a result in a line, and texts of modules and named tuples with their numbers.

And what a notebook shows of it, which `jaxbiped.plot` draws: through the public name, when it is
first asked for, as this lies below all that draws.
"""

import collections
import dataclasses
import enum
import importlib
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.tree_util as jtu
import numpy as np
from jaxtyping import ArrayLike, PyTree

from jaxbiped._types import Numbers

_WIDTH = 88
"""Characters of a line of a text; a longer call has a line for each argument."""
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


def in_short(shown: Any) -> str:
    """A module or a named tuple as a call that makes it, with its numbers to six digits."""
    if hasattr(shown, "_asdict"):
        given = shown._asdict()
    elif hasattr(shown, "arguments"):
        given = shown.arguments()
    else:
        given = {field.name: vars(shown).get(field.name) for field in dataclasses.fields(shown)}
    return call_text(type(shown).__name__, given)


def call_text(kind: str, arguments: Mapping[str, Any]) -> str:
    """A call with these arguments, without those that are None or empty; on lines if it is long."""
    given = {name: value for name, value in arguments.items() if value is not None}
    parts = [f"{name}={_short(value)}" for name, value in given.items()]
    return _joined(kind, [part for part in parts if not part.endswith("=()")])


def _joined(kind: str, parts: list[str]) -> str:
    inner = ",\n".join(parts).replace("\n", "\n  ")
    line = f"{kind}({', '.join(parts)})"
    return line if len(line) <= _WIDTH else f"{kind}(\n  {inner}\n)"


def _short(value: Any) -> str:
    kind: Any = type(value)
    if hasattr(value, "_asdict") or kind.__repr__ is eqx.Module.__repr__:
        return in_short(value)
    if isinstance(value, tuple | list):
        return _joined("", list(map(_short, value)))
    if not hasattr(value, "dtype"):
        return repr(value)
    is_known = not np.ndim(value) and not isinstance(value, jax.core.Tracer)
    return f"{value:.6g}" if is_known else f"{value.dtype}{list(value.shape)}"


def notebook_html(shown: object) -> str:
    """HTML of a result or a scene, see `jaxbiped.plot.notebook_html`."""
    # By its name: an import would make the keys of kept programs depend on all that draws.
    return importlib.import_module("jaxbiped.plot").notebook_html(shown)


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
