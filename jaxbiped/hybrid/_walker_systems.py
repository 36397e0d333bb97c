"""Walkers with laws of contact as hybrid systems, in either coordinates; the system of a scene."""

import functools
from collections.abc import Callable, Collection
from typing import ClassVar

import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped._ending import Ending
from jaxbiped._types import Scalar
from jaxbiped.dynamics._constrained_motion import consistent_state, project
from jaxbiped.dynamics._contacts import feet, foot_force
from jaxbiped.dynamics._equivalent_states import exchange_legs, minimal_state, strike_leg_of
from jaxbiped.dynamics._footfalls import landings, leg_depth, standing_leg
from jaxbiped.dynamics._minimal_motion import force_residual, mass_matrix, vector_field
from jaxbiped.dynamics._redundant_motion import redundant_field
from jaxbiped.dynamics._state import cyclic_names
from jaxbiped.hybrid._compliant_guards import contact_changes, gaps, strikes, switches
from jaxbiped.hybrid._endings import ending_events, ending_surface
from jaxbiped.hybrid._footsteps import places_of_landings, stands_too_deep
from jaxbiped.hybrid._guards import Gap, Switch
from jaxbiped.hybrid._implicit_field import ImplicitField, with_unit_mass
from jaxbiped.hybrid._rolling_system import ROLLING
from jaxbiped.hybrid._scales import check_precision, sizes_of
from jaxbiped.hybrid._sections import AbstractSection, check_section_body
from jaxbiped.hybrid._start_placement import standing_like
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.hybrid._walker_starts import check_start_height, consistent_start, walking_start
from jaxbiped.hybrid._walker_system import AbstractWalkerSystem
from jaxbiped.scene._clearance import check_legs_admitted_alike
from jaxbiped.scene._scene import CompliantScene, RedundantScene, RigidScene, Scene
from jaxbiped.scene._state_types import State

_SHALLOW = 1e-9
"""Depth of a foot in units of length up to which it just touches."""


@functools.singledispatch
def system_of(scene: object) -> AbstractSystem:
    """The system that a scene describes; each kind of scene registers its own."""
    raise ArgumentError(f"scene is a {type(scene).__name__}, which is not allowed: give a scene.")


class AbstractWalking(AbstractWalkerSystem):
    """A walker on compliant ground: legs exchanged at each footstep."""

    footsteps_end_on_section: ClassVar[bool] = False

    def check_start(self, args: CompliantScene, y: PyTree, given: PyTree) -> None:
        check_precision(args, jnp.result_type(jtu.tree_leaves(y)[0]))
        check_start_height(args, given)

    def check_section(self, args: CompliantScene, section: AbstractSection) -> None:
        check_section_body(args.minimal, section)

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

    def start(self, args: Scene, y: PyTree) -> tuple[PyTree, PyTree]:
        return walking_start(args, y), None

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


class ClockedWalking(Walking):
    """The walker whose laws read the time since the last strike; each strike restarts its clock.

    A step ends on each strike. A foot that bounces has struck once: its leg strikes again only
    when another one has struck.
    """

    lands: ClassVar[bool] = True
    resets: ClassVar[bool] = True
    refuses: ClassVar[tuple[str, ...]] = ("adjoint",)

    def begun(self, args: CompliantScene, y: PyTree) -> PyTree:
        """The leg that stands alone struck last."""
        structure = args.mechanism.structure
        stands, struck = self.standing_leg(args, y), y.strike_leg
        for leg in range(len(structure.legs)):
            struck = jnp.where(stands == 1 + leg, strike_leg_of(structure, leg), struck)
        return y._replace(strike_leg=struck)

    def landed_switches(self, args: CompliantScene, y: PyTree) -> tuple[Switch, ...]:
        return strikes(args, y)

    def switches(self, args: CompliantScene, y: PyTree) -> tuple[Switch, ...]:
        return (*strikes(args, y), *switches(args, y))

    def reset_at_switch(self, args: CompliantScene, y: PyTree, which: Scalar) -> PyTree:
        structure = args.mechanism.structure
        clock, struck = y.clock, y.strike_leg
        for leg in range(len(structure.legs)):
            strikes_now = which == 1 + leg
            clock = jnp.where(strikes_now, 0.0, clock)
            struck = jnp.where(strikes_now, strike_leg_of(structure, leg), struck)
        return y._replace(clock=clock, strike_leg=struck)


class RedundantWalking(AbstractWalking):
    """The walker in coordinates of each leg. Its constraints leave fewer directions than leaves.

    `find_gait` tells its returns in minimal coordinates; by itself it is for `return_map`.
    """

    vector_field: ClassVar[ImplicitField] = with_unit_mass(redundant_field)

    def start(self, args: RedundantScene, y: PyTree) -> tuple[PyTree, PyTree]:
        correction = consistent_start(args, y)
        return correction.state, correction

    def project(self, args: RedundantScene, y: PyTree) -> PyTree:
        return project(args, y)

    def section_state(self, args: RedundantScene, y: PyTree) -> PyTree:
        return minimal_state(args, y)

    def minimal_start(self, args: RedundantScene, y: PyTree) -> PyTree:
        return minimal_state(args, consistent_state(args, y).state)

    def projects(self, args: RedundantScene) -> bool:
        return args.method.projects


# The same each time: to form one costs more than what a warm call asks of it.
_WALKING, _CLOCKED_WALKING, _REDUNDANT_WALKING = Walking(), ClockedWalking(), RedundantWalking()


@system_of.register
def _(scene: Scene) -> AbstractSystem:
    return _CLOCKED_WALKING if scene.clock else _WALKING


@system_of.register
def _(scene: RedundantScene) -> AbstractSystem:
    return _REDUNDANT_WALKING


@system_of.register
def _(scene: RigidScene) -> AbstractSystem:
    return ROLLING
