"""Table of what tools say of a known truth: errors, time, and their own word about their error."""

from importlib.metadata import PackageNotFoundError, version
from typing import Any

from _options import Options

PACKAGES = (
    "jaxbiped", "jax", "diffrax", "scipy", "casadi", "mujoco-mjx", "brax", "warp-lang", "newton",
)  # fmt: skip


def say_rows(options: Options, rows: list[dict[str, Any]]) -> None:
    """Prints one line for each way and setting, or why it has no answer."""
    formats = dict(problem="", way="", setting="", value=".0e", outcome="", state_error=".1e")
    options.table(rows, **formats, gradient_error=".1e", cpu_s=".2e", said=".1e")


def versions() -> dict[str, str | None]:
    """Versions of the tools that can be asked; None where one is not installed."""
    return {name: _version(name) for name in PACKAGES}


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
