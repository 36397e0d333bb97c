"""Walkers of every kind as hybrid systems: cycles are footsteps, and what counts as a walk."""

import abc
from typing import Any, ClassVar

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar, by_numpy
from jaxbiped.dynamics._surfaces import foot_ahead
from jaxbiped.hybrid._endings import WATCHES
from jaxbiped.hybrid._footsteps import distances
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.scene._ground import check_pulls
from jaxbiped.scene._scene import AbstractWalkerScene

_PATIENCE = 50.0
"""Time allowed to the next arrival, in units of √(l/g)."""
_SHORTEST = 0.1
"""Duration of a cycle in units of √(l/g), about 2 for a footstep: a foot may also chatter."""
_SHORTEST_STEP = 0.01
"""Mean footstep, in units of the walker's height, up to which a gait is no walk."""


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
