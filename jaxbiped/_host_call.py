"""Host calls: functions of NumPy arrays as foreign calls of XLA's compiled programs.

A call back of `jax.pure_callback`'s kind lives in one process. A foreign call is told by a name and
a key, so that the compiled program around it can be kept and run by another process.
"""

import contextvars
import ctypes
import threading
import uuid
import weakref
from collections.abc import Sequence
from contextlib import AbstractContextManager
from ctypes import POINTER, Structure, c_char_p, c_int, c_int64, c_size_t, c_void_p
from typing import Any, Protocol

import jax
import numpy as np

from jaxbiped._checks import gathered
from jaxbiped.caching._caches import Once
from jaxbiped.caching._fingerprint import fingerprint

TARGET = "jaxbiped_host_call"
"""Name of all such calls in compiled programs."""
_KEY = "key"
_EXECUTE = 3
_INTERNAL_ERROR = 13
_DTYPES = {1: np.bool_, 4: np.int32, 5: np.int64, 11: np.float32, 12: np.float64}
_FUNCTIONS: "weakref.WeakValueDictionary[str, HostCall]" = weakref.WeakValueDictionary()
_LOCK = threading.Lock()
_REGISTERED = Once[object]()
_LOWERED: "contextvars.ContextVar[list[HostCall] | None]" = contextvars.ContextVar(
    "calls in what is being lowered", default=None
)


class HostFunction(Protocol):
    """A function of arrays of NumPy, which it may only read while it runs; gives such arrays.

    What can be pickled is told to other processes.
    """

    def __call__(self, *arrays: np.ndarray) -> Sequence[np.ndarray]:
        """Runs it."""

    def __fingerprint__(self) -> object:
        """See `jaxbiped.caching._fingerprint`."""

    def ready(self) -> bool:
        """Whether it runs without compiling anything first."""


class HostCall:
    """A function that compiled programs of XLA call by its key, as long as somebody keeps this."""

    def __init__(self, key: str, function: HostFunction, *, storable: bool) -> None:
        self.key, self.function, self.storable = key, function, storable

    def __call__(self, *arrays: np.ndarray) -> Sequence[np.ndarray]:
        """Runs the function."""
        return self.function(*arrays)


def host_call(function: HostFunction) -> HostCall:
    """The call of a function; who holds a program that makes it has to keep it."""
    _REGISTERED(_register)
    meaning = fingerprint(function)
    key = uuid.uuid4().hex if meaning is None else meaning
    with _LOCK:
        known = _FUNCTIONS.get(key)
        if known is None:
            known = _FUNCTIONS[key] = HostCall(key, function, storable=meaning is not None)
        return known


def lower_host_call(context: Any, call: HostCall, operands: Sequence[Any]) -> Any:
    """The call in a program that is being lowered."""
    seen = _LOWERED.get()
    if seen is None:
        # For the executable to keep it: of calls back JAX holds what it never has to call.
        context.module_context.add_host_callback(call)
    else:
        seen.append(call)
    return jax.ffi.ffi_lowering(TARGET)(context, *operands, **{_KEY: call.key})


def lowered_host_calls() -> AbstractContextManager[list[HostCall]]:
    """The calls in what is lowered within; who compiles that has to keep them."""
    return gathered(_LOWERED)


def _run(frame: "_CallFrame") -> None:
    """Runs what a frame asks for."""
    call = _FUNCTIONS.get(_key_of(frame.attributes))
    if call is None:
        raise LookupError("the compiled program calls what this process does not know")
    given = [_array(frame.arguments.values[i]) for i in range(frame.arguments.size)]
    for array in given:
        array.flags.writeable = False
    places = [_array(frame.results.values[i]) for i in range(frame.results.size)]
    for place, value in zip(places, call(*given), strict=True):
        if place.shape != np.shape(value):
            raise ValueError(f"a result has shape {np.shape(value)} instead of {place.shape}")
        place[...] = value


def _key_of(attributes: "_Attributes") -> str:
    for i in range(attributes.size):
        if _text(attributes.names[i].contents) == _KEY:
            return _text(ctypes.cast(attributes.values[i], POINTER(_Span)).contents)
    raise LookupError("the compiled program does not say what it calls")


def _text(span: "_Span") -> str:
    return ctypes.string_at(span.start, span.length).decode()


def _array(address: int) -> np.ndarray:
    buffer = ctypes.cast(address, POINTER(_Buffer)).contents
    dtype = np.dtype(_DTYPES[buffer.dtype])
    shape = tuple(buffer.dimensions[: buffer.rank])
    size = int(np.prod(shape)) * dtype.itemsize
    if size == 0:
        return np.zeros(shape, dtype)
    memory: Any = (ctypes.c_char * size).from_address(buffer.data)
    return np.frombuffer(memory, dtype).reshape(shape)


def _handle(address: int) -> int | None:
    """What the handler returns to XLA: None, or an error."""
    frame = ctypes.cast(address, POINTER(_CallFrame)).contents
    if frame.extension:
        _tell_version(frame)
        return None
    if frame.stage != _EXECUTE:
        return None
    try:
        _run(frame)
    except BaseException as error:  # none may pass through XLA
        return _error_of(frame, f"{type(error).__name__}: {error}")
    return None


def _tell_version(frame: "_CallFrame") -> None:
    """Answers a request for metadata: the version of the interface is the caller's."""
    extension = ctypes.cast(frame.extension, POINTER(_MetadataExtension)).contents
    metadata = extension.metadata.contents
    if frame.api:
        known = frame.api.contents.version
        metadata.version.major, metadata.version.minor = known.major, known.minor
    else:
        metadata.version.major, metadata.version.minor = _VERSION
    metadata.traits = 0


def _error_of(frame: "_CallFrame", message: str) -> int | None:
    told = message.encode()
    arguments = _ErrorArguments(ctypes.sizeof(_ErrorArguments), None, told, _INTERNAL_ERROR)
    return frame.api.contents.create_error(ctypes.addressof(arguments))


def _register() -> object:
    handler = _HANDLER(_handle)
    jax.ffi.register_ffi_target(TARGET, jax.ffi.pycapsule(handler), platform="cpu", api_version=1)
    return handler


# The interface of XLA's foreign calls, as in `xla/ffi/api/c_api.h` of `jax.ffi.include_dir()`.
_VERSION = 0, 1
_HANDLER = ctypes.CFUNCTYPE(c_void_p, c_void_p)
_CREATE_ERROR = ctypes.CFUNCTYPE(c_void_p, c_void_p)


class _Header(Structure):
    """What every structure begins with."""

    _fields_ = [("struct_size", c_size_t), ("extension", c_void_p)]


class _Version(_Header):
    _fields_ = [("major", c_int), ("minor", c_int)]


class _Api(_Header):
    _fields_ = [("version", _Version), ("internal", c_void_p), ("create_error", _CREATE_ERROR)]


class _Span(Structure):
    _fields_ = [("start", c_void_p), ("length", c_size_t)]


class _Buffer(_Header):
    _fields_ = [
        ("dtype", c_int),
        ("data", c_void_p),
        ("rank", c_int64),
        ("dimensions", POINTER(c_int64)),
    ]


class _Values(_Header):
    _fields_ = [("size", c_int64), ("types", c_void_p), ("values", POINTER(c_void_p))]


class _Attributes(_Header):
    _fields_ = [
        ("size", c_int64),
        ("types", c_void_p),
        ("names", POINTER(POINTER(_Span))),
        ("values", POINTER(c_void_p)),
    ]


class _CallFrame(_Header):
    _fields_ = [
        ("api", POINTER(_Api)),
        ("context", c_void_p),
        ("stage", c_int),
        ("arguments", _Values),
        ("results", _Values),
        ("attributes", _Attributes),
    ]


class _Metadata(Structure):
    _fields_ = [
        ("struct_size", c_size_t),
        ("version", _Version),
        ("traits", ctypes.c_uint32),
        ("state_type", c_int64),
    ]


class _MetadataExtension(Structure):
    _fields_ = [
        ("struct_size", c_size_t),
        ("type", c_int),
        ("next", c_void_p),
        ("metadata", POINTER(_Metadata)),
    ]


class _ErrorArguments(_Header):
    _fields_ = [("message", c_char_p), ("code", c_int)]
