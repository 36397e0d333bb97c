"""Hybrid systems: the vector field, switches, endings and reset map that a return map needs.

The walker is only one of them: solves and searches ask this interface, so a user's own system does.
At the end are the directions in which a state may move while everything held stays so.
"""

import abc
from typing import Any, ClassVar, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._types import Scalar, Time, as_float
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._contacts import foot_forces, with_stance_leg_standing
from jaxbiped.dynamics._equivalent_states import exchange_legs, minimal_state
from jaxbiped.dynamics._holds import on_held
from jaxbiped.dynamics._impact import impact
from jaxbiped.dynamics._minimal_motion import WalkerField
from jaxbiped.dynamics._mode_changes import change_mode, change_mode_on_surface, mode_switches
from jaxbiped.dynamics._redundant_motion import BodiesField
from jaxbiped.dynamics._stance_motion import rolling, rolling_field
from jaxbiped.dynamics._state import cyclic_names, recurring_leaves, recurring_names
from jaxbiped.dynamics._surfaces import (
    AbstractSection,
    HeelStrike,
    MidStance,
    Switch,
    lead,
    opening,
    switches,
)
from jaxbiped.scene._modes import rigid_modes
from jaxbiped.scene._scene import (
    AbstractScene,
    AbstractWalkerScene,
    CompliantScene,
    RigidScene,
    is_compliant,
    is_rigid,
)
from jaxbiped.scene._state_types import State
from jaxbiped.solve._failure_events import WATCHES, ending_events, rigid_ending


class AbstractSystem(eqx.Module):
    """An autonomous system whose periodic orbits can be found and differentiated.

    The state and the parameters `args` are pytrees of scalars. Subclass it to study a system of
    your own; the walker is only one subclass, `Walking`. Numbers to differentiate with respect to
    belong in `args`; a system that holds arrays itself runs on XLA and in forward mode only.

    Attributes:
        cyclic_coordinates: positions of the leaves that only advance and need not return; no rate
            may depend on them.
    """

    cyclic_coordinates: ClassVar[tuple[int, ...]] = ()

    @abc.abstractmethod
    def vector_field(self, t: Time, y: PyTree, args: PyTree) -> PyTree:
        """Time derivative of the state, in the form that `diffrax.ODETerm` takes."""

    @abc.abstractmethod
    def switches(self, args: PyTree, y: PyTree) -> tuple[Switch, ...]:
        """Surfaces across which the vector field is not smooth."""

    def reset_at_switch(self, args: PyTree, y: PyTree) -> PyTree:
        """The state after a switch that resets it. Default: the state as it is."""
        return y

    def on_held(self, args: PyTree, y: PyTree) -> PyTree:
        """The state with every held part at its place. Default: the state as it is.

        A cycle begins with this state, so its multipliers are those of the free parts.
        """
        return y

    @abc.abstractmethod
    def ending(self, args: PyTree, y: PyTree) -> Scalar:
        """Code of the `Ending` that has occurred; 0 if the motion goes on."""

    @abc.abstractmethod
    def reset_map(self, args: PyTree, y: PyTree) -> PyTree:
        """The state after an arrival: after a symmetry, an impact, or unchanged."""

    def arrival(self, section: AbstractSection, args: PyTree, y: PyTree) -> tuple[Scalar, Scalar]:
        """The section's value at a state just before it, and whether a crossing there counts."""
        after_reset = minimal_state(args, self.reset_map(args, y))
        return section.value(args, after_reset), section.counts(args, after_reset)

    @abc.abstractmethod
    def load(self, args: PyTree, y: PyTree) -> Scalar | None:
        """The quantity whose largest value along the orbit is reported, or None."""


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
        return exchange_legs(args, y)

    def load(self, args: PyTree, y: PyTree) -> Scalar:
        """Normal force on the foot that carries more [N]."""
        first, *others = (force.normal for force in foot_forces(args, y))
        for each in others:
            # Versions of JAX differentiate a maximum by other operations.
            first = jnp.where(first > each, first, each)
        return first


class Walking(AbstractWalking):
    """The walker in minimal coordinates, of which the place along the slope need not return."""

    cyclic_coordinates: ClassVar[tuple[int, ...]] = tuple(
        map(State._fields.index, cyclic_names(State))
    )

    vector_field: ClassVar[WalkerField] = WalkerField()


class RedundantWalking(AbstractWalking):
    """The walker in coordinates of each leg. Its constraints leave fewer directions than leaves.

    `find_gait` tells its returns in minimal coordinates; by itself it is for `return_map`.
    """

    vector_field: ClassVar[BodiesField] = BodiesField()


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
    if isinstance(section, MidStance) and section.body is not None and is_compliant(scene):
        structure = scene.mechanism.structure
        check_choice("section.body", section.body, [structure.bodies[j] for j in structure.free])
    if not is_rigid(scene):
        return _default_section(scene) if section is None else section
    if section is not None and not isinstance(section, HeelStrike):
        raise ArgumentError(
            f"section = {section!r} is not allowed for a RigidScene: its cycles begin just after "
            "the impact, at HeelStrike()."
        )
    return HeelStrike()


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


class Rolling(AbstractSystem):
    """The rigid walker: it rolls on one foot, and exchanges support at each heel strike."""

    cyclic_coordinates: ClassVar[tuple[int, ...]] = (0,)

    def vector_field(self, t: Time, y: Any, args: RigidScene) -> Any:
        return rolling_field(t, y, args)

    def switches(self, args: RigidScene, y: Any) -> tuple[Switch, ...]:
        return mode_switches(args, y)

    def reset_at_switch(self, args: RigidScene, y: Any) -> Any:
        return change_mode_on_surface(args, y)

    def on_held(self, args: RigidScene, y: Any) -> Any:
        return on_held(args, y)

    def ending(self, args: RigidScene, y: Any) -> Scalar:
        return rigid_ending(args, y)

    def reset_map(self, args: RigidScene, y: Any) -> Any:
        return impact(args, y).state

    def arrival(self, section: AbstractSection, args: RigidScene, y: Any) -> tuple[Scalar, Scalar]:
        # The angles before the impact tell, without it.
        return -opening(args, y), lead(args, y) > 0.0

    def load(self, args: RigidScene, y: Any) -> Scalar:
        """Normal force on the foot that rolls [N]; an impact has an impulse instead."""
        return rolling(args, y).force.normal


def projection_of(scene: Any, state: Any) -> np.ndarray:
    """Projection of the m recurring components on those that may change, shape (m, m).

    The identity where nothing is held.
    """
    if scene.compliant or not rigid_modes(scene.mechanism).any:
        return np.eye(len(recurring_leaves(state)))
    return np.asarray(_projection(*jtu.tree_map(as_float, (scene, state))))


@cached_jit
def _projection(scene: RigidScene, state: Any) -> Scalar:
    leaves, structure = jtu.tree_flatten(state)

    def held(leaves: list[Scalar]) -> Scalar:
        there = on_held(scene, jtu.tree_unflatten(structure, leaves))
        return jnp.stack(recurring_leaves(there))

    slopes = jax.jacfwd(held)(leaves)
    return jnp.stack(recurring_leaves(jtu.tree_unflatten(structure, slopes)), axis=1)


def admissible_directions(scene: Any, state: Any, scales: np.ndarray) -> np.ndarray:
    """Orthonormal directions of scaled recurring components in which a state may move, (m, d)."""
    import scipy.linalg

    projection = projection_of(scene, state)
    if np.array_equal(projection, np.eye(len(projection))):
        return projection
    found: np.ndarray = scipy.linalg.orth(projection / scales[:, None])
    return found


def independent_names(scene: Any, state: Any) -> tuple[str, ...]:
    """Names of recurring components that may be chosen freely; what is held follows them."""
    projection = projection_of(scene, state)
    chosen: list[int] = []
    for k in range(len(projection)):
        if np.linalg.matrix_rank(projection[[*chosen, k]]) > len(chosen):
            chosen.append(k)
    return tuple(tuple(recurring_names(state))[k] for k in chosen)
