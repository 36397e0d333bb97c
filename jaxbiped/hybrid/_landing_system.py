"""Landing systems: smooth motion of second order that explicit steps follow from event to event.

Where rates are smooth and never stiff a long step is cheap, and one that ends beyond an event is
followed back onto its surface. The landing solve asks a system these questions, and no others.
"""

import abc
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Scalar
from jaxbiped.hybrid._system import AbstractSystem


class SurfaceCourse(NamedTuple):
    """The surfaces of a mode at a state.

    Attributes:
        values, rates: of each, shape (k,), the rates in 1/s.
        live: whether it matters there (booleans), shape (k,).
        bends: second derivatives of the first h, which are sums of positions, shape (h,).
        accelerations: of the positions there.
    """

    values: Scalar
    rates: Scalar
    live: Scalar
    bends: Scalar
    accelerations: tuple[Scalar, ...] = ()


class AbstractLandingSystem(AbstractSystem):
    """A system whose motion between resets is smooth and never stiff, and of second order.

    It is reset where it arrives, which ends a footstep, and where its mode changes; one surface
    ends it. All surfaces fall through zero there. States are named tuples, with a leaf `mode` where
    several modes can occur.

    Attributes:
        endings: at least one, what the motion may come to on the surface that ends it. A property
            of the class.
    """

    endings: ClassVar[tuple[Ending, ...]]

    @abc.abstractmethod
    def positions(self, args: PyTree) -> slice:
        """Which leaves of a state are positions.

        As many behind them are their rates; all others change at resets alone, but for a clock.
        """

    @abc.abstractmethod
    def accelerations(self, args: PyTree, y: Any, /) -> tuple[Scalar, ...]:
        """The second derivatives of the positions at a state."""

    @abc.abstractmethod
    def time_scale(self, args: PyTree) -> Scalar:
        """The time in which the motion changes [s]."""

    @abc.abstractmethod
    def arrival_surface(self, args: PyTree, y: Any, /) -> Scalar:
        """A function of the positions that falls through zero where the motion arrives."""

    @abc.abstractmethod
    def arrival_counts(self, args: PyTree, y: Any, /) -> Scalar:
        """A function of the positions that is above zero where an arrival counts."""

    @abc.abstractmethod
    def surface_of_ending(self, args: PyTree, near: Any) -> Callable[[Any], Scalar]:
        """A function of the positions that falls through zero at the ending that is `near`."""

    @abc.abstractmethod
    def ending_on_surface(self, args: PyTree, y: Any) -> Scalar:
        """Code of the `Ending` that a state on the surface of an ending has come to."""

    def ending_stays(self, args: PyTree) -> bool:
        """Whether a state beyond an ending, however far, tells which one it was. Default: yes."""
        return True

    def load_under(self, args: PyTree, y: Any, accelerations: tuple[Scalar, ...]) -> Scalar | None:
        """The load at known accelerations, below zero where the model pulls but no contact can.

        Default: None, for a motion without contact.
        """
        return None

    def carried(self, args: PyTree, y: Any) -> Any:
        """The state as steps carry it, without what follows from positions. Default: as it is."""
        return y

    def completed(self, args: PyTree, y: Any) -> Any:
        """The whole state of one that steps carry. Default: as it is."""
        return y

    def in_place(self, args: PyTree, before: Any, y: Any, is_reset: Scalar | None = None) -> Any:
        """The carried state behind a reset, with what follows from positions as it was before.

        `is_reset`: whether there was one (boolean); None: there was. Default: the state as it is.
        """
        return y

    def changes_mode(self, args: PyTree) -> bool:
        """Whether the mode may change between arrivals. Default: it does not."""
        return False

    def change_mode(self, args: PyTree, y: Any, rtol: Scalar | None = None) -> Any:
        """The state in the mode that goes on from a surface, to which it is as near as `rtol` says.

        None: the state has no error. Default: as it is.
        """
        return y

    def bends_of_gaps(self, args: PyTree, accelerations: tuple[Scalar, ...]) -> list[Scalar]:
        """Second derivatives of the first switches, those that are sums of positions.

        Default: none is.
        """
        return []

    def coordinates(self, args: PyTree, y: Any) -> tuple[tuple[Scalar, ...], tuple[Scalar, ...]]:
        """The positions of a state, and their rates; of a state's rates, those of both."""
        where = self.positions(args)
        return tuple(y[where]), tuple(y[where.stop : 2 * where.stop - where.start])

    def with_coordinates(self, args: PyTree, y: Any, coordinates: tuple[Scalar, ...]) -> Any:
        """The state with other positions, and other rates of these behind them."""
        first = self.positions(args).start
        return type(y)(*y[:first], *coordinates, *y[first + len(coordinates) :])

    def later(self, args: PyTree, y: Any, time: Callable[[], Scalar]) -> Any:
        """The state with its clock so much later. Default: as it is, without a clock."""
        return y

    def course(self, args: PyTree, y: Any) -> SurfaceCourse:
        """The surfaces of the mode at a state, followed along its motion."""

        def values(y: Any) -> tuple[list[Scalar], list[Scalar]]:
            switches = self.switches(args, y)
            return [s.value for s in switches], [jnp.asarray(s.live) for s in switches]

        rates = self.vector_field(0.0, y, args)
        value, slope, live = jax.jvp(values, (y,), (rates,), has_aux=True)
        _, accelerations = self.coordinates(args, rates)
        bends = self.bends_of_gaps(args, accelerations)
        return SurfaceCourse(
            jnp.stack(value),
            jnp.stack(slope),
            jnp.stack(live),
            jnp.stack(bends) if bends else jnp.zeros(0, value[0].dtype),
            accelerations,
        )


class LandingMotion(NamedTuple):
    """What moves: a landing system, and its parameters."""

    system: AbstractLandingSystem
    args: PyTree
