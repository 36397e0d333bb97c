"""CUDA's driver through ctypes: it assembles PTX, holds memory and launches kernels.

No toolkit is needed: the driver comes with every device. (NVIDIA, CUDA Driver API.)
"""

import ctypes
import sys
from ctypes import POINTER, c_char_p, c_int, c_size_t, c_uint, c_uint64, c_void_p
from typing import Any

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

    def handle(self, name: str, *args: Any) -> c_void_p:
        """What a function writes to its first argument: a handle."""
        found = c_void_p()
        self.call(name, ctypes.byref(found), *args)
        return found

    def number(self, name: str, *args: Any) -> int:
        """What a function writes to its first argument: a number."""
        found = c_int()
        self.call(name, ctypes.byref(found), *args)
        return found.value

    def allocate(self, size: int) -> int:
        """Address of so many bytes of the current device."""
        found = c_uint64()
        self.call("cuMemAlloc_v2", ctypes.byref(found), size)
        return found.value

    def is_busy(self, stream: c_void_p) -> bool:
        """Whether a stream has something left to do."""
        code = self._functions["cuStreamQuery"](stream)
        if code not in (0, _NOT_READY):
            self.call("cuStreamQuery", stream)
        return bool(code == _NOT_READY)
