"""Table of what tools say of a known truth: errors, time, and their own word about their error."""

from importlib.metadata import PackageNotFoundError, version
from typing import Any

from _options import Options

PACKAGES = (
    "jaxbiped", "jax", "diffrax", "scipy", "casadi", "mujoco-mjx", "brax", "warp-lang", "newton",
)  # fmt: skip


def say_rows(options: Options, rows: list[dict[str, Any]]) -> None:
    """Prints one line for each way and setting, or why it has no answer."""
    head = f"{'state':>9s}{'gradient':>10s}{'CPU time':>12s}"
    options.say(f"{'problem':19s}{'way':30s}{'setting':13s}{head}  says")
    for row in rows:
        start = f"{row['problem']:19s}{row['way']:30s}"
        setting = f"{row['setting']} {row['value']:<8.0e}" if "value" in row else row["setting"]
        if row["outcome"] != "answered":
            options.say(f"{start}{setting:13s}{row['outcome']}")
            continue
        said = "nothing" if row["said"] is None else f"{row['said']:.1e}"
        options.say(
            f"{start}{setting:13s}{row['state_error']:>9.1e}{row['gradient_error']:>10.1e}"
            f"{1e3 * row['cpu_s']:>9.1f} ms  {said}"
        )


def versions() -> dict[str, str | None]:
    """Versions of the tools that can be asked; None where one is not installed."""
    return {name: _version(name) for name in PACKAGES}


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
