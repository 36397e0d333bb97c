"""Walkers as hybrid systems: with laws of contact in either coordinates, and on rigid feet."""

import abc
import functools
from collections.abc import Callable, Collection
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped._ending import Ending
from jaxbiped._types import Scalar, Time, by_numpy
from jaxbiped.dynamics._constrained_motion import consistent_state, project
from jaxbiped.dynamics._contacts import feet, foot_force
from jaxbiped.dynamics._equivalent_states import exchange_legs, minimal_state
from jaxbiped.dynamics._footfalls import landings, leg_depth, standing_leg
from jaxbiped.dynamics._holds import on_held
from jaxbiped.dynamics._impact import impact
from jaxbiped.dynamics._minimal_motion import force_residual, mass_matrix, vector_field
from jaxbiped.dynamics._mode_changes import SLACK, change_mode_on_surface
from jaxbiped.dynamics._redundant_motion import redundant_field
from jaxbiped.dynamics._stance_motion import rolling, rolling_field
from jaxbiped.dynamics._state import cyclic_names
from jaxbiped.dynamics._surfaces import foot_ahead, lead, opening
from jaxbiped.hybrid._compliant_guards import contact_changes, gaps, switches
from jaxbiped.hybrid._endings import WATCHES, ending_events, ending_surface, rigid_ending
from jaxbiped.hybrid._footsteps import (
    distances,
    places_of_landings,
    stands_too_deep,
)
from jaxbiped.hybrid._guards import Gap, Switch
from jaxbiped.hybrid._implicit_field import ImplicitField, with_unit_mass
from jaxbiped.hybrid._rigid_guards import mode_switches
from jaxbiped.hybrid._scales import sizes_of
from jaxbiped.hybrid._sections import AbstractSection
from jaxbiped.hybrid._start_placement import held_like, passes_a_stop, standing_like
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.scene._clearance import check_legs_admitted_alike
from jaxbiped.scene._ground import check_pulls
from jaxbiped.scene._scene import (
    AbstractWalkerScene,
    CompliantScene,
    RedundantScene,
    RigidScene,
    Scene,
)
from jaxbiped.scene._state_types import State

_PATIENCE = 50.0
"""Time allowed to the next arrival, in units of √(l/g)."""
_SHORTEST = 0.1
"""Duration of a cycle in units of √(l/g), about 2 for a footstep: a foot may also chatter."""
_SHORTEST_STEP = 0.01
"""Mean footstep, in units of the walker's height, up to which a gait is no walk."""
_SHALLOW = 1e-9
"""Depth of a foot in units of length up to which it just touches."""


@functools.singledispatch
def system_of(scene: object) -> AbstractSystem:
    """The system that a scene describes; each kind of scene registers its own."""
    raise ArgumentError(f"scene is a {type(scene).__name__}, which is not allowed: give a scene.")


class AbstractWalkerSystem(AbstractSystem):
    """A walker, whose cycles are footsteps."""

    watches: ClassVar[tuple[str, ...]] = WATCHES

    def longest_wait(self, args: AbstractWalkerScene) -> Scalar:
        check_pulls(args.ground)
        return by_numpy(
            lambda numpy, l, g: _PATIENCE * numpy.sqrt(l / g), args.mechanism.height, args.ground.g
        )

    def takes_steps(self, args: AbstractWalkerScene, advance: Any, arrivals: Any) -> Any:
        shortest = _SHORTEST_STEP * args.mechanism.height
        return advance > shortest * arrivals * args.arrival_footsteps

    def is_walk(self, args: Any, y: Any, advance: Scalar, period: Scalar, arrivals: int) -> Scalar:
        """Whether it steps downhill, takes its time, and stands on the ground (boolean)."""
        pace = jnp.sqrt(args.mechanism.height / args.ground.g)
        forward = self.takes_steps(args, advance, arrivals) & (period > _SHORTEST * pace)
        return forward & self.stands(args, y)

    def step_lengths(self, args: Any, states: Any, advance: Scalar, arrivals: int) -> Scalar:
        """Distances between the places of successive heel strikes [m], shape (footsteps,)."""
        count = arrivals * args.arrival_footsteps
        if count == 1:
            return advance
        return distances(self.strike_places(args, states, count), advance)

    def foot_ahead(self, args: AbstractWalkerScene, y: PyTree) -> Scalar:
        """How far the stance leg's foot stands ahead of the root point on a section [m]."""
        return foot_ahead(args, y)

    def stands(self, args: Any, y: PyTree) -> Scalar:
        """Whether no foot is deep underground (boolean). Default: none comes to be."""
        return jnp.asarray(True)

    @abc.abstractmethod
    def strike_places(self, args: Any, states: PyTree, count: int) -> Scalar:
        """Places of the first heel strikes of a cycle [m], shape (count,)."""


class AbstractWalking(AbstractWalkerSystem):
    """A walker on compliant ground: legs exchanged at each footstep."""

    footsteps_end_on_section: ClassVar[bool] = False

    def switches(self, args: CompliantScene, y: PyTree) -> tuple[Switch, ...]:
        return switches(args, y)

    def gaps(self, args: CompliantScene, y: PyTree) -> tuple[Gap, ...]:
        return gaps(args, y)

    def contact_changes(self, args: CompliantScene, before: PyTree, after: PyTree) -> Scalar:
        return contact_changes(args, before, after)

    def failures(self, watch: tuple[str, ...]) -> dict[Ending, Callable[..., Scalar]]:
        return ending_events(watch)

    def ending_surface(self, code: Scalar, args: PyTree, past: PyTree, y: PyTree) -> Scalar:
        return ending_surface(code, args, past, y)

    def standing_leg(self, args: CompliantScene, y: PyTree) -> Scalar:
        return standing_leg(args.mechanism.structure, feet(args, y))

    def landings(self, args: CompliantScene, before: PyTree, after: PyTree) -> tuple[Scalar, ...]:
        return landings(args.mechanism.structure, feet(args, before), feet(args, after))

    def namings(self, args: CompliantScene) -> tuple[int, ...]:
        return args.mechanism.structure.namings

    def check_cycles(self, args: CompliantScene) -> None:
        structure = args.mechanism.structure
        images = structure.leg_twins or range(len(structure.legs))
        check_legs_admitted_alike(args.clearance, structure.legs, images)

    def stands(self, args: CompliantScene, y: PyTree) -> Scalar:
        return ~stands_too_deep(args.minimal, self.section_state(args, y))

    def strike_places(self, args: CompliantScene, states: PyTree, count: int) -> Scalar:
        return places_of_landings(args.minimal, states, count)

    def renamed(self, args: CompliantScene, y: PyTree, times: int) -> PyTree:
        return exchange_legs(args, y, times)

    def reset_map(self, args: PyTree, y: PyTree) -> PyTree:
        return exchange_legs(args, y)

    def load(self, args: PyTree, y: PyTree) -> Scalar:
        """Normal force on the foot that carries more [N]."""
        first, *others = (foot_force(args, foot).normal for foot in feet(args, y))
        for each in others:
            # Versions of JAX differentiate a maximum by other operations.
            first = jnp.where(first > each, first, each)
        return first


class Walking(AbstractWalking):
    """The walker in minimal coordinates, of which the place along the slope need not return."""

    cyclic_coordinates: ClassVar[tuple[int, ...]] = tuple(
        map(State._fields.index, cyclic_names(State))
    )

    # Bristles stand alone in the implicit form.
    vector_field: ClassVar[ImplicitField] = ImplicitField(vector_field, mass_matrix, force_residual)

    def placed_like(
        self, args: Scene, base: PyTree, states: PyTree, named: Collection[str]
    ) -> PyTree:
        return standing_like(args, base, states, named)

    def sizes(self, args: Scene, y: PyTree) -> PyTree:
        """The root point's height is measured in the depth of the stance leg's deepest foot."""
        structure = args.mechanism.structure
        found = leg_depth(structure, feet(args, y), structure.stance_leg)
        depth, length = abs(float(found)), float(args.mechanism.height)
        # A start whose foot just touches tells no depth.
        height = depth if depth > _SHALLOW * length else length
        return sizes_of(args, y)[1]._replace(**{structure.coordinates[1]: height})


class RedundantWalking(AbstractWalking):
    """The walker in coordinates of each leg. Its constraints leave fewer directions than leaves.

    `find_gait` tells its returns in minimal coordinates; by itself it is for `return_map`.
    """

    vector_field: ClassVar[ImplicitField] = with_unit_mass(redundant_field)

    def project(self, args: RedundantScene, y: PyTree) -> PyTree:
        return project(args, y)

    def section_state(self, args: RedundantScene, y: PyTree) -> PyTree:
        return minimal_state(args, y)

    def minimal_start(self, args: RedundantScene, y: PyTree) -> PyTree:
        return minimal_state(args, consistent_state(args, y).state)

    def projects(self, args: RedundantScene) -> bool:
        return args.method.projects


class Rolling(AbstractWalkerSystem):
    """The rigid walker: it rolls on one foot, and exchanges support at each heel strike."""

    cyclic_coordinates: ClassVar[tuple[int, ...]] = (0,)

    def vector_field(self, t: Time, y: Any, args: RigidScene) -> Any:
        return rolling_field(t, y, args)

    def switches(self, args: RigidScene, y: Any) -> tuple[Switch, ...]:
        return mode_switches(args, y)

    def reset_at_switch(self, args: RigidScene, y: Any, which: Scalar) -> Any:
        return change_mode_on_surface(args, y)

    def lies_beyond(self, args: RigidScene, states: Any, by: float = SLACK) -> np.ndarray:
        return passes_a_stop(args, states._asdict(), by=by)

    def placed_like(self, args: RigidScene, base: Any, states: Any, named: Collection[str]) -> Any:
        return held_like(args, base, states, named)

    def strike_places(self, args: RigidScene, states: Any, count: int) -> Scalar:
        """Places of the standing foot just after the strikes [m], shape (count,)."""
        begins = jtu.tree_map(lambda x: x[:, 0], states)
        return begins[0] + jax.vmap(functools.partial(self.foot_ahead, args))(begins)

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


@system_of.register
def _(scene: Scene) -> AbstractSystem:
    return Walking()


@system_of.register
def _(scene: RedundantScene) -> AbstractSystem:
    return RedundantWalking()


@system_of.register
def _(scene: RigidScene) -> AbstractSystem:
    return Rolling()
