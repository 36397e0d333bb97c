"""jaxbiped: differentiable simulation of passive biped walkers in JAX.

The map is the stub beside this file, `__init__.pyi`: what a first session needs is there; the rest
lies in namespaces by subject. Each name is imported when it is first used, so that a start waits
for nothing that it does without, and `jaxbiped --help` not even for JAX.

Importing jaxbiped switches JAX to 64-bit floats: contact this stiff cannot do with less. Where JAX
is not imported yet, the environment variable JAX_ENABLE_X64 tells it, and child processes, too.
"""

from jaxbiped import caching as caching  # its clock starts before anything slow

import importlib as _importlib
import os as _os
import pathlib as _pathlib
import sys as _sys
import warnings as _warnings
from types import ModuleType as _ModuleType
from typing import Any as _Any

if "jax" in _sys.modules:
    import jax as _jax  # waits for another thread that is at it

    _jax.config.update("jax_enable_x64", True)
else:
    _os.environ["JAX_ENABLE_X64"] = "1"

_STUB = _pathlib.Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
_HOMES = {
    words[3]: words[1] for words in map(str.split, _STUB.splitlines()) if words[:1] == ["from"]
}
"""Where each public name is defined: its line of the stub is `from HOME import NAME as NAME`."""

__all__ = list(_HOMES)

_MOVED = {
    "dynamics": ("LinkageScene", "walker_linkage"),
    "labels": (
        *("Attractor", "Family", "Labelled", "Labelling"),
        *("label_at", "nearest_failure", "with_gaits_met"),
    ),
    "laws": ("parameter",),
    "measure": ("energy_ledger", "trajectory_dataset"),
}
"""Names that were here before, by the namespace that they lie in; they warn and still work."""


class _Package(_ModuleType):
    """This package, in which the functions `simulate` and `sweep` go before packages so named."""

    def __setattr__(self, name: str, value: object) -> None:
        if isinstance(value, _ModuleType) and _HOMES.get(name, __name__) != __name__:
            return  # the import of a package of that name would put it here
        super().__setattr__(name, value)


_sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> _Any:
    if name == "__version__":
        return _importlib.import_module("importlib.metadata").version(__name__)
    home = _HOMES.get(name)
    if home is None:
        for space, names in _MOVED.items():
            if name in names:
                _warnings.warn(
                    f"jaxbiped.{name} is deprecated: it is jaxbiped.{space}.{name}.",
                    DeprecationWarning,
                    stacklevel=2,
                )
                return getattr(__getattr__(space), name)
        raise AttributeError(f"module 'jaxbiped' has no attribute {name!r}")
    if home == __name__:
        return _importlib.import_module(f"{__name__}.{name}")
    # As `from HOME import NAME` does, where NAME may be a module.
    found = getattr(__import__(home, fromlist=[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
