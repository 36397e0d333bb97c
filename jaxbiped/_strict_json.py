"""JSON as its standard has it: null for what is no finite number, never NaN or Infinity.

Everything that is written as JSON is written by this.
"""

import json
import math
from collections.abc import Callable, Mapping
from typing import Any


def strict_json(
    value: object, *, indent: int | None = None, unknown: Callable[[float], Any] = lambda _: None
) -> str:
    """A value as JSON.

    Args:
        value: plain values, arrays and numbers of NumPy, in mappings and sequences.
        indent: of each level; all on one line unless given.
        unknown: what stands for a number that is not finite; null unless given.

    Returns:
        The text, without a line's end.
    """
    plain = _plain(value, unknown)
    return json.dumps(plain, indent=indent, ensure_ascii=False, allow_nan=False)


def _plain(value: Any, unknown: Callable[[float], Any]) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(each, unknown) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each, unknown) for each in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist(), unknown)
    if isinstance(value, float) and not math.isfinite(value):
        return unknown(value)
    return value
