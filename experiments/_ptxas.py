"""Registers and spills of programs for CUDA devices, by the assembler of CUDA's wheel."""

import importlib.util
import re
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp

import jaxbiped as jb
from jaxbiped.compiler import ARCHITECTURES, deferred_checks, ptx_text

REGISTERS, GRANULE, WARP, MOST_WARPS = 65536, 8, 32, 64
"""Of a multiprocessor; registers are given to threads by eight; warps that run on one at once."""
BOUNDS = ((64, 1), (64, 6), (64, 8))
"""Threads of a block, and blocks of a multiprocessor that there are to be registers for."""


def ptxas() -> Path | None:
    """Where the assembler is."""
    found = importlib.util.find_spec("nvidia")
    folders = [] if found is None else list(found.submodule_search_locations or ())
    paths = [Path(folder) / "cuda_nvcc" / "bin" / "ptxas" for folder in folders]
    return next((path for path in paths if path.exists()), None)


def warps_at_once(registers: int, threads: int) -> int:
    """Warps of one multiprocessor, as far as registers allow."""
    given = -(-registers // GRANULE) * GRANULE
    blocks = REGISTERS // (given * threads)
    return min(blocks * threads // WARP, MOST_WARPS)


def rows(architectures: tuple[str, ...], bounds: tuple[tuple[int, int], ...]) -> Iterator[Any]:
    """Each program on each kind of device under each bound."""
    tool = ptxas()
    if tool is None:
        return
    chosen = [each for each in ARCHITECTURES.values() if each.name in architectures]
    for name, program in _programs().items():
        for threads, blocks in bounds:
            text = program.kernel.device_text(threads, blocks)
            for architecture in chosen:
                numbers = _assembled(tool, ptx_text(text, architecture), architecture.name)
                yield {
                    "program": name,
                    "architecture": architecture.name,
                    "blocks": blocks,
                    **numbers,
                    "warps": warps_at_once(numbers["registers"], threads),
                }


def _programs() -> dict[str, Any]:
    scene, state = jb.seed_scene(), jb.seed_state()

    def walk(rate: Any, **options: Any) -> Any:
        start = state._replace(omega_2=rate)
        return jb.simulate(scene, start, duration=1.0, engine="lanes", **options).state

    asked = {
        "final state": lambda rate: walk(rate, save="end"),
        "arrivals": lambda rate: walk(rate, save=jb.MidStance()),
        "extremes": lambda rate: walk(rate, save="end", extremes=lambda _, y: y.hip_z),
        "tangents": jax.jacfwd(lambda rate: walk(rate, save="end")),
    }
    found = {}
    for name, function in asked.items():
        with deferred_checks() as programs:
            jax.jit(function).lower(jnp.asarray(-1.2))
        found[name] = programs[-1]
    return found


def _assembled(tool: Path, ptx: str, architecture: str) -> dict[str, int]:
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "kernel.ptx"
        source.write_text(ptx)
        command = [tool, "-v", f"-arch={architecture}", source, "-o", f"{folder}/kernel"]
        told = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    own = told[told.index("properties for jaxbiped_run") :]
    stores = re.search(r"(\d+) bytes spill stores, (\d+) bytes spill loads", own)
    registers = re.search(r"Used (\d+) registers", own)
    assert stores is not None
    assert registers is not None
    return {
        "registers": int(registers[1]),
        "spill_stores": int(stores[1]),
        "spill_loads": int(stores[2]),
    }
