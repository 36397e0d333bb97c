"""Structure of a mechanism: all of it that is known before anything runs, and no number of it."""

import dataclasses
import functools
import re
from typing import NamedTuple, TypeAlias

Indices: TypeAlias = tuple[int, ...]


class Angle(NamedTuple):
    """An angle of a mechanism as a sum.

    Attributes:
        weights: of bodies' absolute angles, by the bodies' numbers, in the order written.
        vertical: weight of the slope, which is the angle of the vertical.
    """

    weights: tuple[tuple[int, float], ...]
    vertical: float = 0.0

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
        fixed: bodies whose angles follow from couplings.
        body_twins, foot_twins, joint_twins: number of each one's mirror image, itself where it is
            its own; None for a mechanism without a mirror.
        body_pieces, foot_pieces, joint_pieces: number of the piece that holds each one's
            parameters, which mirror images share.
        turn: body and count of a rotational symmetry, None without one.
    """

    root: str
    bodies: tuple[str, ...]
    parents: Indices
    feet: Indices
    foot_names: tuple[str, ...]
    legs: tuple[str, ...]
    leg_of_foot: Indices
    joints: tuple[Angle, ...]
    fixed: tuple[Fixed, ...]
    body_twins: Indices | None
    foot_twins: Indices | None
    joint_twins: Indices | None
    body_pieces: Indices
    foot_pieces: Indices
    joint_pieces: Indices
    turn: tuple[int, int] | None = None

    @functools.cached_property
    def children(self) -> tuple[Indices, ...]:
        """Of each body; the last entry has those of the root point."""
        n = len(self.bodies)
        return tuple(tuple(k for k in range(n) if self.parents[k] == j) for j in (*range(n), -1))

    @functools.cached_property
    def chains(self) -> tuple[Indices, ...]:
        """The bodies from the root point down to each one, itself included."""
        found: list[Indices] = []
        for j, parent in enumerate(self.parents):
            found.append((*(() if parent < 0 else found[parent]), j))
        return tuple(found)

    @functools.cached_property
    def free(self) -> Indices:
        """The bodies whose angles no coupling fixes."""
        fixed = {each.body for each in self.fixed}
        return tuple(j for j in range(len(self.bodies)) if j not in fixed)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of places and angles in states."""
        angles = (f"theta_{self.bodies[j]}" for j in self.free)
        return (f"{self.root}_x", f"{self.root}_z", *angles)

    @property
    def rates(self) -> tuple[str, ...]:
        """Names of their rates, in the same order."""
        rates = (f"omega_{self.bodies[j]}" for j in self.free)
        return (f"{self.root}_vx", f"{self.root}_vz", *rates)


def pair_name(first: str, second: str) -> str:
    """What a mirrored pair is called in names of parameters: what both names share.

    Examples:
        >>> pair_name("left_thigh", "right_thigh"), pair_name("leg1", "leg2"), pair_name("1", "2")
        ('thigh', 'leg', '1+2')
    """
    tokens = [re.findall(r"\d+|[^\d_]+", name) for name in (first, second)]
    shared = [token for token in tokens[0] if token in tokens[1]]
    return "_".join(shared) or f"{first}+{second}"
