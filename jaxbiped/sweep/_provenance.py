"""What made some results."""

import functools
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_PACKAGES = ("jaxbiped", "jax", "diffrax", "numpy", "llvmlite")


def provenance() -> dict[str, str]:
    """Versions and revision, by attribute name."""
    found = {f"version_{name}": _version(name) for name in _PACKAGES}
    return found | {"version_python": platform.python_version(), "git_revision": _revision()}


@functools.cache
def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"


@functools.cache  # what runs is what was imported
def _revision() -> str:
    """Of the source that runs, "unknown" where it is not a checkout."""
    here = Path(__file__).parent
    command = ["git", "-C", str(here), "describe", "--always", "--dirty", "--abbrev=40"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
