"""Units of a scene: what lengths and times absolute tolerances are told in.

So that a walker of any size is solved as exactly as the seed paper's. For that one all of them are
1, exactly, and a tolerance in them is one in SI units.
"""

from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Numbers, Scalar, is_traced
from jaxbiped.dynamics._state import state_type
from jaxbiped.dynamics._state_quantities import dimensions_of, recurring_leaves
from jaxbiped.scene._abstract_scene import AbstractWalkerScene
from jaxbiped.scene._scene import is_compliant

_LENGTH = 0.40
"""Leg length of the seed paper's walker [m]."""
_GRAVITY = 9.8
"""Gravity in the seed paper [m/s²]."""
_Sizes: TypeAlias = dict[tuple[float, float], Any]
"""Numbers by the powers of length and time in a unit."""


class Units(NamedTuple):
    """Units in which errors and steps are measured.

    Attributes:
        inverse: one over the unit of each leaf of the state, a pytree like it: what a leaf is
            multiplied by.
        time: unit of time.
    """

    inverse: PyTree
    time: Numbers


def units_of(args: PyTree, state: PyTree) -> Units:
    """Units of a state's leaves, from the root point's height l with all angles 0 and √(l/g).

    Ones where `args` is no scene of a compliant walker. They have no derivatives.

    Raises:
        TypeError: a leaf whose unit is not known.
    """
    if not is_compliant(args):
        return Units(jtu.tree_map(jnp.ones_like, state), np.ones(()))
    length, time = _length_and_time(args)
    one = length / length
    inverse: _Sizes = {(1, 0): one / length, (1, -1): time / length, (0, -1): time, (0, 0): one}
    return Units(_by_dimension(state, inverse), time)


def si_units(units: Units) -> Units:
    """The same with each leaf of the state in SI units: for a tolerance that is told in these."""
    return units._replace(inverse=jtu.tree_map(lambda each: each / each, units.inverse))


def recurring_inverse_units(args: PyTree, count: int) -> Scalar:
    """`Units.inverse` of a minimal state without hip_x, shape (count,)."""
    if not is_compliant(args):
        return jnp.ones(count)
    kind = state_type(args.minimal)
    inverse = recurring_leaves(units_of(args, kind(*[0.0] * len(kind._fields))).inverse)
    return jnp.stack(inverse) if len(inverse) == count else jnp.ones(count)


def _length_and_time(args: AbstractWalkerScene) -> tuple[Scalar, Scalar]:
    height, ground = args.mechanism.height, args.ground
    known = not is_traced((height, ground.g))
    xp: Any = np if known else jnp  # where numbers are known nothing is compiled for them
    length = xp.asarray(height) / _LENGTH
    gravity = xp.asarray(ground.g) / _GRAVITY
    found = length, xp.sqrt(length / xp.where(gravity > 0.0, gravity, 1.0))
    return found if known else jax.lax.stop_gradient(found)


def sizes_of(args: PyTree, states: PyTree) -> tuple[float, PyTree]:
    """What counts as 1 in times, √(l/g) [s], and in each leaf of a state, SI units.

    Args:
        args: a scene of a walker, its numbers known.
        states: whose leaves they are for; where it has None there is none.
    """
    length, gravity = float(args.mechanism.height), float(args.ground.g)
    time = float(np.sqrt(length / gravity)) if gravity > 0.0 else 1.0
    sizes: _Sizes = {(1, 0): length, (1, -1): length / time, (0, -1): 1.0 / time, (0, 0): 1.0}
    return time, _by_dimension(states, sizes)


def recurring_sizes(args: PyTree, state: PyTree) -> np.ndarray:
    """`sizes_of` the components of a state without hip_x, shape (m,), SI units."""
    return np.array(recurring_leaves(sizes_of(args, state)[1]))


def _by_dimension(state: PyTree, values: _Sizes) -> PyTree:
    """Of each leaf of a state the value for its powers of length and time; None where it is."""
    dimensions = dimensions_of(type(state))
    leaves = state._asdict().items()
    found = {name: None if leaf is None else values[dimensions[name]] for name, leaf in leaves}
    return type(state)(**found)


def relative_to_scene(args: PyTree, times: Numbers, states: PyTree) -> float:
    """The largest of errors of times and states, told in l, √(l/g) and their quotients [–].

    An error that is no number is infinite.

    Args:
        args: a scene of a walker, its numbers known.
        times: errors of times [s], of any shape.
        states: errors of states, SI units, leaves of any shape.
    """
    time, sizes = sizes_of(args, states)
    shares = [np.max(np.asarray(times), initial=0.0) / time]
    shares += jtu.tree_leaves(
        jtu.tree_map(lambda leaf, size: np.max(np.asarray(leaf), initial=0.0) / size, states, sizes)
    )
    worst = float(np.max(shares))
    return worst if np.isfinite(worst) else np.inf
