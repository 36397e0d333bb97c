"""Bodies and feet of a mechanism, and the points of a body at which they are fixed."""

import dataclasses
import re
from typing import Any, ClassVar, TypeAlias

import equinox as eqx

from jaxbiped._checks import ArgumentError
from jaxbiped._parameter_declaration import AbstractPart, parameter
from jaxbiped._types import Parameter

_NAME = re.compile(r"[A-Za-z0-9_]+")
RESERVED = ("normal", "vertical")
"""Names that take a reaction and move nothing: the slope's normal and the vertical."""


class Point(AbstractPart):
    """A point of a body, in the body's own frame, whose origin is the body's hinge.

    At an angle θ of the body the first axis is (sin θ, −cos θ), down the hanging body, and the
    second is (cos θ, sin θ), ahead of it. In MuJoCo's words `pos="px 0 pz"` is (−pz, px).

    Attributes (leaves of any batch shape):
        along: down the body [m].
        ahead: ahead of it [m]; None for 0, which is then not in the program at all.
    """

    along: Parameter = parameter("along the body", "", "m")
    ahead: Parameter | None = parameter("ahead of the body", "", "m", default=None)


class OwnHinge(eqx.Module):
    """The point of a body at its own hinge, which is no parameter."""

    along: ClassVar[float] = 0.0
    ahead: ClassVar[None] = None


Place: TypeAlias = Any
"""A `Point`, which users also write as one number or as a pair."""


def point_of(place: Any) -> Any:
    """A point from one number, down the body, or from a pair (along, ahead)."""
    if place is None or isinstance(place, Point | OwnHinge):
        return place
    if isinstance(place, tuple | list):
        if len(place) != 2:
            raise ArgumentError(
                f"a point = {place!r} is not allowed: give one number, down the body, or a pair "
                "(along, ahead)."
            )
        return Point(*place)
    return Point(place)


def check_centre(centre: object, words: str) -> None:
    """Raises `ArgumentError` where a piece has no centre."""
    if centre is None:
        raise ArgumentError(
            f"centre = None is not allowed for {words}: give one number, down the body, or a pair "
            "(along, ahead)."
        )


def check_name(argument: str, name: object) -> None:
    """Raises `ArgumentError` unless a name is made of letters, digits and underscores."""
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise ArgumentError(
            f"{argument} = {name!r} is not allowed: it must be made of letters, digits and "
            "underscores."
        )
    if name in RESERVED:
        raise ArgumentError(
            f"{argument} = {name!r} is not allowed: the name stands for a direction that takes a "
            "reaction."
        )


class Body(AbstractPart):
    """A rigid body that hangs by a hinge on another body, or on the root point.

    Its angle θ is absolute, measured from the slope's normal. It is 0 if the body hangs straight
    down; the angle of a leg is positive if its foot is ahead (downhill). A torso stands above its
    hinge, so its centre is negative, and its angle is positive if it leans back.

    Attributes:
        name: letters, digits and underscores; in states, its angle is `theta_NAME`.
        mass: mass of the body [kg].
        inertia: moment of inertia about its mass centre [kg·m²].
        centre: mass centre in the body's frame: one number, the distance down the body, or a pair
            (along, ahead) [m]; stored as a `Point`.
        parent: name of the body that it hangs on; None for the root point.
        at: place of its hinge in the parent's frame, in the same form [m]; None for the parent's
            own hinge.

    Raises:
        ArgumentError: the name has other characters, a mass or an inertia is below 0, or `at` is
            given without a parent.
    """

    name: str = eqx.field(static=True)
    _: dataclasses.KW_ONLY
    mass: Parameter = parameter("mass", "$m$", "kg", minimum=0.0)
    inertia: Parameter = parameter("moment of inertia", "$J$", "kg m^2", minimum=0.0)
    centre: Place = eqx.field(converter=point_of)
    parent: str | None = eqx.field(static=True, default=None)
    at: Place | None = eqx.field(converter=point_of, default=None)

    def __check_init__(self) -> None:
        check_name("name", self.name)
        check_centre(self.centre, f"Body({self.name!r})")
        if self.at is not None and self.parent is None:
            raise ArgumentError(
                f"at is not allowed for Body({self.name!r}), which has no parent: bodies without "
                "one all turn about the root point; give parent or leave at out."
            )


class Foot(AbstractPart):
    """A circular foot of a body, or a point foot.

    Attributes:
        body: name of the body that it is part of.
        centre: centre of its circle in the body's frame: one number, the distance down the body, or
            a pair (along, ahead) [m]. The sole lies `centre + radius` down the body.
        radius: radius of the circle [m]; None for a point.
        name: name of the foot. Default: "foot", or "foot_1", "foot_2" in order if the body has
            several.
        leg: name of the leg that it belongs to. By default, all feet of a body form one leg with
            the body's name.

    Raises:
        ArgumentError: the name has other characters, or the radius is below 0.
    """

    body: str = eqx.field(static=True)
    _: dataclasses.KW_ONLY
    centre: Place = eqx.field(converter=point_of)
    radius: Parameter | None = parameter("foot radius", "$r$", "m", minimum=0.0, default=None)
    name: str | None = eqx.field(static=True, default=None)
    leg: str | None = eqx.field(static=True, default=None)

    def __check_init__(self) -> None:
        for argument in ("name", "leg"):
            if getattr(self, argument) is not None:
                check_name(argument, getattr(self, argument))
        check_centre(self.centre, f"Foot({self.body!r})")
