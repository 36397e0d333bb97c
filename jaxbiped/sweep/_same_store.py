"""Sameness of stores: what made one, compared with what would go on."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jaxbiped._checks import ArgumentError
from jaxbiped._files import strict_json
from jaxbiped._identity import DECISIVE, difference_of
from jaxbiped._types import JsonObject

SETTINGS = "settings"
"""Attribute that holds, as JSON, all that the labels depend on."""
GAITS = "gaits"
"""Of the settings, what a run finds for itself."""
ALSO = "also_written_by"
"""Attribute that holds, as JSON, the provenance of all that wrote in it but the first."""
_CLOSE = 1e-6
"""Relative difference of two gaits' numbers that counts as none."""


def check_same(path: Path, settings: JsonObject, *, but: str = "") -> None:
    """Raises `ArgumentError` unless a store that is there was made with these settings."""
    import zarr

    try:
        group = zarr.open_group(str(path), mode="r", use_consolidated=False)
        stored = json.loads(str(group.attrs[SETTINGS]))
    except (KeyError, ValueError, zarr.errors.GroupNotFoundError, FileNotFoundError):
        raise ArgumentError(
            f"store = {str(path)!r} holds something else: it must be a new directory, or a store "
            "of the same sweep."
        ) from None
    here = json.loads(strict_json(settings))
    for each in (stored, here):
        each.pop(but, None)
    difference = difference_of(stored, here, alike=_is_close)
    if difference is not None:
        raise ArgumentError(
            f"store = {str(path)!r} was made with other settings: {difference}; give it those, or "
            "another store."
        )


def check_writers(path: Path, writer: Mapping[str, str], any_version: bool) -> bool:
    """Whether this writer is new to a store that is there, which `any_version` must allow.

    Raises:
        ArgumentError: another version wrote there, and it does not.
    """
    import zarr

    attributes = zarr.open_group(str(path), mode="r", use_consolidated=False).attrs
    here = {name: writer[name] for name in DECISIVE}
    others = json.loads(str(attributes.get(ALSO, "[]")))
    known = [{name: each.get(name) for name in DECISIVE} for each in (attributes, *others)]
    difference = next((difference_of(each, here) for each in known if each != here), None)
    if difference is not None and not any_version:
        raise ArgumentError(
            f"store = {str(path)!r} was written by another version: {difference}; give it another "
            "store, or any_version=True (--any-version) to let the labels of both stand in it."
        )
    return here not in known


def _is_close(old: Any, new: Any, name: str) -> bool:
    """Gaits are found anew by each run, to their tolerance."""
    numbers = isinstance(old, float) and isinstance(new, float)
    own = name.startswith("gaits")
    return numbers and own and abs(old - new) <= _CLOSE * max(1e-3, abs(old))
