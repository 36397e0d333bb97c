"""Requirements on a gait: bounds and equalities of its measures, as mappings or in words."""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

from jaxbiped._checks import ArgumentError, check_finite
from jaxbiped.optimise._objectives import check_objective
from jaxbiped.scene._scene import RigidScene, Scene

SubjectTo: TypeAlias = Mapping[str, tuple[float | None, float | None]] | Sequence[str] | str | None
"""Bounds by name, or words such as "spectral_radius<0.4"."""
_WORDS = re.compile(r"^\s*(\w+)\s*(<=|>=|==|<|>|=)\s*([-+.\w]+)\s*$")


class Requirement(NamedTuple):
    """A measure that must lie in an interval; None for no bound, equal bounds for an equality."""

    name: str
    low: float | None
    high: float | None

    def __str__(self) -> str:
        if self.low == self.high:
            return f"{self.name} = {self.low:g}"
        low = "" if self.low is None else f"{self.low:g} ≤ "
        return low + self.name + ("" if self.high is None else f" ≤ {self.high:g}")


def requirements_of(scene: Scene | RigidScene, subject_to: SubjectTo) -> tuple[Requirement, ...]:
    """What must hold, the bounds of each measure gathered.

    Raises:
        ArgumentError: what is not understood, an objective that is unknown or that the scene
            lacks, or bounds that contradict each other.
    """
    pairs: list[tuple[str, tuple[float | None, float | None]]]
    if subject_to is None:
        return ()
    if isinstance(subject_to, Mapping):
        pairs = [(name, _pair(name, bounds)) for name, bounds in subject_to.items()]
    else:
        words = [subject_to] if isinstance(subject_to, str) else list(subject_to)
        pairs = [_parse(text) for text in words]
    gathered: dict[str, tuple[float | None, float | None]] = {}
    for name, (low, high) in pairs:
        check_objective(name, scene, "subject_to")
        old = gathered.get(name, (None, None))
        lows = [each for each in (old[0], low) if each is not None]
        highs = [each for each in (old[1], high) if each is not None]
        gathered[name] = (max(lows, default=None), min(highs, default=None))
    for name, (least, most) in gathered.items():
        if least is not None and most is not None and least > most:
            raise ArgumentError(
                f"subject_to asks that {name} be at least {least:g} and at most {most:g}: these "
                "contradict each other."
            )
    return tuple(Requirement(name, low, high) for name, (low, high) in gathered.items())


def _pair(name: str, bounds: object) -> tuple[float | None, float | None]:
    if not isinstance(bounds, tuple | list) or len(bounds) != 2 or list(bounds) == [None, None]:
        raise ArgumentError(
            f"subject_to[{name!r}] = {bounds!r} is not allowed: give (low, high), None for none."
        )
    for each in bounds:
        if each is not None:
            check_finite(f"subject_to[{name!r}]", each)
    low, high = (None if each is None else float(each) for each in bounds)
    return low, high


def _parse(text: str) -> tuple[str, tuple[float | None, float | None]]:
    found = _WORDS.match(text) if isinstance(text, str) else None
    try:
        if found is None:
            raise ValueError
        name, sign, value = found[1], found[2], float(found[3])
    except ValueError:
        raise ArgumentError(
            f"subject_to = {text!r} is not understood: write name<number, name>number or "
            "name=number, such as spectral_radius<0.4."
        ) from None
    check_finite("subject_to", value)
    if "<" in sign:
        return name, (None, value)
    return name, (value, None) if ">" in sign else (value, value)
