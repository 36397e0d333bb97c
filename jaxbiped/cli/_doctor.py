"""`jaxbiped doctor` and `cache`: what is installed and computes rightly; what is kept on disk."""

import contextlib
import time
from collections.abc import Mapping
from typing import Any, NamedTuple

import jaxbiped as jb
from jaxbiped.caching._disk_cache import BYTES, CACHE_VARIABLE, cache_folder, clear_disk, disk_use
from jaxbiped.cli import _options as options
from jaxbiped.cli._report import Report, columns, records
from jaxbiped.models import MODELS

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
_TRUTH = {
    "self-test": "{0.name}",
    "truth": "{0.known:.12f}",
    "found": "{0.found:.12f}",
    "": "{0.verdict}",
}
_FALL = 0.3
"""How long a walker falls freely [s]."""
_PUBLISHED = MODELS["garcia"].starts["long"]
"""The simplest walker's long gait behind a heel strike."""


class Doctor(options.Command):
    """Show versions, vectors, threads and caches, and test this machine's answers."""

    json: options.JsonPath = None
    """File for the same in JSON; - prints only the JSON."""

    def run(self) -> int:
        """Prints what is installed and tests it; returns 1 where something is wrong."""
        import platform

        import jax

        from jaxbiped.compiler import default_threads, host

        system = f"{platform.system()} {platform.machine()}"
        report, versions = Report(self.json), _versions()
        size = sum(each.size for each in disk_use().values())
        report.say(
            columns({"package": "{0[0]}", "version": "{0[1]}"}, versions.items()),
            f"Python {platform.python_version()} on {system}",
            f"vectors of {host().width} numbers, {default_threads()} threads, JAX on "
            f"{jax.default_backend()}",
            f"programs on disk: {size / 2**20:.1f} MiB in {cache_folder() or 'no folder'}",
        )
        wrong, truths = complaints(versions), tuple[Truth, ...]()
        began = time.perf_counter()
        try:
            truths = self_test()
        except Exception as error:  # whatever is broken is what the report is for
            wrong.append(f"the self-test ended with {type(error).__name__}: {error}")
        seconds = time.perf_counter() - began
        off = (each for each in truths if not each.holds)
        wrong += [f"{each.name} is off by {abs(each.found - each.known):.0e}" for each in off]
        told = "; ".join(wrong) or "nothing is wrong"
        report.say(columns(_TRUTH, truths), f"tested in {seconds:.1f} s: {told}")
        report.finish(
            {
                "python": platform.python_version(),
                "system": system,
                "versions": versions,
                "vector_width": host().width,
                "threads": default_threads(),
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
    from importlib.metadata import PackageNotFoundError, version

    found = dict.fromkeys(PACKAGES, "not installed")
    for name in PACKAGES:
        with contextlib.suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


class Truth(NamedTuple):
    """One number that is known, what this machine finds, and by how much they may differ (SI)."""

    name: str
    known: float
    found: float
    allowed: float

    @property
    def holds(self) -> bool:
        return abs(self.found - self.known) <= self.allowed

    @property
    def verdict(self) -> str:
        return "holds" if self.holds else "wrong"


def self_test() -> tuple[Truth, ...]:
    """Free fall and its derivative with the lanes engine, and a published gait on rigid feet."""
    height, derivative = _fall()
    return (
        Truth("height after free fall [m]", 2.0 - 0.5 * 9.8 * _FALL**2, height, 1e-9),
        Truth("its derivative with respect to g [s²]", -0.5 * _FALL**2, derivative, 1e-9),
        Truth("simplest walker's angle after a footstep [rad]", *_footstep(), 1e-7),
    )


def _fall() -> tuple[float, float]:
    """Of a walker that is let go 2 m above level ground: height of its hip, and by gravity."""
    from jaxbiped._types import as_float
    from jaxbiped.caching._cached_jit import cached_jit

    scene = jb.with_parameters(jb.seed_scene(), {"slope": 0.0})
    start = jb.State(*map(as_float, (0.0, 2.0, 0.1, -0.1, 0.0, 0.0, 0.0, 0.0)))
    found, slope = cached_jit(_height_and_slope)(scene, start, as_float(9.8))
    return float(found), float(slope)


def _height_and_slope(scene: "jb.Scene", start: "jb.State", g: Any) -> Any:
    import jax
    import jax.numpy as jnp

    def height(g: Any) -> Any:
        moved = jb.with_parameters(scene, {"g": g})
        return jb.simulate(moved, start, duration=_FALL, save="end", engine="lanes").final.hip_z

    return jax.jvp(height, (g,), (jnp.ones_like(g),))


def _footstep() -> tuple[float, float]:
    """Angles of the stance leg before a footstep and behind it, each in its leg's own direction."""
    scene = jb.models.garcia()
    start = scene.state(**_PUBLISHED)
    end = jb.rigid_walk(scene, start, footsteps=1).final._asdict().items()
    angles = (float(x) for name, x in end if name.startswith("theta"))
    return max(_PUBLISHED.values()), max(angles)


_CONTENT = {
    "lanes": "machine code of lanes",
    "programs": "programs of lanes, without their code",
    "host": "programs run by NumPy",
    "sources": "digests of the package's source",
    "xla": "programs compiled by XLA",
}


class Cache(options.Command):
    """Show the compiled programs that are kept on disk, or remove them."""

    clear: bool = False
    """Remove all programs; the next runs compile again."""
    json: options.JsonPath = None
    """File for the same in JSON; - prints only the JSON."""

    def run(self) -> int:
        report, folder = Report(self.json), cache_folder()
        removed = clear_disk() if self.clear else None
        use = disk_use()
        rows = [(_CONTENT[kind], each.entries, each.size / 2**20) for kind, each in use.items()]
        layout = {"kept": "{0[0]}", "entries": "{0[1]}", "MiB": "{0[2]:.1f}"}
        report.say(columns(layout, rows))
        if folder is None:
            report.say(f"nothing is kept: {CACHE_VARIABLE} is empty")
        else:
            report.say(f"in {folder}, at most {BYTES // 2**20} MiB")
        if removed is not None:
            report.say(f"removed: {removed.entries} entries, {removed.size / 2**20:.1f} MiB")
        numbers = {"folder": folder and str(folder), "bound_bytes": BYTES}
        kept = {kind: records(each) for kind, each in use.items()}
        report.finish(numbers | {"kept": kept, "removed": records(removed)})
        return 0
