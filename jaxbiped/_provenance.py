"""Provenance of results."""

import hashlib
import json
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from jaxbiped._caches import bounded_cache
from jaxbiped._identity import code_digests

_PACKAGES = ("jaxbiped", "jax", "diffrax", "numpy", "llvmlite")


DECISIVE = ("version_jaxbiped", "git_revision", "user_code")
"""Of the provenance, what decides on results; other packages' versions change their rounding."""


def provenance(*models: object) -> dict[str, str]:
    """Versions and revision, by attribute name, and digests of a user's own code in the models."""
    found = {f"version_{name}": _version(name) for name in _PACKAGES}
    found |= {"version_python": platform.python_version(), "git_revision": _revision()}
    return found | {"user_code": json.dumps(code_digests(*models))}


@bounded_cache(len(_PACKAGES))
def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"


@bounded_cache(1)  # what runs is what was imported
def _revision() -> str:
    """Of the source that runs, "unknown" where it is not a checkout.

    Where the checkout was changed, with a digest of the package's changes.
    """
    try:
        found = _git("describe", "--always", "--dirty", "--abbrev=40").strip()
        if not found.endswith("-dirty"):
            return found
        changes = _git("diff", "HEAD", "--", ".")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return f"{found}-{hashlib.sha256(changes.encode()).hexdigest()[:12]}"


def _git(*command: str) -> str:
    """What git says of the package's own folder."""
    package = Path(__file__).parent
    asked = ["git", "-C", str(package), *command]
    return subprocess.run(asked, capture_output=True, text=True, check=True).stdout
