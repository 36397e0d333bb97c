"""Examination of an installation: versions, hardware, caches, and a self-test."""

import platform
import time
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version

import jax

from jaxbiped.caching._disk_cache import cache_folder, disk_use
from jaxbiped.cli._report import Report, table
from jaxbiped.cli._self_test import Truth, self_test
from jaxbiped.cli.commands._doctor import Doctor
from jaxbiped.compiler import default_threads, host

PACKAGES = (
    "jaxbiped", "jax", "jaxlib", "diffrax", "equinox", "optimistix", "lineax", "llvmlite",
    "numpy", "scipy", "xarray", "zarr",
)  # fmt: skip
BAD = {
    "jax": {
        "0.10.2": "it miscompiles on CPUs (jax issue 39103)",
        "0.11.1": "loops are reported to hang on CPUs",
    }
}
"""Versions with which results are wrong, and why."""
_NONE = "not installed"


def examine(command: Doctor) -> int:
    """Prints what is installed and tests it; returns 1 where something is wrong."""
    report, versions = Report(command.json), _versions()
    report.say(table(("package", "version"), list(versions.items()), most=len(versions)))
    wrong = complaints(versions)
    report.say(f"Python {platform.python_version()} on {platform.system()} {platform.machine()}")
    width, threads = host().width, default_threads()
    report.say(f"vectors of {width} numbers, {threads} threads, JAX on {jax.default_backend()}")
    folder, use = cache_folder(), disk_use()
    size = sum(each.size for each in use.values())
    report.say(f"programs on disk: {size / 2**20:.1f} MiB in {folder or 'no folder'}")
    began = time.perf_counter()
    truths, failure = _tested()
    seconds = time.perf_counter() - began
    wrong += [f"{each.name} is off by {abs(each.found - each.known):.0e}" for each in truths
              if not each.holds]  # fmt: skip
    wrong += [failure] if failure else []
    rows = [(each.name, f"{each.known:.12f}", f"{each.found:.12f}", _word(each)) for each in truths]
    report.say(table(("self-test", "truth", "found", ""), rows, most=len(rows)))
    report.say(f"tested in {seconds:.1f} s: {'; '.join(wrong) if wrong else 'nothing is wrong'}")
    report.finish(
        {
            "python": platform.python_version(),
            "system": f"{platform.system()} {platform.machine()}",
            "versions": versions,
            "vector_width": width,
            "threads": threads,
            "backend": jax.default_backend(),
            "cache_bytes": size,
            "self_test": [each._asdict() | {"holds": each.holds} for each in truths],
            "seconds": seconds,
            "wrong": wrong,
        }
    )
    return 1 if wrong else 0


def complaints(versions: Mapping[str, str]) -> list[str]:
    """What is known of these versions that makes results wrong."""
    return [
        f"{name} {versions[name]} must not be used: {bad[versions[name]]}"
        for name, bad in BAD.items()
        if versions.get(name) in bad
    ]


def _versions() -> dict[str, str]:
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = _NONE
    return found


def _tested() -> tuple[tuple[Truth, ...], str]:
    """The self-test, and a sentence where it did not come to its end."""
    try:
        return self_test(), ""
    except Exception as error:  # whatever is broken is what the report is for
        return (), f"the self-test ended with {type(error).__name__}: {error}"


def _word(truth: Truth) -> str:
    return "holds" if truth.holds else "wrong"
