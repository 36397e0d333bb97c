"""CUDA devices: kernels loaded by the driver, and their launches over parts of a batch."""

import contextlib
import ctypes
import threading
import time
import weakref
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from jaxbiped._checks import ResourceError
from jaxbiped.caching._caches import bounded_cache
from jaxbiped.compiler.codegen._lane_scheduler import FIELDS
from jaxbiped.compiler.codegen._llvm_lane_loop import ENTRY
from jaxbiped.compiler.codegen._ptx_kernel import THREADS, Architecture, architecture_of
from jaxbiped.compiler.runtime._cuda_driver import CudaDriver, CudaError, load_library
from jaxbiped.compiler.runtime._kernel import Kernel

_MULTIPROCESSORS, _MAJOR, _MINOR = 16, 75, 76
_NON_BLOCKING, _OUT_OF_MEMORY = 1, 2
_POLL = 2e-4
"""How long to wait before looking whether a kernel is over [s]."""
WRITTEN = ("outputs", "records", "record_counts")
"""Arrays that a kernel writes for the host."""


class DevicePart(NamedTuple):
    """A part of a batch, for one launch.

    Attributes:
        arrays: on the host, contiguous, by the names of `FIELDS`; those of `WRITTEN` are
            overwritten. `streams` are places in `rows`, in bytes.
        rows: of all streams.
        numbers: the whole numbers among `FIELDS`.
    """

    arrays: Mapping[str, np.ndarray]
    rows: np.ndarray
    numbers: Mapping[str, int]


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
        self._context = driver.handle("cuDevicePrimaryCtxRetain", device)
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
        module = driver.handle("cuModuleLoadData", ptx.encode())
        function = driver.handle("cuModuleGetFunction", module, ENTRY.encode())
        blocks = driver.number("cuOccupancyMaxActiveBlocksPerMultiprocessor", function, THREADS, 0)
        return LoadedKernel(function, blocks)

    def run(self, kernel: LoadedKernel, part: DevicePart, stop: np.ndarray) -> None:
        """Launches a kernel over a part and waits for its end; `stop` not zero ends it early.

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

    def _run(self, kernel: LoadedKernel, part: DevicePart, stop: np.ndarray) -> None:
        driver = self._driver
        driver.call("cuCtxSetCurrent", self._context)
        with contextlib.ExitStack() as stack:
            address = {
                name: stack.enter_context(self._copied(array))
                for name, array in {**part.arrays, "rows": part.rows}.items()
                if name != "streams"
            }
            streams = part.arrays["streams"] + address["rows"]
            address["streams"] = stack.enter_context(self._copied(streams))
            fields = np.array(
                [{**address, **part.numbers}[name] for name in FIELDS], dtype=np.int64
            )
            at = ctypes.c_uint64(stack.enter_context(self._copied(fields)))
            blocks = -(-part.numbers["count"] // THREADS)
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
        stream = self._driver.handle("cuStreamCreate", _NON_BLOCKING)
        try:
            yield stream
        finally:
            self._driver.call("cuStreamDestroy_v2", stream)

    @contextlib.contextmanager
    def _copied(self, array: np.ndarray) -> Iterator[int]:
        """Address of a copy on the device; 0 for an array without entries."""
        if not array.nbytes:
            yield 0
            return
        address = self._driver.allocate(array.nbytes)
        try:
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
    """This machine's, as far as `CUDA_VISIBLE_DEVICES` allows: the driver heeds it."""
    return find_devices()


def find_devices() -> Devices:
    """Asks the driver."""
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
