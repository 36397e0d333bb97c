"""Requirements of a design: bounds of measures, given as mappings, in words or as objects."""

import contextlib
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

from jaxbiped._checks import ArgumentError, check_finite, check_type
from jaxbiped._quantity import si_number
from jaxbiped.hybrid._motion_costs import Along
from jaxbiped.optimise._objectives import (
    OBJECTIVES,
    Linear,
    Measure,
    Measures,
    Objective,
    check_objective,
    objective_named,
)

_WORDS = re.compile(r"^\s*(\w+(?:\[\w+\])?)\s*(<=|>=|==|<|>|=)\s*([^<>=]+?)\s*$")
Bounds: TypeAlias = tuple[float | None, float | None]
SubjectTo: TypeAlias = (
    Mapping[str | Measure, Bounds] | Sequence[str | Along | Linear] | str | Along | Linear | None
)
"""Bounds by measure, or words such as "spectral_radius<0.4" and constraints along the cycle."""


class Requirement(NamedTuple):
    """A measure that must lie in an interval; None for no bound, equal bounds for an equality."""

    name: str
    low: float | None
    high: float | None


class Requirements(NamedTuple):
    """What must hold, the measures that it is about, by name, and how these were given."""

    each: tuple[Requirement, ...]
    measures: Measures
    given: Mapping[str, str | Measure]


def requirements_of(scene: Any, subject_to: SubjectTo) -> Requirements:
    """What must hold, the bounds of each measure gathered.

    Raises:
        ArgumentError: what is not understood, an objective that is unknown or that the scene
            lacks, or bounds that contradict each other.
    """
    gathered: dict[str, Bounds] = {}
    measures: dict[str, Objective] = {}
    told: dict[str, str | Measure] = {}
    for given, (low, high) in _pairs(subject_to):
        name, objective = check_objective(given, scene, "subject_to")
        told[name] = given
        add_measure(measures, name, objective)
        least, most = gathered.get(name, (None, None))
        gathered[name] = (
            max((each for each in (least, low) if each is not None), default=None),
            min((each for each in (most, high) if each is not None), default=None),
        )
    for name, (least, most) in gathered.items():
        if least is not None and most is not None and least > most:
            raise ArgumentError(
                f"subject_to asks that {name} be at least {least:g} and at most {most:g}: these "
                "contradict each other."
            )
    each = (Requirement(name, low, high) for name, (low, high) in gathered.items())
    return Requirements(tuple(each), measures, told)


def add_measure(measures: dict[str, Objective], name: str, objective: Objective) -> None:
    """Adds a measure to others; raises `ArgumentError` where its name is that of another one."""
    taken = measures.get(name, OBJECTIVES.get(name, objective))
    if taken != objective:
        raise ArgumentError(
            f"two measures are called {name!r}, which is not allowed: give one of them a quantity "
            "of other words."
        )
    measures[name] = objective


def _pairs(subject_to: SubjectTo) -> list[tuple[str | Measure, Bounds]]:
    """Measures with their bounds, as they are given."""
    if subject_to is None:
        return []
    check_type("subject_to", subject_to, str, Mapping, Along, Linear, Sequence)
    if isinstance(subject_to, Mapping):
        return [(given, _pair(given, bounds)) for given, bounds in subject_to.items()]
    several = [subject_to] if isinstance(subject_to, str | Along | Linear) else subject_to
    pairs: list[tuple[str | Measure, Bounds]] = []
    for each in several:
        check_type("subject_to", each, str, Along, Linear)
        if isinstance(each, Along):
            pairs += each.requirements()
        else:
            pairs.append(
                (each, _pair(each, each.bounds)) if isinstance(each, Linear) else _parse(each)
            )
    return pairs


def larger_is_worse(
    told: Mapping[str, float], sense: float, requirements: tuple[Requirement, ...]
) -> dict[str, bool]:
    """Of each measure, for the worst of several.

    Raises:
        ArgumentError: a measure of which both more and less would be worse.
    """
    sides = [(name, sense * weight > 0.0) for name, weight in told.items()]
    sides += [(each.name, True) for each in requirements if each.high is not None]
    sides += [(each.name, False) for each in requirements if each.low is not None]
    found = dict(sides)
    for name, larger in sides:
        if larger != found[name]:
            raise ArgumentError(
                f"{name} is bounded and sought from both sides: its worst member is not defined; "
                'choose criterion = "mean".'
            )
    return found


def _pair(given: str | Measure, bounds: object) -> Bounds:
    name = getattr(given, "name", given)
    if not isinstance(bounds, tuple | list) or len(bounds) != 2 or list(bounds) == [None, None]:
        raise ArgumentError(
            f"subject_to[{name!r}] = {bounds!r} is not allowed: give (low, high), None for none."
        )
    for each in bounds:
        if each is not None:
            check_finite(f"subject_to[{name!r}]", each)
    low, high = (None if each is None else float(each) for each in bounds)
    return low, high


def _parse(text: str) -> tuple[str, Bounds]:
    found = _WORDS.match(text)
    unit = None
    try:
        if found is None:
            raise ValueError
        name, sign = found[1], found[2]
        with contextlib.suppress(ArgumentError):
            unit = objective_named(name).quantity.unit
        value = si_number(found[3], unit)
    except ValueError:
        raise ArgumentError(
            f"subject_to = {text!r} is not understood: write name<number, name>number or "
            "name=number, such as spectral_radius<0.4 or step_length>20cm."
        ) from None
    check_finite("subject_to", value)
    if "<" in sign:
        return name, (None, value)
    return name, (value, None) if ">" in sign else (value, value)
