"""Compiled store: programs that XLA compiled, kept on disk with all that calling them takes.

Also what a long trace of such a program does without.
"""

import contextlib
import gc
import os
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, Protocol, TypeAlias

import equinox as eqx
import jax
import jax.tree_util as jtu
from jax.experimental import serialize_executable

from jaxbiped._host_call import TARGET, HostCall, HostFunction, host_call, lowered_host_calls
from jaxbiped._jax_versions import custom_call_targets, load_lapack
from jaxbiped.caching._disk_cache import read_object, write_object
from jaxbiped.caching._fingerprint import Leaf, leaf_of

ArrayFunction: TypeAlias = Callable[[Sequence[Any]], Any]
_KIND = "xla"
_LAPACK = "lapack_"
_NOISE = b"cpu_aot_loader.cc"
"""XLA misses tuning flags, which are no features of a CPU, among the CPU's features."""
_LOADING = threading.Lock()


class Skeleton(NamedTuple):
    """What arguments or results are besides arrays.

    Attributes:
        leaves: of their tree, with a `Leaf` for each array.
        structure: the tree.
    """

    leaves: list[Any]
    structure: jtu.PyTreeDef

    @staticmethod
    def of(tree: Any) -> tuple["Skeleton", list[Any]]:
        """Of a tree, and the arrays in it."""
        leaves, structure = jtu.tree_flatten(tree)
        known = [leaf_of(leaf) if eqx.is_array(leaf) else leaf for leaf in leaves]
        return Skeleton(known, structure), [leaf for leaf in leaves if eqx.is_array(leaf)]

    @staticmethod
    def of_tree(tree: Any) -> "Skeleton":
        """Of a `tree` of one."""
        return Skeleton(*jtu.tree_flatten(tree))

    def __reduce__(self) -> tuple[Any, ...]:
        """Structures cannot be pickled, but trees that have them."""
        return Skeleton.of_tree, (self.tree,)

    @property
    def tree(self) -> Any:
        """The tree with a `Leaf` for each array."""
        return self.structure.unflatten(self.leaves)

    @property
    def places(self) -> list[Leaf]:
        return [leaf for leaf in self.leaves if isinstance(leaf, Leaf)]

    def filled(self, arrays: Sequence[Any]) -> Any:
        rest = iter(arrays)
        return self.structure.unflatten(
            [next(rest) if isinstance(leaf, Leaf) else leaf for leaf in self.leaves]
        )

    def shapes(self) -> Any:
        """The tree with shapes instead of arrays."""
        return self.filled(
            [jax.ShapeDtypeStruct(x.shape, x.dtype, weak_type=x.weak) for x in self.places]
        )


class KeptProgram(Protocol):
    """A function of arrays that was compiled or written."""

    @property
    def result(self) -> Skeleton:
        """What becomes of the arrays that it gives."""

    def __call__(self, arrays: Sequence[Any]) -> Any:
        """Runs it."""


def flattened(function: ArrayFunction) -> tuple[Callable[..., list[Any]], list[Skeleton]]:
    """A function as one from arrays to a list of arrays; the list gets its results' skeletons."""
    results: list[Skeleton] = []

    def flat(*given: Any) -> list[Any]:
        result, found = Skeleton.of(function(given))
        results.append(result)
        return found

    return flat, results


class CompiledCall(NamedTuple):
    """A compiled function of arrays; call it.

    Attributes:
        compiled: by XLA, from arrays to a list of arrays.
        result: what becomes of that list.
        host_calls: what the program calls.
    """

    compiled: jax.stages.Compiled
    result: Skeleton
    host_calls: list[HostCall]

    def __call__(self, arrays: Sequence[Any]) -> Any:
        return self.result.filled(jax.block_until_ready(self.compiled(*arrays)))


def trace_call(
    function: ArrayFunction, arrays: Sequence[Any], key: str
) -> tuple[Callable[[], CompiledCall], Skeleton]:
    """Traces a function of arrays; what then compiles it and keeps it, and its result."""
    flat, results = flattened(function)
    with long_trace(), lowered_host_calls() as calls:
        lowered = jax.jit(flat).lower(*arrays)
    targets = custom_call_targets(lowered.compiler_ir("stablehlo"))

    def compile_it() -> CompiledCall:
        made = CompiledCall(lowered.compile(), results[-1], calls)
        # Others, such as calls back that are known by their place in this process, cannot be kept.
        # Nor can what JAX loaded from its own cache: kept again, it lacks its functions.
        known = all(name == TARGET or name.startswith(_LAPACK) for name in targets)
        config: Any = jax.config
        if known and not config.jax_compilation_cache_dir:
            uses_lapack = any(name.startswith(_LAPACK) for name in targets)
            _write(key, made, len(arrays), uses_lapack)
        return made

    return compile_it, results[-1]


def read_call(key: str) -> CompiledCall | None:
    """What was kept by a key; None where that is nothing, or what it calls is not there."""
    return read_object(_KIND, key, _load)


def _load(
    code: bytes, count: int, uses_lapack: bool, result: Skeleton, functions: list[HostFunction]
) -> CompiledCall | None:
    if not all(function.ready() for function in functions):
        return None
    calls = [host_call(function) for function in functions]
    if uses_lapack:
        load_lapack()
    taken = jtu.tree_structure((tuple(range(count)), {}))
    given = jtu.tree_structure(list(range(len(result.places))))
    with _LOADING, _without_noise():
        compiled = serialize_executable.deserialize_and_load(
            code, taken, given, execution_devices=jax.devices()[:1]
        )
    return CompiledCall(compiled, result, calls)


def _write(key: str, made: CompiledCall, count: int, uses_lapack: bool) -> None:
    """Keeps a program, unless it holds what another process could not have."""
    if not all(call.storable for call in made.host_calls):
        return
    functions = list({call.key: call.function for call in made.host_calls}.values())
    with contextlib.suppress(Exception):  # what cannot be serialised stays in this process
        code, _, _ = serialize_executable.serialize(made.compiled)
        write_object(_KIND, key, code, count, uses_lapack, made.result, functions)


@contextlib.contextmanager
def _without_noise() -> Iterator[None]:
    """Keeps one wrong alarm of XLA's away from the terminal; all else told there arrives."""
    sys.stderr.flush()
    try:
        terminal = os.dup(2)
    except OSError:
        yield
        return
    with tempfile.TemporaryFile() as told:
        os.dup2(told.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(terminal, 2)
            told.seek(0)
            for line in told:
                if _NOISE not in line:
                    os.write(terminal, line)
            os.close(terminal)


_LOCK = threading.Lock()
_SPELL = 0.02
"""How long a thread keeps the interpreter that others wait for [s]."""
_TRACES = [0]
"""How many traces go on just now; the last to end leaves things as they were found."""
_FOUND: list[tuple[bool, float]] = []
"""Whether the collector was on, and how long a spell was, when the first of them began."""


@contextlib.contextmanager
def long_trace() -> Iterator[None]:
    """Within, no collection begins by itself and spells are long, in all threads.

    A trace makes millions of objects that all live until it ends. The collector looks through them
    again and again, and finds nothing. When it ends they count as old at once: else each of the
    next collections looks at all of them, for 1.8 s of a first gait. Several threads that trace at
    once hand the interpreter to one another every 5 ms, and each finds the caches full of the
    others' objects: spells of 20 ms took 4 % less time of a first gait, longer ones no less.
    """
    with _LOCK:
        if not _TRACES[0]:
            _FOUND.append((gc.isenabled(), sys.getswitchinterval()))
            gc.disable()
            sys.setswitchinterval(max(_SPELL, _FOUND[0][1]))
        _TRACES[0] += 1
    try:
        yield
    finally:
        with _LOCK:
            _TRACES[0] -= 1
            if not _TRACES[0]:
                collects, spell = _FOUND.pop()
                sys.setswitchinterval(spell)
                if not gc.get_freeze_count():  # what the user froze stays frozen
                    gc.freeze()
                    gc.unfreeze()
                if collects:
                    gc.enable()
