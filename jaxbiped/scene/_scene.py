"""Scenes: all that is modelled, with laws of contact, rigid feet or redundant coordinates."""

import dataclasses
from collections.abc import Sequence
from operator import attrgetter
from typing import Any, ClassVar, Self, TypeAlias

import equinox as eqx

from jaxbiped._checks import ArgumentError, check_choice, check_type
from jaxbiped._types import Parameter
from jaxbiped.constraints._constraint_method import AbstractConstraintMethod
from jaxbiped.constraints._constraint_methods import Index1, method_named
from jaxbiped.constraints._linkage import ORIENTATIONS, Linkage
from jaxbiped.scene._abstract_scene import AbstractMinimalScene, AbstractWalkerScene
from jaxbiped.scene._clearance import AbstractClearance, AlwaysTouching, OneFoot
from jaxbiped.scene._ground import Ground
from jaxbiped.scene._joint_parts import Stop
from jaxbiped.scene._linkages import check_loaded_bodies, walker_linkage
from jaxbiped.scene._modes import limits_named
from jaxbiped.scene._placement import placement
from jaxbiped.scene._rigid_feet import check_rolls, check_stands, rigid_modes
from jaxbiped.scene._starting_mode import starting_mode
from jaxbiped.scene._state_types import state_type_of
from jaxbiped.scene.actuation._abstract_actuator import (
    AbstractActuator,
    Actuation,
    actuation_of,
    check_actuation,
    check_no_hip,
)
from jaxbiped.scene.laws._abstract_laws import (
    AbstractBristleLaw,
    AbstractFrictionLaw,
    AbstractNormalLaw,
)


class Scene(AbstractMinimalScene):
    """A walker on a slope, with its laws of contact.

    A frozen pytree whose numeric leaves are the parameters: differentiate or `vmap` with respect
    to any of them by replacing it, for example
    `equinox.tree_at(lambda s: s.normal.K, scene, jnp.asarray(2e6))`.

    Attributes:
        walker: a `Mechanism`, or a module that makes one by a method `mechanism()`, as `Walker`.
        ground: slope and gravity.
        normal: law of the normal force.
        friction: law of the tangential force; with bristles, states have bristles, too.
        clearance: which foot may touch. None for the walker's own rule, `walker.clearance`: that of
            `Walker` is `StanceRotation()`; `AlwaysTouching()` where it has none.
        actuation: what drives it beside gravity, a part of `jaxbiped.actuation` or several; None
            for a passive walker, whose equations have nothing of it.

    Raises:
        ArgumentError: a part of the wrong type, a stop without a law, a leg that the walker does
            not have, an actuator of rigid feet, or one at the hip of a walker without a mirror.
    """

    compliant: ClassVar[bool] = True
    walker: Any
    ground: Ground
    normal: AbstractNormalLaw
    friction: AbstractFrictionLaw | AbstractBristleLaw
    clearance: AbstractClearance
    actuation: Actuation

    def __init__(
        self,
        walker: Any,
        ground: Ground,
        normal: AbstractNormalLaw,
        friction: AbstractFrictionLaw | AbstractBristleLaw,
        clearance: AbstractClearance | None = None,
        actuation: AbstractActuator | Sequence[AbstractActuator] | None = None,
    ) -> None:
        if clearance is None:
            clearance = getattr(walker, "clearance", None) or AlwaysTouching()
        self.walker, self.ground = walker, ground
        self.normal, self.friction = normal, friction
        self.clearance, self.actuation = clearance, actuation_of(actuation)

    def __check_init__(self) -> None:
        check_type("ground", self.ground, Ground)
        check_type("normal", self.normal, AbstractNormalLaw)
        check_type("friction", self.friction, AbstractFrictionLaw, AbstractBristleLaw)
        check_type("clearance", self.clearance, AbstractClearance)
        check_actuation(self.actuation, "compliant")
        mechanism = self.mechanism
        if isinstance(self.clearance, OneFoot):
            check_choice("clearance.leg", self.clearance.leg, mechanism.structure.legs)
        if not mechanism.structure.pairs:
            check_no_hip(self.actuation)
        for part in mechanism.joints:
            if isinstance(part, Stop) and part.law is None:
                raise ArgumentError(
                    f"Stop({part.angle!r}) has no law, which a scene with laws of contact needs: "
                    "give law=, such as jb.laws.HuntCrossley(K=300.0, hysteresis=0.5, n=1.0)."
                )

    def state(self, *, standing: str | Sequence[str] | None = None, **values: Parameter) -> Any:
        """A state of the walker by the names of its scalars; see `Mechanism` for these.

        Args:
            standing: a leg, a body or a foot "BODY.FOOT" that stands, or several of these: the
                lowest of their feet just touches the ground and rolls. None for the lowest of all
                feet, and a root point at rest.
            **values: angles [rad], rates [rad/s], place [m] and velocity [m/s] of the root point
                and bristles [–], as `theta_BODY`, `omega_BODY`, `ROOT_z`: numbers, or arrays that
                broadcast to one shape. What is not named is 0, but for the height of the root
                point, and its velocity where a foot stands.

        Returns:
            A state of the scene's kind, all leaves of one shape.

        Raises:
            ArgumentError: a name that the state does not have, a foot that does not exist, or a
                value that is not finite.
        """
        names = self.state_names
        placed = placement(self.mechanism, self.ground.slope, values, standing, names)
        return state_type_of(names)(**placed)

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the scalars of a state."""
        structure = self.mechanism.structure
        bristles = structure.bristles if self.has_bristles else ()
        return (*structure.coordinates, *structure.rates, *bristles)


class RigidScene(AbstractMinimalScene):
    """A walker whose feet are rigid: they roll without slip and strike without rebound.

    Single support is a smooth motion; a footstep ends by a plastic impact at which the
    feet exchange support at once, and a swing foot that passes through the ground does not touch
    it. Nothing is stiff, so a footstep costs a small part of one with compliant feet. Whether a
    real foot would have slipped, flown or scuffed is told by `rigid_checks`.

    Stops are plastic: an angle that reaches a limit stays there until it would have to be pulled,
    or as long as the stop locks it. A leg with two feet on one body stands on either or on both.
    What stands and what is held is the state's `mode`.

    Attributes:
        walker: a `Mechanism` with a mirror or a turn, or a module that makes one by a method
            `mechanism()`, as `Walker`. Each side has one leg, and the second of each pair stands.
        ground: slope and gravity.
        actuation: what drives it beside gravity, a part of `jaxbiped.actuation` or several; None
            for a passive walker, whose equations have nothing of it.

    Raises:
        ArgumentError: a part of the wrong type, an actuator of compliant feet, or a walker without
            a mirror or with other legs.
    """

    compliant: ClassVar[bool] = False
    walker: Any
    ground: Ground
    actuation: Actuation = eqx.field(converter=actuation_of, default=None)

    def __check_init__(self) -> None:
        check_type("ground", self.ground, Ground)
        check_actuation(self.actuation, "rigid")
        check_rolls(self.mechanism)

    def state(
        self,
        *,
        standing: str | Sequence[str] | None = None,
        held: str | Sequence[str] | None = None,
        **values: Parameter,
    ) -> Any:
        """A state of the walker by the names of its scalars.

        Args:
            standing: which feet stand, as in `Scene.state`: of the second of each pair, or without
                a mirror of one leg, the last one unless told. The lowest of them stands, or both.
            held: the stops that are held, by their bodies or their own names, "NAME.upper" and
                "NAME.lower" where they have both limits; `()` for none. None for those that rest at
                a limit: one that moves into it hits it as the motion begins.
            **values: angles [rad] and rates [rad/s] of bodies and place of the root point [m], as
                `theta_BODY`, `omega_BODY`, `ROOT_x`: numbers, or arrays that broadcast to one
                shape. What is not named is 0.

        Returns:
            A state of the scene's kind, all leaves of one shape. Its `mode` is a whole number,
            where more than one mode can occur.

        Raises:
            ArgumentError: a name that the state does not have, a foot that does not exist or that
                swings, a value that is not finite, a stop that is passed, or one that is held off
                its limit.
        """
        mechanism, slope = self.mechanism, self.ground.slope
        feet = check_stands(mechanism.structure, standing)
        modes, names = rigid_modes(mechanism), self.state_names
        if not modes.any:
            limits_named(modes, held or ())
            placed = placement(mechanism, slope, values, standing, names)
            return state_type_of(names)(**placed)
        placed = placement(mechanism, slope, values, standing, names[:-1])
        mode = starting_mode(mechanism, modes, slope, placed, feet, held)
        return state_type_of(names)(**placed, mode=mode)

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the scalars of a state: place, angles, their rates, and a mode of several."""
        structure = self.mechanism.structure
        names = (structure.coordinates[0], *structure.coordinates[2:], *structure.rates[2:])
        return (*names, "mode") if rigid_modes(self.mechanism).any else names


def _of_scene(words: str, name: str = "") -> Any:
    """A part of the scene that a redundant one writes down."""
    return property(attrgetter(f"scene.{name or words}"), doc=f"The scene's {words}.")


class RedundantScene(AbstractWalkerScene):
    """A walker whose bodies have coordinates of their own, held together by a constraint method.

    What is modelled is the `Scene`; how it is written down differs. Goes wherever a `Scene` does.
    States have the place of each body's mass centre and its angle, or its Euler parameters:
    `x_BODY`, `z_BODY`, `theta_BODY` or `cos_half_BODY` and `sin_half_BODY`; then their rates,
    `vx_BODY`, `vz_BODY`, `omega_BODY` or `cos_rate_BODY` and `sin_rate_BODY`; then bristles. For
    `Walker` their type is `RedundantState` or `EulerState`. A state in minimal coordinates is made
    one where it is given. The mass of the root point is shared equally between the bodies that
    hang on it, whose mass centres have it in them.

    Source: the seed paper, section 4.

    Attributes:
        scene: what is modelled.
        method: how hinges and couplings are held, one of `CONSTRAINT_METHODS` by its name or an
            object.
        orientation: how bodies' orientations are written, one of `ORIENTATIONS`.

    Raises:
        ArgumentError: a part of the wrong type, an unknown name, or a body without mass or inertia.
    """

    compliant: ClassVar[bool] = True
    redundant: ClassVar[bool] = True
    scene: Scene
    method: AbstractConstraintMethod = eqx.field(converter=method_named, default_factory=Index1)
    orientation: str = eqx.field(static=True, default="angle")

    def __check_init__(self) -> None:
        check_type("scene", self.scene, Scene)
        check_choice("orientation", self.orientation, ORIENTATIONS)
        check_loaded_bodies(self.mechanism)

    @property
    def minimal(self) -> Scene:
        return self.scene

    def with_minimal(self, minimal: Scene) -> Self:
        return dataclasses.replace(self, scene=minimal)

    walker = _of_scene("walker")
    ground = _of_scene("ground")
    normal = _of_scene("law of the normal force", "normal")
    friction = _of_scene("law of friction", "friction")
    clearance = _of_scene("rule of clearance", "clearance")
    actuation = _of_scene("actuators", "actuation")

    @property
    def linkage(self) -> Linkage:
        """The bodies, hinges and couplings as a linkage."""
        return walker_linkage(self.walker, self.orientation, self.ground.slope)


CompliantScene: TypeAlias = Scene | RedundantScene
"""A walker with laws of contact, in minimal or redundant coordinates."""
