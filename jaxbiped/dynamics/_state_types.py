"""Types of states by the names of their scalars: the same each time and in each process."""

import collections
import re
from collections.abc import Sequence
from typing import Any

import jaxbiped.dynamics._state as known_states
from jaxbiped.caching._caches import bounded_cache

_KEPT = 64
"""Types that are kept though no state of theirs is left."""
_CALLED = re.compile(r"StateOf\((\w+(?:,\w+)*)\)")


def state_type_of(names: Sequence[str]) -> type[Any]:
    """The NamedTuple of scalars with these names; `State` or another known one where they agree.

    It pickles, and its name tells it from others, so that programs on disk are found again by it.
    """
    return _made(tuple(names))


@bounded_cache(_KEPT)
def _made(names: tuple[str, ...]) -> type[Any]:
    for kind in (known_states.State, known_states.BristleState, known_states.RigidState):
        if kind._fields == names:
            return kind
    made: Any = collections.namedtuple("State", names)  # type: ignore[misc]
    made.__module__, made.__qualname__ = __name__, f"StateOf({','.join(names)})"
    return made


def __getattr__(name: str) -> Any:
    """A type by its name, for pickles."""
    called = _CALLED.fullmatch(name)
    if called is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return state_type_of(called[1].split(","))
