"""What options choose from and begin at, known without importing JAX.

A wrong name or number is refused at once, not after seconds of imports. The registries and the
seed's scene stay what holds; a test compares.
"""

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from jaxbiped._quantity import ParameterInfo, Quantity

MODELS = ("compliant", "rigid")
FORMULATIONS = ("minimal", "redundant")
ORIENTATIONS = ("angle", "euler")
CONSTRAINT_METHODS = (
    "standard", "baumgarte", "penalty", "augmented", "index1", "index1aug", "described",
)  # fmt: skip
ENGINES = ("auto", "xla", "lanes", "cuda")
SOLVERS = (
    "rodas3p", "rodas4", "rodas4p", "rodas5p", "kvaerno3", "kvaerno4", "kvaerno5",
    "bosh3", "tsit5", "dopri5", "dopri8", "euler", "runge2",
)  # fmt: skip
ACCURACIES = ("draft", "balanced", "tight")
GAIT_ACCURACIES = ("draft", "balanced", "tight")
SECTIONS = ("mid-stance", "heel-strike")
SAMPLINGS = ("uniform", "latin-hypercube", "sobol", "halton")
OPTIMISERS = ("trust-region", "slsqp", "trust-constr", "optax")
CHUNK = 16384
"""Starts that a sweep labels and writes at once."""


class SeedParameter(NamedTuple):
    """A parameter of the seed's scene: its value there, and what is allowed."""

    value: float
    info: ParameterInfo


def _seed(
    value: float,
    unit: str = "",
    *,
    positive: bool = False,
    minimum: float | None = None,
    size_below: float | None = None,
) -> SeedParameter:
    return SeedParameter(
        value, ParameterInfo(Quantity("", "", unit), positive, minimum, size_below)
    )


SEED = {
    "slope": _seed(0.02, "rad", size_below=math.pi / 2),
    "g": _seed(9.8, "m/s^2", minimum=0.0),
    "m": _seed(1.0, "kg", positive=True),
    "J": _seed(0.0096, "kg m^2", minimum=0.0),
    "l": _seed(0.40, "m", positive=True),
    "d": _seed(0.10, "m", minimum=0.0),
    "r": _seed(0.08, "m", minimum=0.0),
    "hip_mass": _seed(0.0, "kg", minimum=0.0),
    "n": _seed(1.5, minimum=1.0),
    "K": _seed(1e6, "N/m^n", positive=True),
    "c": _seed(1e7, "N s/m^2", minimum=0.0),
    "mu_static": _seed(0.50, minimum=0.0),
    "mu_kinetic": _seed(0.40, minimum=0.0),
    "v0": _seed(1e-4, "m/s", positive=True),
    "xi": _seed(1000.0, "s/m", minimum=0.0),
}
"""Parameters by their paper names."""

_LAWS = Path(__file__).parents[1] / "scene" / "laws"
_NAME = re.compile(r'^    name: ClassVar\[str\] = "(.+)"$', re.MULTILINE)


def normal_law_names() -> tuple[str, ...]:
    """Names of the laws of the normal force."""
    return tuple(_registered("normal"))


def friction_law_names() -> tuple[str, ...]:
    """Names of the laws of friction, those with bristles last."""
    return tuple(_registered("friction|bristles"))


def _registered(kinds: str) -> Iterator[str]:
    """The names that the laws of some kinds declare, in the order of the registry's lines.

    Read and not imported: a law is registered by its line in `jaxbiped/scene/laws/__init__.py`
    and by nothing else.
    """
    registry = (_LAWS / "__init__.py").read_text(encoding="utf-8")
    lines = re.findall(
        rf"^from jaxbiped\.scene\.laws\.({kinds})\.(\w+) import", registry, re.MULTILINE
    )
    for kind, module in dict.fromkeys(lines):
        yield from _NAME.findall((_LAWS / kind / f"{module}.py").read_text(encoding="utf-8"))
