"""Hybrid systems: a vector field with guards, endings and a reset map.

A walker is only one of them: solves and searches ask this interface, so a user's own system does.
"""

import abc
from collections.abc import Callable, Collection
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Scalar, Time, select
from jaxbiped.caching._known_by_shape import known_by_shape
from jaxbiped.dynamics._mode_changes import SLACK
from jaxbiped.hybrid._guards import Gap, Switch
from jaxbiped.hybrid._scales import sizes_of
from jaxbiped.hybrid._sections import AbstractSection

_PATIENCE = 1e6
"""Time allowed to the next arrival, in units of the system's time."""


class AbstractSystem(eqx.Module):
    """An autonomous system whose periodic orbits can be found and differentiated.

    The state and the parameters `args` are pytrees of scalars. Subclass it to study a system of
    your own; the walker is only one subclass, `Walking`. Numbers to differentiate with respect to
    belong in `args`; a system that holds arrays itself runs on XLA and in forward mode only.

    Attributes:
        cyclic_coordinates: positions of the leaves that only advance and need not return; no rate
            may depend on them.
        time_unit: size of the times in which the motion changes [s]: events are located to a share
            of it. A property of the class.
        lands: whether every solve ends a step on each of the `landed_switches`; else only those
            with derivatives do, and others weigh the errors of steps across. A property of the
            class.
        resets: whether a plain solve resets the state at switches. A property of the class.
        watches: names of the failures that may be watched for. A property of the class.
        footsteps_end_on_section: whether a footstep ends where a cycle's section is met; else
            between two arrivals there. A property of the class.
        refuses: names of options of `simulate` that mean nothing for it. A property of the class.
        reached: how a motion ends that lasts as long as it is asked to. A property of the class.
    """

    cyclic_coordinates: ClassVar[tuple[int, ...]] = ()
    time_unit: ClassVar[float] = 1.0
    lands: ClassVar[bool] = False
    resets: ClassVar[bool] = False
    watches: ClassVar[tuple[str, ...]] = ()
    footsteps_end_on_section: ClassVar[bool] = True
    refuses: ClassVar[tuple[str, ...]] = ()
    reached: ClassVar[Ending] = Ending.WALKING

    def start(self, args: PyTree, y: PyTree) -> tuple[PyTree, PyTree]:
        """A start that is checked and lies on its constraints, and how it was moved onto them.

        Default: the start as it is, and None.
        """
        return y, None

    def begun(self, args: PyTree, y: PyTree) -> PyTree:
        """A start with what the motion would tell of its past. Default: as it is."""
        return y

    def check_start(self, args: PyTree, y: PyTree, given: PyTree) -> None:
        """Raises `ArgumentError` for a start that cannot be simulated well.

        `y` is what `start` makes of the one that was given. Default: any can.
        """

    def check_section(self, args: PyTree, section: AbstractSection) -> None:
        """Raises `ArgumentError` for a section that is none of its motions. Default: all are."""

    def violation(self, args: PyTree, states: PyTree) -> Scalar | None:
        """Distances of states from their constraints [m]; None where these are not told.

        Default: None.
        """
        return None

    @abc.abstractmethod
    def vector_field(self, t: Time, y: PyTree, args: PyTree) -> PyTree:
        """Time derivative of the state, in the form that `diffrax.ODETerm` takes."""

    @abc.abstractmethod
    def switches(self, args: PyTree, y: PyTree) -> tuple[Switch, ...]:
        """Surfaces across which the vector field is not smooth."""

    def landed_switches(self, args: PyTree, y: PyTree) -> tuple[Switch, ...]:
        """The first switches, those on which steps without derivatives end. Default: all."""
        return self.switches(args, y)

    def reset_at_switch(self, args: PyTree, y: PyTree, which: Scalar) -> PyTree:
        """The state after the switch of a number, from 1 on, that resets it. Default: as it is."""
        return y

    def repeats(self, args: PyTree, y: PyTree) -> Scalar:
        """Whether a state just behind a reset is still where it is reset (boolean)."""
        return jnp.asarray(False)

    def unwrapped(self, before: PyTree, after: PyTree) -> PyTree:
        """A state after a cycle, with coordinates that turn counted on from those before.

        Default: the state as it is.
        """
        return after

    def observed_at(self, section: AbstractSection) -> "AbstractSystem":
        """The same with cycles that begin at a section. Default: the same."""
        return self

    def on_held(self, args: PyTree, y: PyTree) -> PyTree:
        """The state with every held part at its place. Default: the state as it is.

        A cycle begins with this state, so its multipliers are those of the free parts.
        """
        return y

    def ending(self, args: PyTree, y: PyTree) -> Scalar:
        """Code of the `Ending` that has occurred; 0 if the motion goes on.

        Default: the first that happens of the failures that `watches` names.
        """
        code = jnp.asarray(0)
        for name, happens in reversed(self.failures(self.watches).items()):
            code = jnp.where(happens(0.0, y, args), int(name), code)
        return code

    @abc.abstractmethod
    def reset_map(self, args: PyTree, y: PyTree) -> PyTree:
        """The state after an arrival: after a symmetry, an impact, or unchanged."""

    def arrival(self, section: AbstractSection, args: PyTree, y: PyTree) -> tuple[Scalar, Scalar]:
        """The section's value at a state just before it, and whether a crossing there counts."""
        after_reset = self.section_state(args, self.reset_map(args, y))
        return section.value(args, after_reset), section.counts(args, after_reset)

    def longest_wait(self, args: PyTree) -> Scalar | float:
        """Time that the next arrival at a section may take. Default: 1e6 units of its time."""
        return _PATIENCE * self.time_unit

    def check_cycles(self, args: PyTree) -> None:
        """Raises `ArgumentError` where no cycle closes by the reset map. Default: cycles may."""

    def takes_steps(self, args: PyTree, advance: Any, arrivals: Any) -> Any:
        """Whether an advance in so many arrivals is one of footsteps (boolean). Default: it is."""
        return jnp.asarray(True)

    def is_walk(self, args: Any, y: Any, advance: Scalar, period: Scalar, arrivals: int) -> Scalar:
        """Whether a cycle from a state on its section is one to which motions may come (boolean).

        It has so many `arrivals`. Default: nothing is required of it.
        """
        return jnp.asarray(True)

    def step_lengths(self, args: PyTree, states: PyTree, advance: Scalar, arrivals: int) -> Scalar:
        """Distances between the places of successive footsteps in a cycle, shape (footsteps,).

        The cycle has the `advance`, shape (1,), and passes through states with leaves of the shape
        (arrivals, nodes). Default: the cycle is one footstep.
        """
        return advance

    def foot_ahead(self, args: PyTree, y: PyTree) -> Scalar | None:
        """How far the standing foot is ahead of the place that advances. Default: no foot."""
        return None

    def minimal_start(self, args: PyTree, y: PyTree) -> PyTree:
        """A start on its constraints, in minimal coordinates. Default: as it is, without any."""
        return y

    def lies_beyond(self, args: PyTree, states: PyTree, by: float = SLACK) -> np.ndarray:
        """Whether states are so far beyond a surface that resets them (booleans).

        Leaves have the shape (n,). Default: there is none.
        """
        return np.zeros(np.shape(jtu.tree_leaves(states)[0]), dtype=bool)

    def placed_like(
        self, args: PyTree, base: PyTree, states: PyTree, named: Collection[str]
    ) -> PyTree:
        """States that stand and are held as the base does, what is `named` as it is.

        Leaves have the shape (n,). Default: they are as they are.
        """
        return states

    def sizes(self, args: PyTree, y: PyTree) -> PyTree:
        """Size of each leaf of a state, in which distances from it are measured, SI units."""
        return sizes_of(args, y)[1]

    def section_state(self, args: PyTree, y: PyTree) -> PyTree:
        """The state as sections take it. Default: as it is."""
        return y

    @abc.abstractmethod
    def load(self, args: PyTree, y: PyTree) -> Scalar | None:
        """The quantity whose largest value along the orbit is reported, or None."""

    @known_by_shape
    def load_exists(self, args: PyTree, y: PyTree) -> bool:
        """Whether there is a load."""
        return self.load(args, y) is not None

    def gaps(self, args: PyTree, y: PyTree) -> tuple[Gap, ...]:
        """The gaps whose closing no step may miss. Default: there are none."""
        return ()

    def contact_changes(self, args: PyTree, before: PyTree, after: PyTree) -> Scalar:
        """Whether a step between two states crosses a corner of the field (boolean).

        The error of such a step counts more. Default: it never does.
        """
        return jnp.asarray(False)

    def projects(self, args: PyTree) -> bool:
        """Whether a step's end is projected onto constraints. Default: it is not."""
        return False

    def project(self, args: PyTree, y: PyTree) -> PyTree:
        """The state on the constraints. Default: the state as it is."""
        return y

    def failures(self, watch: tuple[str, ...]) -> dict[Ending, Callable[..., Scalar]]:
        """The conditions `happens(t, y, args)` of the failures that are watched for.

        They are the same functions each time: caches know by them what is compiled. Default: there
        are none.
        """
        return {}

    def ending_surface(self, code: Scalar, args: PyTree, past: PyTree, y: PyTree) -> Scalar:
        """A value that rises through zero where the motion comes to the ending of a `code`.

        `past` is a state just past the ending, which decides between causes of one code. Default:
        NaN, for an ending that no state decides.
        """
        return jnp.full(jnp.shape(code), jnp.nan)

    def standing_leg(self, args: PyTree, y: PyTree) -> Scalar:
        """Number of the leg that stands alone, from 1 on. Default: 0, for none."""
        return jnp.asarray(0)

    def landings(self, args: PyTree, before: PyTree, after: PyTree) -> tuple[Scalar, ...]:
        """Whether each leg comes down ahead between two states (booleans). Default: no legs."""
        return ()

    def namings(self, args: PyTree) -> tuple[int, ...]:
        """Number of the leg at the section, in each of the names that a symmetry allows.

        Default: there is one leg and one way to name it.
        """
        return (0,)

    def renamed(self, args: PyTree, y: PyTree, times: int) -> PyTree:
        """The same motion with its names exchanged so many times. Default: as it is."""
        return y

    def images(self, args: PyTree, y: PyTree) -> list[tuple[int, PyTree]]:
        """The same motion in all names, those that it has last, each with the leg's number."""
        legs = self.namings(args)
        return [(leg, self.renamed(args, y, k)) for k, leg in enumerate(legs)][::-1]

    def in_nearest_names(
        self, section: AbstractSection, args: PyTree, near: PyTree, y: PyTree
    ) -> PyTree:
        """A state in those names, of all that there are, that bring another to a section."""
        *others, (_, plain) = self.images(args, near)
        *renamed, (_, image) = self.images(args, y)
        nearest = jnp.abs(section.value(args, plain))
        for (_, other), (_, named) in zip(others[::-1], renamed[::-1], strict=True):
            off = jnp.abs(section.value(args, other))
            image = select(off < nearest, named, image)
            nearest = jnp.minimum(off, nearest)
        return image
