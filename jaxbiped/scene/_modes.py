"""Modes of a mechanism on rigid feet: which feet stand, of which leg, and which stops are held.

A state tells its mode by one whole number, a sum of powers of two: first the feet that may stand,
where there are several, then the limits of stops that are held, then those of stops that lock but
that are only pressed on by now.
"""

import functools
import operator
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped.scene._joint_parts import HOLDS, Stop
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._structure import Angle, Indices, Structure

PRESSED, UNTIL_STRIKE, THROUGH_STRIKE = HOLDS


class Limit(NamedTuple):
    """A limit of a stop, which is plastic on rigid feet.

    Attributes:
        joint: number of the stop among the joint parts.
        upper: whether it is the upper one.
        gap: the angle, counted so that it grows away from the limit.
        leg: number of the leg that the angle lies within; None for another.
        holds: as the stop's.
        name: as `held=` tells it.
    """

    joint: int
    upper: bool
    gap: Angle
    leg: int | None
    holds: str
    name: str

    @property
    def locks(self) -> bool:
        """Whether a hit locks it."""
        return self.holds != PRESSED

    def distance(self, mechanism: Mechanism, angles: Sequence[Any], slope: Any) -> Any:
        """How far angles of all bodies are from it [rad]; below zero where it is passed."""
        stop: Any = mechanism.joints[self.joint]
        value = self.gap.of(angles, slope)
        return stop.upper + value if self.upper else value - stop.lower


class Modes(NamedTuple):
    """All that may stand or be held.

    Attributes:
        soles: numbers of the feet of each leg that may stand, by the legs' numbers; none where
            there is but one foot.
        limits: of all stops.
        twins: number of each limit's mirror image.
    """

    soles: tuple[tuple[int, Indices], ...]
    limits: tuple[Limit, ...]
    twins: Indices

    @property
    def feet(self) -> Indices:
        """Numbers of the feet whose standing a mode tells."""
        return tuple(k for _, feet in self.soles for k in feet)

    @property
    def any(self) -> bool:
        """Whether more than one mode can occur."""
        return bool(self.feet or self.limits)

    @property
    def may_change(self) -> bool:
        """Whether one can between heel strikes."""
        return bool(self.limits) or any(len(feet) > 1 for _, feet in self.soles)

    @property
    def locks(self) -> Indices:
        """Numbers of the limits that lock."""
        return tuple(i for i, limit in enumerate(self.limits) if limit.locks)

    def stands_of(self, mode: "Mode", leg: int) -> tuple[Any, ...]:
        """Of the feet of a leg, whether they stand; none where a mode does not tell."""
        own = dict(self.soles).get(leg, ())
        return tuple(each for k, each in zip(self.feet, mode.stands, strict=True) if k in own)

    def stands_on(self, mode: "Mode", leg: int) -> Any:
        """Whether this leg is the one that stands, of several that may."""
        first, *others = self.stands_of(mode, leg)
        return functools.reduce(operator.or_, others, first)

    def standing(self, leg: int, stands: Sequence[Any], like: Any) -> tuple[Any, ...]:
        """`Mode.stands` where these feet of a leg stand; of a leg of one foot, that one."""
        found: list[Any] = []
        for each, feet in self.soles:
            if each != leg:
                found += [0.0 * like > 1.0] * len(feet)
            else:
                found += stands if len(feet) > 1 else [0.0 * like == 0.0]
        return tuple(found)

    def flat(self, mode: "Mode") -> dict[int, Any]:
        """Of each leg that has two feet, whether both stand."""
        bits = {leg: self.stands_of(mode, leg) for leg, feet in self.soles if len(feet) > 1}
        return {leg: first & second for leg, (first, second) in bits.items()}

    def decoded(self, numpy: Any, mode: Any) -> "Mode":
        """What a mode says; booleans shaped as it."""
        whole = numpy.round(mode)
        found = []
        for _ in range(len(self.feet) + len(self.limits) + len(self.locks)):
            half = numpy.floor(0.5 * whole)
            found.append(whole > 2.0 * half)
            whole = half
        feet, limits = len(self.feet), len(self.feet) + len(self.limits)
        return Mode(tuple(found[:feet]), tuple(found[feet:limits]), tuple(found[limits:]))

    def encoded(self, numpy: Any, mode: "Mode", like: Any) -> Any:
        """The number of a mode, shaped like another number."""
        total, size = 0.0 * like, 1.0
        loose = [mode.held[i] & each for i, each in zip(self.locks, mode.loose, strict=True)]
        for flag in (*mode.stands, *mode.held, *loose):
            total = total + numpy.where(flag, size, 0.0)
            size *= 2.0
        return total


class Mode(NamedTuple):
    """What stands and what is held; booleans.

    Attributes:
        stands: of each of `Modes.feet`.
        held: of each limit.
        loose: of each limit that locks: held only while it is pressed on.
    """

    stands: tuple[Any, ...]
    held: tuple[Any, ...]
    loose: tuple[Any, ...]


def modes_of(mechanism: Mechanism, feet: Mapping[int, Indices]) -> Modes:
    """The modes of a mechanism.

    Args:
        mechanism: with its stops.
        feet: numbers of the feet of each leg that may stand.

    Raises:
        ArgumentError: a stop that locks an angle that does not lie within one leg.
    """
    structure = mechanism.structure
    limits: list[Limit] = []
    for k, (angle, part) in enumerate(zip(structure.joints, mechanism.joints, strict=True)):
        if isinstance(part, Stop):
            limits += _limits(structure, k, angle, part)
    several = sum(map(len, feet.values())) > 1
    soles = tuple(feet.items()) if several else ()
    return Modes(soles, tuple(limits), _twins(structure, limits))


def _limits(structure: Structure, joint: int, angle: Angle, stop: Stop) -> list[Limit]:
    legs = {structure.leg_of_body(body) for body, _ in angle.weights}
    leg = next(iter(legs)) if len(legs) == 1 else None
    if stop.holds != PRESSED and leg is None:
        raise ArgumentError(
            f"holds = {stop.holds!r} is not allowed for Stop({stop.angle!r}), whose angle does not "
            f"lie within one leg: give {PRESSED!r}."
        )
    own = stop.name or structure.bodies[angle.weights[0][0]]
    both = stop.upper is not None and stop.lower is not None
    found = []
    for limit, upper in ((stop.upper, True), (stop.lower, False)):
        if limit is not None:
            gap = angle.reversed() if upper else angle
            name = f"{own}.{'upper' if upper else 'lower'}" if both else own
            found.append(Limit(joint, upper, gap, leg, stop.holds, name))
    return found


def _twins(structure: Structure, limits: Sequence[Limit]) -> Indices:
    twins, joints = structure.body_twins, structure.joint_twins
    if twins is None or joints is None:
        return tuple(range(len(limits)))

    def image(limit: Limit) -> int:
        gap = limit.gap.mirrored(twins)
        return next(
            i
            for i, other in enumerate(limits)
            if other.joint == joints[limit.joint] and other.gap.is_like(gap)
        )

    return tuple(map(image, limits))


def limits_named(modes: Modes, held: str | Sequence[str]) -> Indices:
    """Numbers of the limits of these names.

    Raises:
        ArgumentError: a name that no limit has.
    """
    wanted = [held] if isinstance(held, str) else held
    if not isinstance(wanted, list | tuple):
        raise ArgumentError(f"held = {held!r} is not allowed: give a stop's name, or several.")
    names = [limit.name for limit in modes.limits]
    if wanted and not names:
        raise ArgumentError(f"held = {held!r} is not allowed: the walker has no stops.")
    for name in wanted:
        check_choice("held", name, names)
        if names.count(name) > 1:
            raise ArgumentError(f"held = {name!r} is that of several stops: give a name= to each.")
    return tuple(i for i, name in enumerate(names) if name in wanted)
