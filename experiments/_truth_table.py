"""Table of what tools say of a known truth: errors, time, and their own word about their error."""

from importlib.metadata import PackageNotFoundError, version
from typing import Any

from _options import Options

PACKAGES = (
    "jaxbiped", "jax", "diffrax", "scipy", "casadi", "mujoco-mjx", "brax", "warp-lang", "newton",
)  # fmt: skip


def say_rows(options: Options, rows: list[dict[str, Any]]) -> None:
    """Prints one line for each way and setting, or why it has no answer."""
    told = []
    for row in rows:
        if row["outcome"] == "answered":
            said = "nothing" if row["said"] is None else f"{row['said']:.1e}"
            row = row | {"cpu_time": f"{1e3 * row['cpu_s']:.1f} ms", "says": said}
        told.append(row)
    formats = dict(problem="", way="", setting="", value=".0e", outcome="", state_error=".1e")
    options.table(told, **formats, gradient_error=".1e", cpu_time="", says="")


def versions() -> dict[str, str | None]:
    """Versions of the tools that can be asked; None where one is not installed."""
    return {name: _version(name) for name in PACKAGES}


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
