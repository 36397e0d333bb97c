"""Sections: surfaces at which an orbit is observed, once per cycle."""

import abc
import functools
from collections.abc import Callable
from typing import Any, ClassVar, cast

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._types import Scalar, any_of
from jaxbiped.dynamics._contacts import feet, legs_at, with_stance_leg_standing
from jaxbiped.dynamics._equivalent_states import exchange_legs
from jaxbiped.dynamics._footfalls import carrier_place, leg_depth, leg_places, touching_legs
from jaxbiped.dynamics._mode_changes import change_mode
from jaxbiped.dynamics._surfaces import lead, lean, opening
from jaxbiped.scene._scene import (
    AbstractScene,
    AbstractWalkerScene,
    CompliantScene,
    RigidScene,
    is_compliant,
    is_rigid,
)


class AbstractSection(eqx.Module):
    """A surface that the orbit crosses: a function of the state rises through zero.

    For a mirrored mechanism, it is evaluated with the names as they are and exchanged, so no
    arrival depends on which side is called the first.

    Attributes:
        alternates: whether each arrival is of another leg than the arrival before, and the first
            arrival of another leg than the one that stands alone at the start.
        names_legs: whether the mechanism's stance leg stands after an arrival, which determines the
            names of the legs.
        behind_reset: whether every solve ends a step where it is reached, and the state there is
            that behind a reset.
    """

    alternates: ClassVar[bool] = False
    names_legs: ClassVar[bool] = False
    behind_reset: ClassVar[bool] = False

    @abc.abstractmethod
    def value(self, args: PyTree, y: PyTree) -> Scalar:
        """The function that rises through zero, of the state just *after* the arrival."""

    @abc.abstractmethod
    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        """Whether a crossing there is an arrival (boolean)."""


class MidStance(AbstractSection):
    """Mid-stance: the root point passes over the feet of the stance leg, which carries the load.

    It passes over the mean of their places. The stance leg of a mirrored mechanism is that of the
    second body of its pairs; for any other mechanism, it is the last leg.

    Attributes:
        body: a body, such as "thigh_2", whose passage of the slope's normal on its way back counts
            instead; its leg carries the load, or the stance leg if the body has none.
    """

    names_legs: ClassVar[bool] = True
    body: str | None = eqx.field(static=True, default=None)

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        if self.body is not None:
            return -getattr(y, f"theta_{self.body}")
        if is_rigid(args):
            return -lean(args, y)
        return -legs_at(args, y)[args.mechanism.structure.stance_leg].x

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        if is_rigid(args):
            return jnp.asarray(True)
        structure = args.mechanism.structure
        legs = [structure.stance_leg]
        if self.body is not None:
            body = structure.bodies.index(self.body)
            own = range(len(structure.legs))
            legs = [i for i in own if body in structure.bodies_of_leg(i)] or legs
        touching = touching_legs(structure, feet(args, y))
        return any_of([touching[i] for i in legs])


class HeelStrike(AbstractSection):
    """Heel strike: the leg ahead comes down, and is then called the stance leg. A single leg just
    lands.
    """

    alternates: ClassVar[bool] = True
    names_legs: ClassVar[bool] = True

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        if is_rigid(args):
            return -opening(args, exchange_legs(args, y, -1))
        structure = args.mechanism.structure
        return leg_depth(structure, feet(args, y), structure.stance_leg)

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        if is_rigid(args):
            return lead(args, exchange_legs(args, y, -1)) > 0.0
        structure, found = args.mechanism.structure, feet(args, y)
        leg, places = structure.stance_leg, leg_places(structure, found)
        carrier = carrier_place(structure, found, places, leg)
        lands = touching_legs(structure, found)[leg]
        return lands if carrier is None else lands & (places[leg] > carrier)


class Section(AbstractSection):
    """A section given by any scalar function of the state, `function(args, state)`.

    Attributes:
        function: the function, which rises through zero at an arrival.
        condition: `condition(args, state)`, whether a crossing counts; None if every crossing
            counts.
    """

    function: Callable[[PyTree, PyTree], Scalar] = eqx.field(static=True)
    condition: Callable[[PyTree, PyTree], Scalar] | None = eqx.field(static=True, default=None)

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        return self.function(args, y)

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        if self.condition is None:
            return jnp.asarray(True)
        return self.condition(args, y)


def check_section_body(scene: AbstractWalkerScene, section: AbstractSection | None) -> None:
    """Raises `ArgumentError` for a passage of a body that is not among those of the state."""
    if isinstance(section, MidStance) and section.body is not None:
        structure = scene.mechanism.structure
        check_choice("section.body", section.body, [structure.bodies[j] for j in structure.free])


@functools.singledispatch
def section_of(scene: Any, section: AbstractSection | None) -> AbstractSection:
    """The requested section. Default: the section at which a scene's cycles begin.

    Raises:
        ArgumentError: this is not a section, its body is not in the state, or a rigid walker has a
            section other than heel strike.
    """
    if section is not None and not isinstance(section, AbstractSection):
        raise ArgumentError(
            f"section = {section!r} is not allowed: give MidStance(), HeelStrike() or a Section."
        )
    if is_compliant(scene):
        check_section_body(scene, section)
    if not is_rigid(scene):
        return _default_section(scene) if section is None else section
    if section is not None and not isinstance(section, HeelStrike):
        raise ArgumentError(
            f"section = {section!r} is not allowed for a RigidScene: its cycles begin just after "
            "the impact, at HeelStrike()."
        )
    return HeelStrike()


@functools.singledispatch
def chosen_section(scene: Any, section: AbstractSection | None) -> AbstractSection:
    """The section that a scene leaves to be chosen, checked; a walker's own, which it does not.

    Raises:
        ArgumentError: a section is given for a walker, or it is not allowed.
    """
    if section is not None:
        raise ArgumentError(
            f"section = {section!r} is not allowed for a {type(scene).__name__}: walkers are "
            "compared at their own section; leave it out."
        )
    return section_of(scene, None)


def _default_section(scene: Any) -> AbstractSection:
    """Mid-stance; of a single leg, which may hop, its landing."""
    is_walker = isinstance(scene, AbstractWalkerScene)
    return HeelStrike() if is_walker and len(scene.mechanism.structure.legs) == 1 else MidStance()


def with_leg_names_of(section: AbstractSection, scene: AbstractScene, state: PyTree) -> PyTree:
    """The same motion with the legs' names as the section has them; on rigid feet in its mode."""
    if is_rigid(scene) and hasattr(state, "mode"):
        return change_mode(cast("RigidScene", scene), state)
    if is_rigid(scene) or not section.names_legs:
        return state
    return with_stance_leg_standing(cast("CompliantScene", scene), state)
