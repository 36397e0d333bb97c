"""Hybrid systems: the vector field, switches, endings and reset map that a return map needs.

The walker is only one of them: solves and searches ask this interface, so a user's own system does.
"""

import abc
from typing import ClassVar, cast

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped._types import Scalar, Time
from jaxbiped.dynamics._contacts import foot_forces, with_leg_2_standing
from jaxbiped.dynamics._impact import impact
from jaxbiped.dynamics._minimal_motion import vector_field
from jaxbiped.dynamics._redundant_motion import redundant_field
from jaxbiped.dynamics._redundant_state import LegsState
from jaxbiped.dynamics._rolling import rolling, rolling_field
from jaxbiped.dynamics._section import AbstractSection, HeelStrike, MidStance
from jaxbiped.dynamics._state import RigidState, State, exchange_legs
from jaxbiped.dynamics._state_quantities import CYCLIC
from jaxbiped.dynamics._switches import Switch, switches
from jaxbiped.scene._scene import (
    AbstractScene,
    CompliantScene,
    RedundantScene,
    RigidScene,
    Scene,
    is_rigid,
)
from jaxbiped.solve._failure_events import WATCHES, ending_events, rigid_ending


class AbstractSystem(eqx.Module):
    """An autonomous system whose periodic orbits can be found and differentiated.

    The state is a pytree of scalars, and so are the parameters `args`. Subclass it to study a
    system of your own: the walker is only one of them, `Walking`. Numbers that are to be
    differentiated belong in `args`; a system that holds arrays itself is XLA's, forwards only.

    Attributes:
        cyclic_coordinates: positions of the leaves that need not return, only advance: no rate may
            depend on them.
    """

    cyclic_coordinates: ClassVar[tuple[int, ...]] = ()

    @abc.abstractmethod
    def vector_field(self, t: Time, y: PyTree, args: PyTree) -> PyTree:
        """Time derivative of the state, in the form that `diffrax.ODETerm` takes."""

    @abc.abstractmethod
    def switches(self, args: PyTree, y: PyTree) -> tuple[Switch, ...]:
        """Surfaces across which the vector field is not smooth."""

    @abc.abstractmethod
    def ending(self, args: PyTree, y: PyTree) -> Scalar:
        """Code of the `Ending` that has come, 0 where the motion goes on."""

    @abc.abstractmethod
    def reset_map(self, args: PyTree, y: PyTree) -> PyTree:
        """What is done to the state at each arrival: a symmetry, an impact, or nothing."""

    @abc.abstractmethod
    def load(self, args: PyTree, y: PyTree) -> Scalar | None:
        """A quantity whose largest value along the orbit is wanted, or None."""


def system_of(scene: AbstractScene) -> AbstractSystem:
    """The system that a scene describes, in minimal coordinates."""
    return Walking() if scene.compliant else Rolling()


class AbstractWalking(AbstractSystem):
    """A walker on compliant ground: legs exchanged at each footstep."""

    def switches(self, args: PyTree, y: PyTree) -> tuple[Switch, ...]:
        return switches(args, y)

    def ending(self, args: PyTree, y: PyTree) -> Scalar:
        code = jnp.asarray(0)
        for name, happens in ending_events(WATCHES).items():
            code = jnp.where(happens(0.0, y, args), int(name), code)
        return code

    def reset_map(self, args: PyTree, y: PyTree) -> PyTree:
        return exchange_legs(y)

    def load(self, args: PyTree, y: PyTree) -> Scalar:
        """Normal force on the foot that carries more [N]."""
        forces = foot_forces(args, y)
        one, two = forces.foot_1.normal, forces.foot_2.normal
        # Versions of JAX differentiate a maximum by other operations.
        return jnp.where(one > two, one, two)


class Walking(AbstractWalking):
    """The walker in minimal coordinates, of which the place along the slope need not return."""

    cyclic_coordinates: ClassVar[tuple[int, ...]] = tuple(map(State._fields.index, CYCLIC))

    def vector_field(self, t: Time, y: State, args: Scene) -> State:
        return vector_field(t, y, args)


class RedundantWalking(AbstractWalking):
    """The walker in coordinates of each leg. Its constraints leave fewer directions than leaves.

    `find_gait` tells its returns in minimal coordinates; by itself it is for `return_map`.
    """

    def vector_field(self, t: Time, y: LegsState, args: RedundantScene) -> LegsState:
        return redundant_field(t, y, args)


def section_of(scene: object, section: AbstractSection | None) -> AbstractSection:
    """The section asked for, or the one that a scene's cycles begin at unless told otherwise.

    Raises:
        ArgumentError: what is no section, or one other than heel strike for a rigid walker.
    """
    if section is not None and not isinstance(section, AbstractSection):
        raise ArgumentError(
            f"section = {section!r} is not allowed: give MidStance(), HeelStrike() or a Section."
        )
    if not is_rigid(scene):
        return MidStance() if section is None else section
    if section is not None and not isinstance(section, HeelStrike):
        raise ArgumentError(
            f"section = {section!r} is not allowed for a RigidScene: its cycles begin just after "
            "the impact, at HeelStrike()."
        )
    return HeelStrike()


def with_leg_names_of(section: AbstractSection, scene: AbstractScene, state: PyTree) -> PyTree:
    """The same motion with the legs' names as the section has them; see `with_leg_2_standing`."""
    if is_rigid(scene) or not section.leg_2_stands:
        return state
    return with_leg_2_standing(cast("CompliantScene", scene), state)


class Rolling(AbstractSystem):
    """The rigid walker: it rolls on leg 2, and exchanges support at each heel strike."""

    cyclic_coordinates: ClassVar[tuple[int, ...]] = tuple(map(RigidState._fields.index, CYCLIC))

    def vector_field(self, t: Time, y: RigidState, args: RigidScene) -> RigidState:
        return rolling_field(t, y, args)

    def switches(self, args: RigidScene, y: RigidState) -> tuple[Switch, ...]:
        return ()

    def ending(self, args: RigidScene, y: RigidState) -> Scalar:
        return rigid_ending(y)

    def reset_map(self, args: RigidScene, y: RigidState) -> RigidState:
        return impact(args, y).state

    def load(self, args: RigidScene, y: RigidState) -> Scalar:
        """Normal force on the foot that rolls [N]; an impact has an impulse instead."""
        return rolling(args, y).force.normal
