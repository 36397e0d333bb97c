"""A CUDA driver that runs the very modules made for devices on the CPU, thread by thread.

What it loads is LLVM's text from which PTX is made, for the host instead: only the vote of a warp
is its own, at which the warp's threads wait for each other. All else of the kernel, the queue,
memory and atomic addition among it, is the same.
"""

# ruff: noqa: N802, N815 (names are the driver's)

import ctypes
import functools
import itertools
import re
import threading

import llvmlite.binding as llvm
import numpy as np

from jaxbiped.compiler.codegen._llvm_lane_loop import ENTRY
from jaxbiped.compiler.runtime import _cuda_device, _kernel, _processors
from jaxbiped.compiler.runtime._machine_code import machine_code

OUT_OF_MEMORY, NOT_READY, LAUNCH_FAILED = 2, 600, 719
_WARP = 32
_VOTE = "emulated_warp_vote"
_NEAREST = "llvm.fptosi.sat"
_PATIENCE = 120.0
_WARPS = {}
"""The warp that a thread of this process belongs to."""


class _Warp:
    """Threads that vote together."""

    def __init__(self, size):
        self.barrier, self.votes, self.lock = threading.Barrier(size), {}, threading.Lock()
        self.own, self.turns = threading.local(), 0

    def vote(self, mark):
        turn = getattr(self.own, "turn", 0)
        self.own.turn = turn + 1
        with self.lock:
            self.turns = max(self.turns, turn + 1)
            self.votes[turn] = self.votes.get(turn, False) or bool(mark)
        self.barrier.wait(_PATIENCE)
        with self.lock:
            # Who is here has passed the vote before.
            self.votes.pop(turn - 1, None)
            return int(self.votes[turn])


def _vote(mark):
    try:
        return _WARPS[threading.get_ident()].vote(mark)
    except threading.BrokenBarrierError:
        return 0


_CALLED = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int)(_vote)


def host_text(text):
    """A device's module for the host."""
    text = text.replace("define ptx_kernel ", "define ")
    text = re.sub(r"^(!nvvm|![1-9]).*\n", "", text, flags=re.M)
    text = text.replace(
        "declare i1 @llvm.nvvm.vote.any.sync(i32, i1)", f"declare i32 @{_VOTE}(i32)"
    )
    # Out of range, a device converts to the nearest whole number, this machine to the least one.
    for new in ("i32", "i64"):
        text, count = re.subn(
            rf"fptosi double (\S+) to {new}\b",
            rf"call {new} @{_NEAREST}.{new}.f64(double \1)",
            text,
        )
        text += f"\ndeclare {new} @{_NEAREST}.{new}.f64(double)\n" if count else ""
    call = "  %any = call i1 @llvm.nvvm.vote.any.sync(i32 -1, i1 %x)"
    assert call in text
    return text.replace(
        call,
        f"  %w = zext i1 %x to i32\n  %r = call i32 @{_VOTE}(i32 %w)\n  %any = trunc i32 %r to i1",
    )


def host_code(text, entry=ENTRY):
    """Its machine code."""
    llvm.add_symbol(_VOTE, ctypes.cast(_CALLED, ctypes.c_void_p).value)
    return machine_code(host_text(text), entry, as_written=False)


class FakeDriver:
    """The library that `CudaDriver` calls.

    Attributes:
        launches: grid size of each launch so far.
        modules: text of each that was loaded.
        memory: what is allocated and not freed.
        room: bytes of memory.
    """

    def __init__(self, *, devices=1, lanes=4, multiprocessors=2, capability=(9, 0), room=1 << 40):
        """Each warp has so many threads, fewer than a real one for speed."""
        self.devices, self.lanes, self.room = devices, lanes, room
        self.attributes = {16: multiprocessors, 75: capability[0], 76: capability[1]}
        self.memory, self.launches, self.codes, self.running = {}, [], {}, {}
        self.modules, self.warps = [], []
        self.broken = False
        self._handles = itertools.count(1)
        for name in dir(type(self)):
            if name.startswith("cu"):
                # Unlike a method it takes the attributes of ctypes' functions.
                setattr(self, name, functools.partial(getattr(self, name)))

    def cuInit(self, _):
        return 0

    cuCtxSetCurrent = cuInit

    def cuDeviceGetCount(self, count):
        return _give(count, self.devices)

    def cuDeviceGet(self, device, number):
        return _give(device, number)

    def cuDeviceGetName(self, name, size, device):
        name.value = f"emulated {device}".encode()
        return 0

    def cuDeviceGetAttribute(self, value, which, device):
        return _give(value, self.attributes[which])

    def cuDevicePrimaryCtxRetain(self, context, device):
        return _give(context, device + 1)

    def cuModuleLoadData(self, module, image):
        handle = next(self._handles)
        self.modules.append(image.decode())
        self.codes[handle] = host_code(self.modules[-1])
        return _give(module, handle)

    def cuModuleGetFunction(self, function, module, name):
        assert name.decode() == ENTRY
        return _give(function, module.value)

    def cuOccupancyMaxActiveBlocksPerMultiprocessor(self, blocks, function, threads, shared):
        return _give(blocks, 1)

    def cuMemAlloc_v2(self, address, size):
        if size + sum(each.nbytes for each in self.memory.values()) > self.room:
            return OUT_OF_MEMORY
        array = np.full(size, 0xAA, dtype=np.uint8)
        self.memory[array.ctypes.data] = array
        return _give(address, array.ctypes.data)

    def cuMemFree_v2(self, address):
        del self.memory[address]
        return 0

    def cuMemcpyHtoD_v2(self, target, source, size, stream=None):
        assert self.memory[target].nbytes == size
        ctypes.memmove(target, source, size)
        return 0

    cuMemcpyHtoDAsync_v2 = cuMemcpyHtoD_v2

    def cuMemcpyDtoH_v2(self, target, source, size):
        assert self.memory[source].nbytes == size
        ctypes.memmove(target, source, size)
        return 0

    def cuStreamCreate(self, stream, flags):
        return _give(stream, next(self._handles))

    def cuStreamQuery(self, stream):
        threads = self.running.get(stream.value, [])
        return NOT_READY if any(thread.is_alive() for thread in threads) else 0

    def cuStreamSynchronize(self, stream):
        for thread in self.running.get(stream.value, []):
            thread.join()
        return LAUNCH_FAILED if self.broken else 0

    def cuStreamDestroy_v2(self, stream):
        self.running.pop(stream.value, None)
        return 0

    def cuLaunchKernel(self, function, *rest):
        grid, _, _, block, _, _, _, stream, arguments, _ = rest
        self.launches.append(grid)
        fields = ctypes.cast(arguments[0], ctypes.POINTER(ctypes.c_uint64)).contents.value
        code = self.codes[function.value]
        warps = [_Warp(self.lanes) for _ in range(grid * (block // _WARP))]
        threads = [
            threading.Thread(target=self._thread, args=(code, fields, warp), daemon=True)
            for warp in warps
            for _ in range(self.lanes)
        ]
        self.running[stream.value] = threads
        self.warps += warps
        for thread in threads:
            thread.start()
        return 0

    def attempts(self, votes):
        """Of all threads of all warps so far, by so many votes each; refills count as votes."""
        return sum(warp.turns for warp in self.warps) * self.lanes / votes

    def _thread(self, code, fields, warp):
        _WARPS[threading.get_ident()] = warp
        ctypes.CFUNCTYPE(None, ctypes.c_void_p)(code.address)(fields)
        self.broken = self.broken or warp.barrier.broken

    def cuGetErrorString(self, code, text):
        text._obj.value = {OUT_OF_MEMORY: b"out of memory"}.get(code, b"launch failed")
        return 0


def _give(pointer, value):
    pointer._obj.value = value
    return 0


def load(monkeypatch, driver):
    """Makes it what is loaded as the machine's driver; None for no driver."""
    monkeypatch.setattr(_cuda_device, "load_library", lambda: driver)


def limit_room(monkeypatch, size):
    """Lets devices take at most so many bytes at once."""
    monkeypatch.setattr(_processors, "_MOST_BYTES", size)


def install(monkeypatch, **options):
    """Makes it the machine's driver; nothing that it loads is kept on disk."""
    fake = FakeDriver(**options)
    monkeypatch.setenv("JAXBIPED_CACHE", "")
    load(monkeypatch, fake)
    monkeypatch.setattr(_kernel, "ptx_text", lambda text, architecture: text)
    monkeypatch.setattr(_processors, "devices", functools.cache(_cuda_device.devices.__wrapped__))
    return fake
