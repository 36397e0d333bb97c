"""Modes of a mechanism on rigid feet: which feet stand, of which leg, and which stops are held.

A state tells its mode by one whole number, a sum of powers of two: first the feet that may stand,
where there are several, then the limits of stops that are held, then those of stops that lock but
that are only pressed on by now.
"""

import functools
import operator
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import jax.tree_util as jtu

from jaxbiped._checks import ArgumentError, check_choice, holds_somewhere
from jaxbiped._types import Parameter, Scalar, as_float, by_numpy, is_traced
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.scene._bodies import Foot
from jaxbiped.scene._joint_parts import HOLDS, Stop
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._placement import angles_and_rates_named, feet_named, foot_motion
from jaxbiped.scene._structure import Angle, Indices, Structure

PRESSED, UNTIL_STRIKE, THROUGH_STRIKE = HOLDS
AT_LIMIT = 1e-6
"""Distance from a limit [rad], and rate in rad/s, up to which a stop may be held."""
_DRIFT = 1e-2
"""The same of a state that a walk ended at."""
_LEVEL = 1e-9
"""Difference of height of two feet, in units of the walker's height, up to which both stand."""


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
    """The modes of a mechanism, from the feet of each leg that may stand.

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


def standing_legs(structure: Structure) -> Indices:
    """Numbers of the legs that may stand, last the one that does where a cycle begins.

    A mirror or a turn exchanges names at each footstep, so that the same one always stands.
    """
    last = structure.stance_leg
    if structure.leg_twins is not None or structure.turn is not None:
        return (last,)
    return (*(i for i in range(len(structure.legs)) if i != last), last)


def next_leg(structure: Structure, leg: int) -> int:
    """Number of the leg that swings, and stands next, where this one stands."""
    return (leg + 1) % len(structure.legs)


def leg_after_strike(structure: Structure, leg: int) -> int:
    """Number of the leg that stands after the next heel strike, names exchanged."""
    return leg if len(standing_legs(structure)) == 1 else next_leg(structure, leg)


def check_rolls(mechanism: Mechanism) -> None:
    """Raises `ArgumentError` for a mechanism whose walk on rigid feet is not known yet."""
    structure = mechanism.structure
    soles = [
        len(feet) <= 2 and len({structure.feet[k] for k in feet}) == 1
        for feet in structure.feet_of_leg
    ]
    if structure.turn is None and (len(soles) != 2 or not all(soles)):
        raise ArgumentError(
            f"walker has the feet {', '.join(structure.feet_told)}, which is not allowed on rigid "
            "feet yet: there must be two legs, each with one or two feet on one body; use a Scene "
            "for others, whose feet are compliant."
        )
    for one, other in (feet for feet in structure.feet_of_leg if len(feet) == 2):
        if holds_somewhere(_touch_within(mechanism, mechanism.feet[one], mechanism.feet[other])):
            raise ArgumentError(
                f"feet {structure.feet_told[one]} and {structure.feet_told[other]} are not allowed "
                "together on rigid feet: where both stand, they stand on one point, about which "
                "the leg turns; leave one out."
            )
    rigid_modes(mechanism)


def _touch_within(mechanism: Mechanism, one: Foot, other: Foot) -> Any:
    """Tells whether the circles of two feet are one, or touch where one lies in the other."""
    places = [(foot.centre.along, foot.centre.ahead, foot.radius) for foot in (one, other)]
    numbers = (0.0 if number is None else number for place in places for number in place)

    def test(_: Any, height: Any, a: Any, b: Any, r: Any, c: Any, d: Any, s: Any) -> Any:
        apart = (a - c) ** 2 + (b - d) ** 2 - (r - s) ** 2
        return abs(apart) <= _LEVEL * height**2

    return by_numpy(test, mechanism.height, *numbers)


def rigid_modes(mechanism: Mechanism) -> Modes:
    """The modes of a mechanism on rigid feet."""
    structure = mechanism.structure
    legs = standing_legs(structure)
    return modes_of(mechanism, {leg: structure.feet_of_leg[leg] for leg in sorted(legs)})


def check_stands(structure: Structure, standing: str | Sequence[str] | None) -> Indices:
    """Numbers of the feet that are named as standing, all of one leg.

    Raises:
        ArgumentError: other feet.
    """
    able = standing_legs(structure)
    if standing is None:
        return structure.feet_of_leg[able[-1]]
    named = feet_named(structure, standing)
    if not any(set(named) <= set(structure.feet_of_leg[leg]) for leg in able):
        told = " or ".join(
            repr(structure.feet_told[k]) for leg in able for k in structure.feet_of_leg[leg]
        )
        which = "one leg stands" if len(able) > 1 else "the second of each pair stands"
        raise ArgumentError(f"standing = {standing!r} is not allowed: {which}, {told}.")
    return named


def starting_mode(
    mechanism: Mechanism,
    modes: Modes,
    slope: Parameter,
    state: Mapping[str, Scalar],
    standing: Indices,
    held: str | Sequence[str] | None,
) -> Scalar:
    """The mode of a state.

    Args:
        mechanism: with its stops.
        modes: of it.
        slope: angle of the vertical [rad].
        state: scalars by name.
        standing: feet of one leg that may stand: the lowest of them does, or both.
        held: names of stops that are held; None for those that rest at a limit. One that moves
            into its limit hits it as the motion begins.

    Raises:
        ArgumentError: a stop that is passed, or one that is held off its limit.
    """
    named = None if held is None else limits_named(modes, held)
    leaves, tree = jtu.tree_flatten(mechanism)
    names, known = list(state), len(state)

    def found(numpy: Any, slope: Any, *numbers: Any) -> tuple[Any, ...]:
        values = dict(zip(names, numbers[:known], strict=True))
        placed: Mechanism = jtu.tree_unflatten(tree, numbers[known:])
        angles, rates = angles_and_rates_named(placed, slope, values)
        gaps = [limit.distance(placed, angles, slope) for limit in modes.limits]
        closing = [limit.gap.of(rates) for limit in modes.limits]
        if named is None:
            stay = [
                (numpy.abs(gap) <= AT_LIMIT) & (numpy.abs(rate) <= AT_LIMIT)
                for gap, rate in zip(gaps, closing, strict=True)
            ]
        else:
            stay = [numpy.full(numpy.shape(gap), i in named) for i, gap in enumerate(gaps)]
        like = values[names[0]]
        heights = [_height(numpy, placed, k, angles, rates) for k in standing]
        stands = _standing(modes, standing, heights, placed.height, like)
        mode = Mode(stands, tuple(stay), tuple(0.0 * like > 1.0 for _ in modes.locks))
        return (modes.encoded(numpy, mode, like), *gaps, *closing)

    number: Scalar
    number, *parts = by_numpy(found, as_float(slope), *state.values(), *leaves)
    gaps, closing = parts[: len(modes.limits)], parts[len(modes.limits) :]
    for i, (limit, gap, rate) in enumerate(zip(modes.limits, gaps, closing, strict=True)):
        if holds_somewhere(gap < -AT_LIMIT):
            raise ArgumentError(
                f"the state passes the stop {limit.name!r} by {-gap} rad, which is not allowed: "
                "it may come up to its limit."
            )
        off = (abs(gap) > AT_LIMIT) | (abs(rate) > AT_LIMIT)
        if named is not None and i in named and holds_somewhere(off):
            raise ArgumentError(
                f"held = {limit.name!r} is not allowed: the stop is {gap} rad off its limit and "
                f"moves at {rate} rad/s, where it must be at rest there."
            )
    return number


def check_mode(mechanism: Mechanism, modes: Modes, slope: Parameter, state: Any) -> None:
    """Refuses a state that passes a stop, or whose mode holds one that it is off or moves on.

    Such states come from `_replace`, not from a scene's `state`. Less than a walk's own error is
    allowed, so that a walk may go on from where another ended.

    Raises:
        ArgumentError: such a state, where it is known.
    """
    given = (mechanism, slope, state)
    if is_traced(given):
        holds_somewhere(_is_misheld(modes, *given))
        return
    leaves, tree = jtu.tree_flatten(given)

    def found(numpy: Any, *leaves: Any) -> list[tuple[Any, Any, Any]]:
        return _misheld(numpy, modes, *jtu.tree_unflatten(tree, leaves))

    for limit, (wrong, gap, rate) in zip(modes.limits, by_numpy(found, *leaves), strict=True):
        if wrong.any():
            raise ArgumentError(
                f"state.mode = {state.mode} is not allowed: the stop {limit.name!r} is {gap} rad "
                f"off its limit and moves at {rate} rad/s, so that it is passed or cannot be held; "
                "make the state with scene.state(...)."
            )


@cached_jit  # many small operations
def _is_misheld(modes: Modes, mechanism: Mechanism, slope: Scalar, state: Any) -> Scalar:
    found = _misheld(jnp, modes, mechanism, slope, state)
    return functools.reduce(operator.or_, (wrong for wrong, _, _ in found), jnp.asarray(False))


def _misheld(
    numpy: Any, modes: Modes, mechanism: Mechanism, slope: Any, state: Any
) -> list[tuple[Any, Any, Any]]:
    """For each limit whether it is passed, or held but off or moving; its gap, and the rate."""
    motions, found = limit_motions(mechanism, modes, slope, state._asdict()), []
    for (gap, rate), stays in zip(motions, modes.decoded(numpy, state.mode).held, strict=True):
        off = stays & ((abs(gap) > _DRIFT) | (abs(rate) > _DRIFT))
        found.append((off | (gap < -_DRIFT), gap, rate))
    return found


def limit_motions(
    mechanism: Mechanism, modes: Modes, slope: Any, values: Mapping[str, Any]
) -> list[tuple[Any, Any]]:
    """How far each limit is [rad], and at what rate it goes away, by scalars of a state."""
    angles, rates = angles_and_rates_named(mechanism, slope, values)
    return [
        (limit.distance(mechanism, angles, slope), limit.gap.of(rates)) for limit in modes.limits
    ]


def _height(numpy: Any, mechanism: Mechanism, foot: int, angles: Any, rates: Any) -> Any:
    radius = mechanism.feet[foot].radius
    z, _, _ = foot_motion(numpy, mechanism, foot, angles, rates)
    return z - (0.0 if radius is None else radius)


def _standing(
    modes: Modes, feet: Indices, heights: list[Any], unit: Any, like: Any
) -> tuple[Any, ...]:
    yes, no = 0.0 * like == 0.0, 0.0 * like > 1.0
    for leg, own in modes.soles:
        if feet[0] in own:
            low = [yes if k in feet else no for k in own]
            if len(feet) > 1:
                (first, second), near = heights, _LEVEL * unit
                low = [first <= second + near, second <= first + near]
            return modes.standing(leg, low, like)
    return ()
