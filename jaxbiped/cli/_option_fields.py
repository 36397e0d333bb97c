"""Fields that the options of several commands share: groups, the engine, the accuracy."""

import dataclasses
from typing import Annotated, TypeVar

from tyro.conf import OmitArgPrefixes, arg

_T = TypeVar("_T")

Group = Annotated[_T, OmitArgPrefixes]
"""Options of a class of their own, whose flags bear their names alone."""
Engine = Annotated[
    str, arg(help="What computes: xla, lanes, cuda, or auto for the faster one that can.")
]
GaitAccuracy = Annotated[str, arg(help="How accurately to solve: balanced or tight.")]
"""Of a gait with derivatives."""


def group(kind: type[_T]) -> _T:
    """A field for these options, at their usual values."""
    usual: _T = dataclasses.field(default_factory=kind)
    return usual
