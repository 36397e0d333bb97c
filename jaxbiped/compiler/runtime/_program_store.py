"""Program store: what running a program takes besides its machine code, kept for the next process.

With it, a program that some process had traced runs in another one that never traces it.
"""

import contextlib
import pickle
from typing import Any, NamedTuple

import jax
import jax.tree_util as jtu
import numpy as np

from jaxbiped.caching._disk_cache import read_entry, write_entry
from jaxbiped.compiler.codegen._llvm_lane_loop import ENTRY
from jaxbiped.compiler.codegen._ptx_kernel import Architecture
from jaxbiped.compiler.runtime._host_cpu import Host
from jaxbiped.compiler.runtime._machine_code import MachineCode, stored_code
from jaxbiped.compiler.runtime._program import Graph, Outline

_KIND = "programs"


class Signature(NamedTuple):
    """What a program's callers have to know of its operations.

    Attributes:
        inputs: pytree of the inputs, with shapes and dtypes.
        outline: what leaves it.
        outputs: how many numbers differ between simulations, `constants` those that do not, by
            their places.
        row: numbers in each row of the stream that it reads.
        recorded: numbers in each record, `records` whether it makes any.
        maps: whether it loops over entries of arrays.
        backwards: whether it reads streams from the last row on.
    """

    inputs: Any
    outline: Outline
    outputs: int
    constants: dict[int, float]
    row: int
    recorded: int
    records: bool
    maps: bool
    backwards: bool


def signature_of(graph: Graph, inputs: Any, outline: Outline, *, backwards: bool) -> Signature:
    """Of a program that was traced."""
    return Signature(
        inputs=inputs,
        outline=outline,
        outputs=len(graph.outputs),
        constants=graph.constants,
        row=len(graph.row),
        recorded=len(graph.recorded),
        records=graph.recording is not None,
        maps=any(value.op == "map" for value in graph.body.values),
        backwards=backwards,
    )


def read_signature(digest: str) -> Signature | None:
    """Of the program with this fingerprint; None where it is not kept."""
    content = read_entry(_KIND, digest)
    if content is None:
        return None
    with contextlib.suppress(Exception):  # whatever is amiss with it, the program is traced again
        *parts, inputs, outputs, recorded = pickle.loads(content)
        outline = Outline(_with_shapes(*outputs), recorded)
        return Signature(_with_shapes(*inputs), outline, *parts)
    return None


def write_signature(digest: str, signature: Signature) -> None:
    """Keeps it."""
    inputs, outline, *parts = signature
    content = (*parts, _as_plain(inputs), _as_plain(outline.outputs), outline.recorded)
    with contextlib.suppress(Exception):  # what cannot be pickled stays in this process
        write_entry(_KIND, digest, pickle.dumps(content))


def read_code(digest: str, width: int, host: Host, *, maps: bool) -> MachineCode | None:
    """A program's machine code for vectors of this width; None where it is not kept."""
    name = read_entry(_KIND, _code_entry(digest, width, host))
    return None if name is None else stored_code(name.decode(), ENTRY, host, as_written=maps)


def write_code_name(digest: str, width: int, host: Host, name: str) -> None:
    """Keeps by what name to find a program's machine code."""
    write_entry(_KIND, _code_entry(digest, width, host), name.encode())


def read_ptx(digest: str, architecture: Architecture) -> str | None:
    """A program's PTX for a kind of device; None where it is not kept."""
    kept = read_entry(_KIND, f"{digest}-{architecture.name}")
    return None if kept is None else kept.decode()


def write_ptx(digest: str, architecture: Architecture, text: str) -> None:
    """Keeps it."""
    write_entry(_KIND, f"{digest}-{architecture.name}", text.encode())


def _code_entry(digest: str, width: int, host: Host) -> str:
    return f"{digest}-{host.cpu}-{host.width}-{width}"


def _as_plain(tree: Any) -> tuple[Any, list[tuple[tuple[int, ...], str]]]:
    """A tree of shapes as what can be pickled: its structure filled with numbers, and those."""
    leaves, structure = jtu.tree_flatten(tree)
    filled = jtu.tree_unflatten(structure, list(range(len(leaves))))
    return filled, [(tuple(leaf.shape), str(leaf.dtype)) for leaf in leaves]


def _with_shapes(filled: Any, shapes: list[tuple[tuple[int, ...], str]]) -> Any:
    leaves = [jax.ShapeDtypeStruct(shape, np.dtype(dtype)) for shape, dtype in shapes]
    return jtu.tree_unflatten(jtu.tree_structure(filled), leaves)
