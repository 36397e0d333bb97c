"""Structure of a mechanism: all of it that is known before anything runs, and no number of it."""

import dataclasses
import functools
import re
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

Indices: TypeAlias = tuple[int, ...]


def weighted(value: Any, weight: Any) -> Any:
    """A value times a weight; ones that are known cost nothing."""
    if isinstance(weight, int | float) and abs(weight) == 1.0:
        return value if weight == 1.0 else -value
    return weight * value


class Angle(NamedTuple):
    """An angle of a mechanism as a sum.

    Attributes:
        weights: of bodies' absolute angles, by the bodies' numbers, in the order written.
        vertical: weight of the slope, which is the angle of the vertical.
    """

    weights: tuple[tuple[int, float], ...]
    vertical: float = 0.0

    def of(self, values: Sequence[Any], vertical: Any = None) -> Any:
        """The sum of values by body; for rates there is no `vertical`. None for one of no terms."""
        terms = [weighted(values[body], weight) for body, weight in self.weights]
        if self.vertical and vertical is not None:
            terms.append(weighted(vertical, self.vertical))
        return sum(terms[1:], terms[0]) if terms else None

    def mirrored(self, twin: Indices) -> "Angle":
        """The same of the mirror image."""
        return Angle(tuple((twin[i], weight) for i, weight in self.weights), self.vertical)

    def reversed(self) -> "Angle":
        """The same angle counted the other way."""
        return Angle(tuple((i, -weight) for i, weight in self.weights), -self.vertical)

    def is_like(self, other: "Angle") -> bool:
        """Whether both are the same sum, in whatever order it was written."""
        return dict(self.weights) == dict(other.weights) and self.vertical == other.vertical


class Fixed(NamedTuple):
    """The angle of a body that couplings fix: a sum of the others'.

    Attributes:
        body: its number.
        angle: of the bodies that stay free, and of the slope.
        rests: weights of the couplings' rest angles, by their numbers among the joint parts.
    """

    body: int
    angle: Angle
    rests: tuple[tuple[int, float], ...]


class Turn(NamedTuple):
    """A rotational symmetry of a body and its feet.

    Attributes:
        body: its number.
        order: of the symmetry, the number of places in a whole turn.
        firsts: number of the foot at the first place that each foot is an image of, by turning.
        places: how many places each foot lies from that one.
    """

    body: int
    order: int
    firsts: Indices
    places: Indices


@dataclasses.dataclass(frozen=True)
class Structure:
    """A tree of bodies with feet and joint parts.

    Attributes:
        root: name of the root point.
        bodies: names, parents before children.
        parents: number of each body's parent, −1 for the root point.
        feet: number of each foot's body.
        foot_names: of each foot, unique on its body.
        legs: names of the legs, in the order of their first feet.
        leg_of_foot: number of each foot's leg.
        joints: the angle of each joint part.
        joint_names: as they were given.
        fixed: bodies whose angles follow from couplings.
        body_twins, foot_twins, joint_twins: number of each one's mirror image, itself where it is
            its own; None for a mechanism without a mirror.
        body_pieces, foot_pieces, joint_pieces: number of the piece that holds each one's
            parameters, which mirror images share, and what a turn takes to each other.
        turn: a rotational symmetry, None without one.
        pairs: paired bodies, first the one that swings where a cycle begins, then the one that
            stands: those of the mirror. A mechanism whose mirror was dropped when one side got
            parameters of its own keeps them, for the roles of its motors.
    """

    root: str
    bodies: tuple[str, ...]
    parents: Indices
    feet: Indices
    foot_names: tuple[str, ...]
    legs: tuple[str, ...]
    leg_of_foot: Indices
    joints: tuple[Angle, ...]
    joint_names: tuple[str | None, ...]
    fixed: tuple[Fixed, ...]
    body_twins: Indices | None
    foot_twins: Indices | None
    joint_twins: Indices | None
    body_pieces: Indices
    foot_pieces: Indices
    joint_pieces: Indices
    turn: Turn | None = None
    pairs: tuple[tuple[int, int], ...] = ()

    @functools.cached_property
    def children(self) -> tuple[Indices, ...]:
        """Of each body; the last entry has those of the root point."""
        n = len(self.bodies)
        return tuple(tuple(k for k in range(n) if self.parents[k] == j) for j in (*range(n), -1))

    @functools.cached_property
    def chains(self) -> tuple[Indices, ...]:
        """The bodies from the root point down to each one, itself included."""
        return tuple(self._chain(j) for j in range(len(self.bodies)))

    def _chain(self, body: int) -> Indices:
        parent = self.parents[body]
        return (body,) if parent < 0 else (*self._chain(parent), body)

    @functools.cached_property
    def outwards(self) -> Indices:
        """All bodies, parents before children."""
        return tuple(sorted(range(len(self.bodies)), key=lambda j: len(self.chains[j])))

    @functools.cached_property
    def free(self) -> Indices:
        """The bodies whose angles no coupling fixes."""
        fixed = {each.body for each in self.fixed}
        return tuple(j for j in range(len(self.bodies)) if j not in fixed)

    @functools.cached_property
    def feet_of_leg(self) -> tuple[Indices, ...]:
        """Numbers of each leg's feet."""
        return tuple(
            tuple(k for k, leg in enumerate(self.leg_of_foot) if leg == i)
            for i in range(len(self.legs))
        )

    @functools.cached_property
    def leg_twins(self) -> Indices | None:
        """Number of each leg's mirror image; None without a mirror."""
        twins = self.foot_twins
        if twins is None:
            return None
        return tuple(self.leg_of_foot[twins[feet[0]]] for feet in self.feet_of_leg)

    def legs_renamed(self, times: int) -> Indices:
        """The number that each leg has after the names were exchanged so often."""
        count = len(self.legs)
        if self.turn is not None:
            return tuple((i - times) % count for i in range(count))
        twins = self.leg_twins
        return tuple(range(count)) if twins is None or times % 2 == 0 else twins

    def feet_renamed(self, times: int) -> Indices:
        """The number that each foot has after the names were exchanged so often."""
        if self.turn is not None:
            legs, own = self.legs_renamed(times), self.feet_of_leg
            return tuple(own[legs[i]][own[i].index(k)] for k, i in enumerate(self.leg_of_foot))
        twins = self.foot_twins
        return tuple(range(len(self.feet))) if twins is None or times % 2 == 0 else twins

    @functools.cached_property
    def namings(self) -> Indices:
        """Legs that are the stance leg after so many exchanges of names: after none it is itself.

        Its mirror image is after one; where a turn makes all legs alike, each of them in turn.
        """
        count = 1 if self.leg_twins is None else 2
        every = range(count if self.turn is None else len(self.legs))
        return tuple(self.legs_renamed(k).index(self.stance_leg) for k in every)

    @functools.cached_property
    def stance_leg(self) -> int:
        """Number of the leg that stands where a cycle begins: of a pair the second, or the last."""
        standing = {body for _, body in self.pairs}
        found = [i for i in range(len(self.legs)) if standing & self.bodies_of_leg(i)]
        return found[-1] if found else len(self.legs) - 1

    @property
    def swing_leg(self) -> int:
        """Number of the leg that stands after the next exchange of names; else the stance leg."""
        return self.namings[1 % len(self.namings)]

    @property
    def roles(self) -> tuple[int, int]:
        """Numbers of the bodies on the root point that swing and stand where a cycle begins.

        Those of the first pair; without one the first bodies of two legs, the stance leg's last.
        """
        if self.pairs:
            return self.pairs[0]
        first = [self.chains[self.feet[feet[0]]][0] for feet in self.feet_of_leg]
        return first[self.stance_leg - 1], first[self.stance_leg]

    @property
    def cycle_footsteps(self) -> int:
        """Footsteps in a cycle: of a mirrored mechanism half of the legs', of another all.

        One where a turn makes all of them alike.
        """
        if self.turn is not None:
            return 1
        count = len(self.legs)
        return count if self.leg_twins is None else max(count // 2, 1)

    def bodies_of_leg(self, leg: int) -> set[int]:
        """The bodies from the root point down to a leg's feet."""
        return {body for k in self.feet_of_leg[leg] for body in self.chains[self.feet[k]]}

    def leg_of_body(self, body: int) -> int | None:
        """Number of the leg that a body is a part of; None where it is one of several or none.

        A body with a turn is one with the leg of it that stands.
        """
        if self.turn is not None and body == self.turn.body:
            return self.stance_leg
        found = [i for i in range(len(self.legs)) if body in self.bodies_of_leg(i)]
        return found[0] if len(found) == 1 else None

    @property
    def feet_told(self) -> tuple[str, ...]:
        """Names of the feet: their bodies', with the foot's own where a body has several."""
        return self._feet_named(".")

    @property
    def bristles(self) -> tuple[str, ...]:
        """Names of each foot's bristles in states: the foot's own only where a body has several."""
        return tuple(f"bristle_{name}" for name in self._feet_named("_"))

    def _feet_named(self, separator: str) -> tuple[str, ...]:
        return tuple(
            self.bodies[j] + (separator + name if self.feet.count(j) > 1 else "")
            for j, name in zip(self.feet, self.foot_names, strict=True)
        )

    def changes_sign(self, joint: int) -> bool:
        """Whether the angle of a joint part is its own mirror image, counted the other way."""
        if self.body_twins is None or self.joint_twins is None or self.joint_twins[joint] != joint:
            return False
        angle = self.joints[joint]
        image = angle.mirrored(self.body_twins)
        return image.is_like(angle.reversed()) and not image.is_like(angle)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of places and angles in states."""
        return self._scalars("x", "z", "theta")

    @property
    def rates(self) -> tuple[str, ...]:
        """Names of their rates, in the same order."""
        return self._scalars("vx", "vz", "omega")

    @property
    def accelerations(self) -> tuple[str, ...]:
        """Names of the rates of these."""
        return self._scalars("ax", "az", "alpha")

    def _scalars(self, x: str, z: str, turning: str) -> tuple[str, ...]:
        angles = (f"{turning}_{self.bodies[j]}" for j in self.free)
        return (f"{self.root}_{x}", f"{self.root}_{z}", *angles)


def pair_name(first: str, second: str) -> str:
    """What a mirrored pair is called in names of parameters: what both names share.

    Examples:
        >>> pair_name("left_thigh", "right_thigh"), pair_name("leg1", "leg2"), pair_name("1", "2")
        ('thigh', 'leg', '1+2')
    """
    tokens = [re.findall(r"\d+|[^\d_]+", name) for name in (first, second)]
    shared = [token for token in tokens[0] if token in tokens[1]]
    return "_".join(shared) or f"{first}+{second}"
