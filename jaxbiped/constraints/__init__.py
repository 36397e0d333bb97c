"""Constraint methods in redundant coordinates, linkages, and the algebra of their constraints."""

import warnings as _warnings
from typing import Any as _Any

from jaxbiped.constraints._constraint_methods import CONSTRAINT_METHODS as CONSTRAINT_METHODS
from jaxbiped.constraints._constraint_methods import (
    AbstractConstraintMethod as AbstractConstraintMethod,
)
from jaxbiped.constraints._constraint_methods import (
    AbstractProjectingMethod as AbstractProjectingMethod,
)
from jaxbiped.constraints._constraint_methods import Augmented as Augmented
from jaxbiped.constraints._constraint_methods import Baumgarte as Baumgarte
from jaxbiped.constraints._constraint_methods import Constrained as Constrained
from jaxbiped.constraints._constraint_methods import DirectCorrection as DirectCorrection
from jaxbiped.constraints._constraint_methods import Index1 as Index1
from jaxbiped.constraints._constraint_methods import Index1Augmented as Index1Augmented
from jaxbiped.constraints._constraint_methods import Penalty as Penalty
from jaxbiped.constraints._constraint_methods import Standard as Standard
from jaxbiped.constraints._linkage import ORIENTATIONS as ORIENTATIONS
from jaxbiped.constraints._linkage import Linkage as Linkage
from jaxbiped.constraints._linkage import LinkAngle as LinkAngle
from jaxbiped.constraints._linkage import LinkBody as LinkBody
from jaxbiped.constraints._linkage import Pin as Pin

_RENAMED = {"Body": LinkBody, "Joint": Pin}
"""Parts of a linkage by the names that bodies and joints of mechanisms have taken."""


def __getattr__(name: str) -> _Any:
    if name not in _RENAMED:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = _RENAMED[name]
    _warnings.warn(
        f"jaxbiped.constraints.{name} is deprecated: a linkage's is jaxbiped.constraints."
        f"{found.__name__}.",
        DeprecationWarning,
        stacklevel=2,
    )
    return found
