"""CUDA devices: kernels loaded by the driver through ctypes, and launched over parts of a batch.

No toolkit is needed: the driver comes with every device. (NVIDIA, CUDA Driver API.)
"""

import contextlib
import ctypes
import sys
import threading
import time
import weakref
from collections.abc import Iterator
from ctypes import POINTER, c_char_p, c_int, c_size_t, c_uint, c_uint64, c_void_p
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jaxbiped._checks import ResourceError
from jaxbiped.caching._caches import bounded_cache
from jaxbiped.compiler.codegen._lane_scheduler import FIELDS
from jaxbiped.compiler.codegen._llvm_lane_loop import ENTRY
from jaxbiped.compiler.codegen._ptx_kernel import THREADS, Architecture, architecture_of
from jaxbiped.compiler.runtime._kernel import Kernel

if TYPE_CHECKING:
    from jaxbiped.compiler.runtime._processors import Launch

_LIBRARY = "nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1"
_NOT_READY = 600
_HANDLE = POINTER(c_void_p)
_SIGNATURES: dict[str, list[Any]] = {
    "cuInit": [c_uint],
    "cuDeviceGetCount": [POINTER(c_int)],
    "cuDeviceGet": [POINTER(c_int), c_int],
    "cuDeviceGetName": [c_char_p, c_int, c_int],
    "cuDeviceGetAttribute": [POINTER(c_int), c_int, c_int],
    "cuDevicePrimaryCtxRetain": [_HANDLE, c_int],
    "cuCtxSetCurrent": [c_void_p],
    "cuModuleLoadData": [_HANDLE, c_char_p],
    "cuModuleGetFunction": [_HANDLE, c_void_p, c_char_p],
    "cuOccupancyMaxActiveBlocksPerMultiprocessor": [POINTER(c_int), c_void_p, c_int, c_size_t],
    "cuMemAlloc_v2": [POINTER(c_uint64), c_size_t],
    "cuMemFree_v2": [c_uint64],
    "cuMemcpyHtoD_v2": [c_uint64, c_void_p, c_size_t],
    "cuMemcpyDtoH_v2": [c_void_p, c_uint64, c_size_t],
    "cuMemcpyHtoDAsync_v2": [c_uint64, c_void_p, c_size_t, c_void_p],
    "cuStreamCreate": [_HANDLE, c_uint],
    "cuStreamQuery": [c_void_p],
    "cuStreamSynchronize": [c_void_p],
    "cuStreamDestroy_v2": [c_void_p],
    "cuLaunchKernel": [c_void_p, *[c_uint] * 7, c_void_p, POINTER(c_void_p), POINTER(c_void_p)],
    "cuGetErrorString": [c_int, POINTER(c_char_p)],
}


class CudaError(RuntimeError):
    """A call of the driver has failed.

    Attributes:
        code: the driver's number for what happened.
    """

    def __init__(self, name: str, code: int, what: str) -> None:
        super().__init__(f"{name}: {what} (CUDA error {code})")
        self.code = code


def load_library() -> Any | None:
    """The driver's library; None where there is none."""
    try:
        return ctypes.CDLL(_LIBRARY)
    except OSError:
        return None


class CudaDriver:
    """The driver's functions by their names."""

    def __init__(self, library: Any) -> None:
        self._functions = {}
        for name, arguments in _SIGNATURES.items():
            function = getattr(library, name)
            function.argtypes, function.restype = arguments, c_int
            self._functions[name] = function

    def call(self, name: str, *args: Any) -> None:
        """Calls a function.

        Raises:
            CudaError: it tells of an error.
        """
        code = self._functions[name](*args)
        if code:
            text = c_char_p()
            self._functions["cuGetErrorString"](code, ctypes.byref(text))
            raise CudaError(name, code, (text.value or b"unknown").decode())

    def written(self, kind: type[Any], name: str, *args: Any) -> Any:
        """What a function writes to its first argument, of a type of `ctypes`."""
        found = kind()
        self.call(name, ctypes.byref(found), *args)
        return found

    def number(self, name: str, *args: Any) -> int:
        """The same of a number."""
        return int(self.written(c_int, name, *args).value)

    def is_busy(self, stream: c_void_p) -> bool:
        """Whether a stream has something left to do."""
        code = self._functions["cuStreamQuery"](stream)
        if code not in (0, _NOT_READY):
            self.call("cuStreamQuery", stream)
        return bool(code == _NOT_READY)


_MULTIPROCESSORS, _MAJOR, _MINOR = 16, 75, 76
_NON_BLOCKING, _OUT_OF_MEMORY = 1, 2
_POLL = 2e-4
"""How long to wait before looking whether a kernel is over [s]."""
WRITTEN = ("outputs", "records", "record_counts")
"""Arrays that a kernel writes for the host."""
_WHOLLY_WRITTEN = ("outputs", "record_counts")
"""Those of which it writes every entry; of records only as many as there are."""


class LoadedKernel(NamedTuple):
    """A kernel on a device.

    Attributes:
        function: the driver's handle.
        blocks: that one multiprocessor runs at once.
    """

    function: ctypes.c_void_p
    blocks: int


class CudaDevice:
    """One device.

    Attributes:
        name: the driver's.
        architecture: of the kernels that it runs.
        multiprocessors: how many it has.
    """

    def __init__(self, driver: CudaDriver, number: int, architecture: Architecture) -> None:
        self._driver, self.architecture = driver, architecture
        device = driver.number("cuDeviceGet", number)
        name = ctypes.create_string_buffer(256)
        driver.call("cuDeviceGetName", name, len(name), device)
        self.name = name.value.decode()
        self.multiprocessors = driver.number("cuDeviceGetAttribute", _MULTIPROCESSORS, device)
        self._context = driver.written(c_void_p, "cuDevicePrimaryCtxRetain", device)
        self._loaded: weakref.WeakKeyDictionary[Kernel, LoadedKernel] = weakref.WeakKeyDictionary()
        self._lock = threading.Lock()

    def load(self, kernel: Kernel) -> LoadedKernel:
        """The kernel, assembled where it is not yet."""
        ptx = kernel.ptx(self.architecture)
        with self._lock:
            if kernel not in self._loaded:
                self._loaded[kernel] = self._load(ptx)
            return self._loaded[kernel]

    def _load(self, ptx: str) -> LoadedKernel:
        driver = self._driver
        driver.call("cuCtxSetCurrent", self._context)
        module = driver.written(c_void_p, "cuModuleLoadData", ptx.encode())
        function = driver.written(c_void_p, "cuModuleGetFunction", module, ENTRY.encode())
        blocks = driver.number("cuOccupancyMaxActiveBlocksPerMultiprocessor", function, THREADS, 0)
        return LoadedKernel(function, blocks)

    def run(self, kernel: LoadedKernel, part: "Launch", stop: np.ndarray) -> None:
        """Launches a kernel over a part and waits for its end; `stop` not zero ends it early.

        The part's arrays are contiguous; those of `WRITTEN` are overwritten. Its streams are places
        in its only array of rows, in bytes.

        Raises:
            ResourceError: the device has not enough memory, or fails.
        """
        try:
            self._run(kernel, part, stop)
        except CudaError as error:
            mend = (
                "smaller batches or chunks take less"
                if error.code == _OUT_OF_MEMORY
                else "run again"
            )
            raise ResourceError(f"the device {self.name} failed: {error}; {mend}.") from None

    def _run(self, kernel: LoadedKernel, part: "Launch", stop: np.ndarray) -> None:
        driver = self._driver
        driver.call("cuCtxSetCurrent", self._context)
        with contextlib.ExitStack() as stack:
            (rows,) = part.rows
            streams = part.arrays["streams"] + stack.enter_context(self._copied(rows))
            address = {
                name: stack.enter_context(self._copied(array, only_room=name in _WHOLLY_WRITTEN))
                for name, array in {**part.arrays, "streams": streams}.items()
            }
            fields = np.array(
                [{**address, **part.numbers}[name] for name in FIELDS], dtype=np.int64
            )
            at = ctypes.c_uint64(stack.enter_context(self._copied(fields)))
            blocks = -(-part.table.simulations // THREADS)
            blocks = min(blocks, max(kernel.blocks, 1) * self.multiprocessors)
            self._launch(kernel, blocks, at, stop, address["stop"])
            for name in WRITTEN:
                array = part.arrays[name]
                if array.nbytes:
                    driver.call("cuMemcpyDtoH_v2", array.ctypes.data, address[name], array.nbytes)

    def _launch(
        self,
        kernel: LoadedKernel,
        blocks: int,
        fields: ctypes.c_uint64,
        stop: np.ndarray,
        stop_address: int,
    ) -> None:
        """Runs it in a stream of its own, beside which the host can tell it to stop."""
        driver = self._driver
        with self._stream() as own, self._stream() as beside:
            arguments = (ctypes.c_void_p * 1)(ctypes.addressof(fields))
            sizes = (blocks, 1, 1, THREADS, 1, 1, 0)
            driver.call("cuLaunchKernel", kernel.function, *sizes, own, arguments, None)
            while driver.is_busy(own) and not stop[0]:
                time.sleep(_POLL)
            if stop[0]:
                told = stop.ctypes.data, stop.nbytes
                driver.call("cuMemcpyHtoDAsync_v2", stop_address, *told, beside)
            driver.call("cuStreamSynchronize", own)

    @contextlib.contextmanager
    def _stream(self) -> Iterator[ctypes.c_void_p]:
        stream = self._driver.written(c_void_p, "cuStreamCreate", _NON_BLOCKING)
        try:
            yield stream
        finally:
            self._driver.call("cuStreamDestroy_v2", stream)

    @contextlib.contextmanager
    def _copied(self, array: np.ndarray, *, only_room: bool = False) -> Iterator[int]:
        """Address of a copy on the device, or of room for one; 0 for an array without entries."""
        if not array.nbytes:
            yield 0
            return
        address = self._driver.written(c_uint64, "cuMemAlloc_v2", array.nbytes).value
        try:
            if not only_room:
                self._driver.call("cuMemcpyHtoD_v2", address, array.ctypes.data, array.nbytes)
            yield address
        finally:
            self._driver.call("cuMemFree_v2", address)


class Devices(NamedTuple):
    """The devices that can be used here; where there are none, why."""

    usable: tuple[CudaDevice, ...]
    missing: str = ""


@bounded_cache(1)
def devices() -> Devices:
    """This machine's, as the driver tells them: as far as `CUDA_VISIBLE_DEVICES` allows."""
    library = load_library()
    if library is None:
        return Devices((), "no CUDA driver is installed")
    try:
        driver = CudaDriver(library)
        driver.call("cuInit", 0)
        count = driver.number("cuDeviceGetCount")
        found = []
        for number in range(count):
            device = driver.number("cuDeviceGet", number)
            major, minor = (
                driver.number("cuDeviceGetAttribute", which, device) for which in (_MAJOR, _MINOR)
            )
            architecture = architecture_of((major, minor))
            if architecture is not None:
                found.append(CudaDevice(driver, number, architecture))
    except (CudaError, AttributeError) as error:
        return Devices((), f"the CUDA driver finds no device ({error})")
    older = "every CUDA device is older than compute capability 8.0"
    return Devices(tuple(found), "" if found else older if count else "there is no CUDA device")
