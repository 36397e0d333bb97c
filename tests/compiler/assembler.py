"""PTX assembled by the wheel's `ptxas`: registers and what is spilt from them."""

import importlib.util
import re
import subprocess
import tempfile
from pathlib import Path
from typing import NamedTuple

import pytest

from jaxbiped.compiler.codegen._llvm_lane_loop import ENTRY


class Assembled(NamedTuple):
    """What a thread takes, of registers and in bytes."""

    registers: int
    stack: int
    spill_stores: int
    spill_loads: int


def ptxas() -> Path:
    """Where it is; without it the test is skipped."""
    found = importlib.util.find_spec("nvidia")
    for folder in found.submodule_search_locations if found is not None else ():
        path = Path(folder) / "cuda_nvcc" / "bin" / "ptxas"
        if path.exists():
            return path
    pytest.skip("ptxas is not installed: pip install nvidia-cuda-nvcc-cu12")


def assembled(ptx: str, architecture) -> Assembled:
    """Of the kernel in a module."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "kernel.ptx"
        source.write_text(ptx)
        command = [ptxas(), "-v", f"-arch={architecture.name}", source, "-o", f"{folder}/kernel"]
        done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    numbers = re.search(
        rf"properties for {ENTRY}\n\s*(\d+) bytes stack frame, (\d+) bytes spill stores, "
        r"(\d+) bytes spill loads\n.*Used (\d+) registers",
        done.stderr,
    )
    stack, stores, loads, registers = map(int, numbers.groups())
    return Assembled(registers, stack, stores, loads)
