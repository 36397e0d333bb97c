"""Scenes: all that is modelled, with laws of contact, rigid feet or redundant coordinates."""

import abc
import dataclasses
from collections.abc import Mapping, Sequence
from operator import attrgetter
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeAlias, TypeGuard

import equinox as eqx
import jax
from equinox import AbstractVar

from jaxbiped._checks import ArgumentError, check_choice, check_type
from jaxbiped._summary import in_short, notebook_html
from jaxbiped._types import Parameter
from jaxbiped.caching._caches import OfObjects, OncePerVersion
from jaxbiped.constraints._constraint_methods import Index1, method_named
from jaxbiped.constraints._linkage import ORIENTATIONS, Linkage
from jaxbiped.scene._clearance import AbstractClearance, AlwaysTouching, OneFoot
from jaxbiped.scene._ground import Ground, warn_if_steep
from jaxbiped.scene._joint_parts import Stop
from jaxbiped.scene._linkages import check_loaded_bodies, walker_linkage
from jaxbiped.scene._mechanism import Mechanism, mechanism_of
from jaxbiped.scene._modes import (
    check_rolls,
    check_stands,
    limits_named,
    rigid_modes,
    starting_mode,
)
from jaxbiped.scene._motor_motion import check_legs_alike, reads_time
from jaxbiped.scene._placement import placement
from jaxbiped.scene._state_types import CLOCK, STRIKE_LEG, state_type_of
from jaxbiped.scene.actuation._actuators import (
    AbstractActuator,
    Actuation,
    actuation_of,
    check_actuation,
)
from jaxbiped.scene.laws._abstract_laws import (
    AbstractBristleLaw,
    AbstractFrictionLaw,
    AbstractNormalLaw,
)

if TYPE_CHECKING:
    from typing import ClassVar as AbstractClassVar
else:
    from equinox import AbstractClassVar


class AbstractScene(eqx.Module):
    """What is modelled, and how it is written down; a frozen pytree of its parameters.

    Attributes:
        state_type: the type of its states, a NamedTuple of scalar leaves.
        time_unit: size of the times in which its motion changes [s]. A property of the class.
        endings: names of the endings of a hybrid system; None for a walker. A property of the
            class.
        compliant: whether feet sink into the ground and slip on it by laws of contact; else they
            roll and strike. A property of the class.
        stiff: whether its motion may be stiff, as that of feet that press into the ground: its
            steps are then implicit, and dear. A property of the class.
        redundant: whether constraints hold more coordinates together than there are degrees of
            freedom. A property of the class.
        model: the word for it in the settings of results. A property of the class.
        bristles: names of the states of friction, which are 0 where a start leaves them out.
        posture: names of the angles and rates from which the root point's place follows.
        coordinate_aliases: coordinates by other names that they have.
    """

    compliant: AbstractClassVar[bool]
    redundant: AbstractClassVar[bool]
    stiff: ClassVar[bool] = True
    model: ClassVar[str] = "hybrid system"
    bristles: ClassVar[tuple[str, ...]] = ()
    posture: ClassVar[tuple[str, ...]] = ()
    coordinate_aliases: ClassVar[Mapping[str, str]] = MappingProxyType({})
    time_unit: ClassVar[float] = 1.0
    endings: ClassVar[tuple[str, ...] | None] = None
    arrival_footsteps: ClassVar[int] = 1
    cycle_footsteps: ClassVar[int] = 1
    cycle: ClassVar[str] = "cycle"

    __repr__ = in_short
    _repr_html_ = notebook_html

    if TYPE_CHECKING:
        # A property of some scenes, of the class of others.
        @property
        def state_type(self) -> type[Any]: ...
    else:
        state_type: AbstractVar[type[Any]]

    @property
    @abc.abstractmethod
    def minimal(self) -> Any:
        """The same model in minimal coordinates, whose leaves are the parameters."""

    @abc.abstractmethod
    def with_minimal(self, minimal: Any) -> Self:
        """The scene of another model, held together as this one is."""


class AbstractMinimalScene(AbstractScene):
    """What is modelled in minimal coordinates."""

    redundant: ClassVar[bool] = False

    @property
    def minimal(self) -> Self:
        """The scene itself."""
        return self

    def with_minimal(self, minimal: Self) -> Self:
        """The other model itself."""
        return minimal


class AbstractWalkerScene(AbstractScene):
    """A walker on a slope, and how it is modelled.

    Attributes:
        walker: masses and lengths.
        ground: slope and gravity.
    """

    if TYPE_CHECKING:
        # A field of some scenes, a property of others.
        @property
        def walker(self) -> Any: ...
        @property
        def ground(self) -> Ground: ...
    else:
        walker: AbstractVar[Any]
        ground: AbstractVar[Ground]

    @property
    def mechanism(self) -> Mechanism:
        """The walker as bodies, feet and joint parts."""
        return mechanism_of(self.walker)

    @property
    def cycle(self) -> str:  # type: ignore[override]
        """What a cycle of it is: a "step" where a mirror exchanges its sides, else a "stride"."""
        return "stride" if len(self.mechanism.structure.namings) == 1 else "step"

    @property
    def cycle_footsteps(self) -> int:  # type: ignore[override]
        """Footsteps after which a cycle may close, at least."""
        return self.mechanism.structure.cycle_footsteps

    @property
    def arrival_footsteps(self) -> int:  # type: ignore[override]
        """Footsteps from one arrival at the section of a cycle to the next.

        Compliant feet strike by name: those of unlike legs arrive once a stride.
        """
        return self.cycle_footsteps if self.compliant else 1

    @property
    @abc.abstractmethod
    def state_names(self) -> tuple[str, ...]:
        """Names of the scalars of a state."""

    @property
    def state_type(self) -> type[Any]:
        """The type of its states."""
        return state_type_of(self.state_names)

    @property
    def clock(self) -> tuple[str, ...]:
        """Names of the time since the last strike, and on compliant feet of the leg that struck.

        There are none where no law reads the time.
        """
        _, once = _READ(self, lambda: OncePerVersion(jax.tree.structure(self)))()
        if not once(lambda: reads_time(self.mechanism, self.minimal.actuation)):
            return ()
        return (CLOCK, STRIKE_LEG) if self.compliant else (CLOCK,)

    @property
    def bristles(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the states of its friction."""
        return self.mechanism.structure.bristles if self.has_bristles else ()

    @property
    def posture(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the bodies' angles and rates."""
        structure = self.mechanism.structure
        return (*structure.coordinates[2:], *structure.rates[2:])

    @property
    def coordinate_aliases(self) -> Mapping[str, str]:  # type: ignore[override]
        """Coordinates of legs "1" and "2" by what the leg does where a cycle begins."""
        structure = self.mechanism.structure
        swing, stance = (structure.bodies[j] for j in structure.roles)
        legs = {"stance": stance, "swing": swing}
        if {swing, stance} != {"1", "2"}:
            return {}
        return {f"{kind}_{at}": f"{kind}_{legs[at]}" for kind in ("theta", "omega") for at in legs}

    @property
    def has_bristles(self) -> bool:
        """Whether the friction has states of its own."""
        return isinstance(getattr(self.minimal, "friction", None), AbstractBristleLaw)


_READ = OfObjects[OncePerVersion[bool]]()
"""Whether laws of scenes read the time."""


class Scene(AbstractMinimalScene, AbstractWalkerScene):
    """A walker on a slope, with its laws of contact.

    A frozen pytree whose numeric leaves are the parameters: differentiate or `vmap` with respect
    to any of them by replacing it, for example
    `equinox.tree_at(lambda s: s.normal.K, scene, jnp.asarray(2e6))`.

    Attributes:
        walker: a `Mechanism`, or a module with a method `mechanism()` that returns one, such as
            `Walker`.
        ground: slope and gravity.
        normal: normal law.
        friction: friction law; if it has bristles, states have bristles too.
        clearance: rule that decides which foot may touch. None: the walker's own rule,
            `walker.clearance` (`StanceRotation()` for `Walker`), or `AlwaysTouching()` if it has
            none.
        actuation: one actuator of `jaxbiped.actuation` or several; None for a passive walker, whose
            equations contain no actuation.

    Raises:
        ArgumentError: a part has the wrong type, a stop has no law, the walker does not have a leg,
            an actuator is for rigid feet, or one acts at the hip of a walker without a mirror.
    """

    compliant: ClassVar[bool] = True
    model: ClassVar[str] = "compliant"
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
        warn_if_steep(self.ground, self.friction)
        mechanism = self.mechanism
        check_actuation(self.actuation, "compliant", mirrored=bool(mechanism.structure.pairs))
        check_legs_alike(self.actuation)
        if isinstance(self.clearance, OneFoot):
            check_choice("clearance.leg", self.clearance.leg, mechanism.structure.legs)
        for part in mechanism.joints:
            if isinstance(part, Stop) and part.law is None:
                raise ArgumentError(
                    f"Stop({part.angle!r}) has no law, which a scene with laws of contact needs: "
                    "give law=, such as jb.laws.HuntCrossley(K=300.0, hysteresis=0.5, n=1.0)."
                )

    def state(self, *, standing: str | Sequence[str] | None = None, **values: Parameter) -> Any:
        """A state of the walker, from scalars by name; see `Mechanism` for the names.

        Args:
            standing: a leg, a body or a foot "BODY.FOOT" that stands, or several of these; the
                lowest of their feet just touches the ground and rolls. None: the lowest of all feet
                just touches the ground, and the root point is at rest.
            **values: angles [rad], rates [rad/s], place [m] and velocity [m/s] of the root point
                and bristles [–], named `theta_BODY`, `omega_BODY`, `ROOT_z`: numbers, or arrays
                that broadcast to one shape. Default: 0, except for the height of the root point,
                and for its velocity if `standing` is given.

        Returns:
            A state of the scene's kind, with all leaves of one shape.

        Raises:
            ArgumentError: the state does not have a name, a foot does not exist, or a value is not
                finite.
        """
        names = self.state_names
        placed = placement(self.mechanism, self.ground.slope, values, standing, names)
        return self.state_type(**placed)

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the scalars of a state."""
        structure = self.mechanism.structure
        return (*structure.coordinates, *structure.rates, *self.bristles, *self.clock)


class RigidScene(AbstractMinimalScene, AbstractWalkerScene):
    """A walker whose feet are rigid: they roll without slip and strike without rebound.

    Single support is a smooth motion. A footstep ends with a plastic impact, at which the feet
    exchange support at once; a swing foot that passes through the ground does not touch it. Nothing
    is stiff, so a footstep costs a small part of one with compliant feet. `rigid_checks` reports
    whether a real foot would have slipped, flown or scuffed.

    Stops are plastic: an angle that reaches a limit stays there until the stop would have to pull,
    or as long as the stop locks it. A leg with two feet on one body stands on either or on both.
    The state's `mode` records which feet stand and which stops are held.

    Attributes:
        walker: a `Mechanism`, or a module with a method `mechanism()` that returns one, such as
            `Walker`. With a mirror, each side has one leg, and the second of each pair stands.
        ground: slope and gravity.
        actuation: one actuator of `jaxbiped.actuation` or several; None for a passive walker, whose
            equations contain no actuation.

    Raises:
        ArgumentError: a part has the wrong type, an actuator is for compliant feet, or the walker
            has legs that are not supported on rigid feet.
    """

    compliant: ClassVar[bool] = False
    stiff: ClassVar[bool] = False
    model: ClassVar[str] = "rigid"
    walker: Any
    ground: Ground
    actuation: Actuation = eqx.field(converter=actuation_of, default=None)

    def __check_init__(self) -> None:
        check_type("ground", self.ground, Ground)
        mechanism = self.mechanism
        check_actuation(self.actuation, "rigid", mirrored=bool(mechanism.structure.pairs))
        check_legs_alike(self.actuation)
        check_rolls(mechanism)

    def state(
        self,
        *,
        standing: str | Sequence[str] | None = None,
        held: str | Sequence[str] | None = None,
        **values: Parameter,
    ) -> Any:
        """A state of the walker, from scalars by name.

        Args:
            standing: the feet that stand, named as in `Scene.state`: feet of the second body of
                each pair, or without a mirror of one leg. Default: the last leg. The lowest of them
                stands, or both.
            held: the stops that are held, by the names of their bodies or their own; "NAME.upper"
                or "NAME.lower" if a stop has both limits; `()` for none. None: those that rest at a
                limit. A stop whose angle moves into the limit is hit as the motion begins.
            **values: angles [rad] and rates [rad/s] of bodies and place of the root point [m],
                named `theta_BODY`, `omega_BODY`, `ROOT_x`: numbers, or arrays that broadcast to one
                shape. Default: 0.

        Returns:
            A state of the scene's kind, with all leaves of one shape. If more than one mode can
            occur, its `mode` is a whole number.

        Raises:
            ArgumentError: the state does not have a name, a foot does not exist or swings, a value
                is not finite, an angle is beyond its stop, or a stop is held away from its limit.
        """
        mechanism, slope = self.mechanism, self.ground.slope
        feet = check_stands(mechanism.structure, standing)
        modes, names = rigid_modes(mechanism), self.state_names
        if not modes.any:
            limits_named(modes, held or ())
            return self.state_type(**placement(mechanism, slope, values, standing, names))
        placed = placement(mechanism, slope, values, standing, names[:-1])
        mode = starting_mode(mechanism, modes, slope, placed, feet, held)
        return self.state_type(**placed, mode=mode)

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the scalars of a state: place, angles, their rates, the time since the last
        strike if a law reads it, and the mode if there are several.
        """
        structure = self.mechanism.structure
        names = (structure.coordinates[0], *structure.coordinates[2:], *structure.rates[2:])
        modes = ("mode",) if rigid_modes(self.mechanism).any else ()
        return (*names, *self.clock, *modes)


def _of_scene(words: str, name: str = "") -> Any:
    """A part of the scene that a redundant one writes down."""
    return property(attrgetter(f"scene.{name or words}"), doc=f"The scene's {words}.")


class RedundantScene(AbstractWalkerScene):
    """A walker whose bodies have coordinates of their own and are joined by a constraint method.

    It models the same as its `Scene`, in other coordinates, and is accepted in place of a `Scene`.
    A state has the place of each body's mass centre and its angle or Euler parameters: `x_BODY`,
    `z_BODY`, `theta_BODY`, or `cos_half_BODY` and `sin_half_BODY`. Their rates follow, `vx_BODY`,
    `vz_BODY`, `omega_BODY`, or `cos_rate_BODY` and `sin_rate_BODY`, and then bristles. For
    `Walker`, the type of states is `RedundantState` or `EulerState`. States in minimal coordinates
    are accepted and converted. The bodies that hang on the root point share its mass equally, and
    their mass centres include it.

    Source: the seed paper, section 4.

    Attributes:
        scene: the scene that is modelled.
        method: constraint method for hinges and couplings: a name of `CONSTRAINT_METHODS`, or an
            object.
        orientation: coordinates of the bodies' orientations, one of `ORIENTATIONS`.

    Raises:
        ArgumentError: a part has the wrong type, a name is unknown, or a body has no mass or
            inertia.
    """

    compliant: ClassVar[bool] = True
    redundant: ClassVar[bool] = True
    model: ClassVar[str] = "redundant"
    scene: Scene
    method: Any = eqx.field(converter=method_named, default_factory=Index1)
    orientation: str = eqx.field(static=True, default="angle")

    def __check_init__(self) -> None:
        check_type("scene", self.scene, Scene)
        check_choice("orientation", self.orientation, ORIENTATIONS)
        check_loaded_bodies(self.mechanism)
        if self.clock:
            raise ArgumentError(
                "scene has a law that reads motion.time, which is not allowed in redundant "
                "coordinates: take the Scene itself."
            )

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

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the scalars of a state: place and orientation of each body, then their rates."""
        euler = self.orientation == "euler"
        angle = ("cos_half", "sin_half") if euler else ("theta",)
        rate = ("cos_rate", "sin_rate") if euler else ("omega",)
        names = [
            f"{name}_{body}"
            for own in (("x", "z", *angle), ("vx", "vz", *rate))
            for body in self.mechanism.structure.bodies
            for name in own
        ]
        return (*names, *self.bristles)


CompliantScene: TypeAlias = Scene | RedundantScene
"""A walker with laws of contact, in minimal or redundant coordinates."""
WalkerScene: TypeAlias = Scene | RigidScene
"""A walker in minimal coordinates."""
WALKER_SCENES = (Scene, RigidScene)
"""Kinds of those."""


def is_walker(args: object) -> TypeGuard[AbstractWalkerScene]:
    """Whether the parameters of a system are a scene of a walker."""
    return isinstance(args, AbstractWalkerScene)


def is_compliant(args: object) -> bool:
    """Whether the parameters of a system are a scene with laws of contact."""
    return isinstance(args, AbstractWalkerScene) and args.compliant


def is_rigid(args: object) -> bool:
    """Whether the parameters of a system are a scene whose feet roll and strike."""
    return isinstance(args, AbstractWalkerScene) and not args.compliant
