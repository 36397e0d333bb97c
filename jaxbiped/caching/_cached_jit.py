"""Cached compilation: functions that XLA compiles once for all processes.

A program that was compiled is kept on disk. The next process that calls the function with arguments
of the same structure neither traces nor compiles it.
"""

import contextlib
import functools
import gc
import os
import sys
import tempfile
import threading
from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import Any, Generic, NamedTuple, ParamSpec, Protocol, TypeAlias, TypeVar

import equinox as eqx
import jax
import jax.tree_util as jtu
from jax.experimental import serialize_executable

from jaxbiped._host_call import TARGET, HostCall, HostFunction, host_call, lowered_host_calls
from jaxbiped._jax_versions import (
    custom_call_targets,
    load_lapack,
    nothing_is_traced,
    without_switches,
)
from jaxbiped.caching import _caches
from jaxbiped.caching._caches import Once, OncePerVersion, bounded_cache, name_of, register_cache
from jaxbiped.caching._disk_cache import cache_folder, read_object, write_object
from jaxbiped.caching._fingerprint import Leaf, fingerprint, leaf_of, settings

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
_FROZEN = threading.Event()
"""Set once the user froze objects: to count them visits every one."""


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
                if not _FROZEN.is_set():
                    if gc.get_freeze_count():
                        _FROZEN.set()  # what the user froze stays frozen
                    else:
                        gc.freeze()
                        gc.unfreeze()
                if collects:
                    gc.enable()


_P = ParamSpec("_P")
_T = TypeVar("_T")


class Arguments(NamedTuple):
    """Arguments of a call that nothing traces.

    Attributes:
        given: all of them, as a tuple and a dictionary.
        arrays: those among them; `skeleton` the rest.
        kind: what decides which program runs.
    """

    given: tuple[tuple[Any, ...], dict[str, Any]]
    arrays: list[Any]
    skeleton: Skeleton
    kind: Hashable


class Form(NamedTuple):
    """In which form a function is run.

    Attributes:
        where: whether it is, by its arguments.
        make: its program, by a function of arrays, these and a key; None where it has none.
    """

    where: Callable[..., bool]
    make: Callable[[ArrayFunction, Sequence[Any], str | None], KeptProgram | None]


def _compiled(
    function: ArrayFunction, arrays: Sequence[Any], key: str | None
) -> KeptProgram | None:
    """A program of XLA; None where it is not to be kept and so left to `equinox`."""
    return None if key is None else read_call(key) or trace_call(function, arrays, key)[0]()


_XLA = Form(lambda *_, **__: True, _compiled)


class Begun(NamedTuple):
    """A function that is traced.

    Attributes:
        finish: compiles what is not compiled, in any thread.
        result: the function's result with shapes instead of arrays.
    """

    finish: Callable[[], object]
    result: Any


class cached_jit(Generic[_P, _T]):  # noqa: N801
    """Decorator: `equinox.filter_jit`, whose compiled programs and traces are bounded and kept.

    What is not an array is compiled in, functions too: a new one at each call would compile
    and be kept each time. Beyond the bound all go. On disk are programs of what the package and
    its libraries define. Another `form` goes before XLA's.
    """

    def __init__(self, function: Callable[_P, _T], form: Form | None = None) -> None:
        functools.update_wrapper(self, function)
        self._others = [] if form is None else [form]
        self._function: Callable[..., Any] = function
        self._jitted: Any = eqx.filter_jit(function)
        self._programs: dict[Hashable, OncePerVersion[KeptProgram | None]] = {}
        self._lock = threading.Lock()
        register_cache(name_of(function), self._count, lambda: _caches.PROGRAMS, self.clear)

    @without_switches
    def __call__(self, *args: _P.args, **kwargs: _P.kwargs) -> _T:
        arguments = arguments_of((args, kwargs))
        program = None if arguments is None else self._program(arguments, *self._others, _XLA)
        if arguments is None:
            note_code(args, kwargs)
        found: _T
        if arguments is None or program is None:
            self._make_room()
            found = self._jitted(*args, **kwargs)
        else:
            found = program(arguments.arrays)
        return found

    @without_switches
    def begin(self, *args: _P.args, **kwargs: _P.kwargs) -> Begun:
        """Traces the function, where no process did."""
        arguments = arguments_of((args, kwargs))
        key = None if arguments is None else self._key_of(arguments)
        program = None if arguments is None else self._program(arguments, *self._others)
        if program is None and arguments is not None and key is not None:
            once = self._once((_XLA, arguments.kind))
            kept = None if once.done else read_call(key)
            if once.done or kept is not None:
                program = once(lambda: kept)
            else:
                compile_it, result = trace_call(self._flat(arguments), arguments.arrays, key)
                return Begun(functools.partial(once, compile_it), result.shapes())
        if program is not None:
            return Begun(lambda: None, program.result.shapes())
        lowered = self._jitted.lower(*args, **kwargs)
        return Begun(lowered.compile, eqx.filter_eval_shape(self._jitted, *args, **kwargs))

    @without_switches
    def lower(self, *args: _P.args, **kwargs: _P.kwargs) -> Any:
        """The function, ready to be compiled for these arguments; see `equinox.filter_jit`."""
        return self._jitted.lower(*args, **kwargs)

    def clear(self) -> None:
        self._jitted._cached.clear_cache()
        with self._lock:
            self._programs.clear()

    def _once(self, kind: Hashable) -> Once[KeptProgram | None]:
        with self._lock:
            program = self._programs.get(kind)
        if program is None:
            self._make_room()
            with self._lock:
                program = self._programs.setdefault(kind, OncePerVersion(kind))
        return program()[1]

    def _program(self, arguments: Arguments, *forms: Form) -> KeptProgram | None:
        """The program for such arguments in the first of these forms that it has."""
        args, kwargs = arguments.given
        for form in forms:
            if form.where(*args, **kwargs):
                make = functools.partial(self._make, arguments, form)
                program = self._once((form, arguments.kind))(make)
                if program is not None:
                    return program
        return None

    def _make(self, arguments: Arguments, form: Form) -> KeptProgram | None:
        return form.make(self._flat(arguments), arguments.arrays, self._key_of(arguments))

    def _flat(self, arguments: Arguments) -> ArrayFunction:
        """The function of the arrays among such arguments."""

        def function(arrays: Sequence[Any]) -> Any:
            args, kwargs = arguments.skeleton.filled(arrays)
            return self._function(*args, **kwargs)

        functools.update_wrapper(function, self._function, assigned=("__name__", "__qualname__"))
        return function

    def _key_of(self, arguments: Arguments) -> str | None:
        """By what its program is found on disk; None where it is not to be kept."""
        if cache_folder() is None:
            return None
        return fingerprint(cached_jit, self._function, arguments.skeleton.tree)

    def _make_room(self) -> None:
        if self._count() >= _caches.PROGRAMS:
            self.clear()

    def _count(self) -> int:
        return int(self._jitted._cached._cache_size()) + len(self._programs)


def note_code(*given: object) -> None:
    """Has JAX trace again what it traced of these, if code of the user's in it reads anything else.

    It comes before anything is looked up that JAX made of them.
    """
    leaves, structure = jax.tree.flatten(given)
    with contextlib.suppress(TypeError):  # unhashable
        _note_code(structure, *(leaf for leaf in leaves if not eqx.is_array_like(leaf)))


@bounded_cache(_caches.PROGRAMS)
def _note_code(*given: Hashable) -> None:
    """It makes nothing: whatever is looked up in a cache has its code compared."""


def arguments_of(given: tuple[tuple[Any, ...], dict[str, Any]]) -> Arguments | None:
    """Arguments of a program that can be kept; None where something traces or watches the call."""
    if not nothing_is_traced() or _is_watched():
        return None
    skeleton, arrays = Skeleton.of(given)
    if any(isinstance(x, jax.core.Tracer) or getattr(x, "committed", False) for x in arrays):
        return None
    leaves = tuple((type(leaf), leaf) for leaf in skeleton.leaves)
    kind = skeleton.structure, leaves, settings()
    try:
        hash(kind)
    except TypeError:
        return None
    return Arguments(given, arrays, skeleton, kind)


def _is_watched() -> bool:
    """Whether JAX is to run as never otherwise."""
    config: Any = jax.config
    return bool(
        config.jax_disable_jit
        or config.jax_debug_nans
        or config.jax_debug_infs
        or config.jax_default_device is not None
        or jax.default_backend() != "cpu"
    )
