"""Units of a scene: what lengths and times absolute tolerances are told in.

So that a walker of any size is solved as exactly as the seed paper's. For that one all of them are
1, exactly, and a tolerance in them is one in SI units.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Numbers, Scalar
from jaxbiped.dynamics._formulation import state_type
from jaxbiped.scene._abstract_scene import AbstractScene, is_compliant

_LENGTH = 0.40
"""Leg length of the seed paper's walker [m]."""
_GRAVITY = 9.8
"""Gravity in the seed paper [m/s²]."""
_LENGTHS = ("hip_x", "hip_z", "x_1", "z_1", "x_2", "z_2")
_SPEEDS = ("hip_vx", "hip_vz", "vx_1", "vz_1", "vx_2", "vz_2")
_RATES = ("omega_1", "omega_2", "cos_rate_1", "sin_rate_1", "cos_rate_2", "sin_rate_2")


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
    """Units of a state's leaves, from a scene's leg length l and √(l/g).

    Ones where `args` is no scene of a compliant walker. They have no derivatives.

    Raises:
        TypeError: a leaf whose unit is not known.
    """
    if not is_compliant(args):
        return Units(jtu.tree_map(jnp.ones_like, state), np.ones(()))
    length, time = _length_and_time(args)
    one = length / length
    by_name = dict.fromkeys(_LENGTHS, one / length)
    by_name |= dict.fromkeys(_SPEEDS, time / length) | dict.fromkeys(_RATES, time)
    inverse = {
        name: None if leaf is None else by_name.get(name, one)
        for name, leaf in state._asdict().items()
    }
    return Units(type(state)(**inverse), time)


def si_units(units: Units) -> Units:
    """The same with each leaf of the state in SI units: for a tolerance that is told in these."""
    return units._replace(inverse=jtu.tree_map(lambda each: each / each, units.inverse))


def recurring_inverse_units(args: PyTree, count: int) -> Scalar:
    """`Units.inverse` of a minimal state without hip_x, shape (count,)."""
    if not is_compliant(args):
        return jnp.ones(count)
    kind = state_type(args.minimal)
    inverse = units_of(args, kind(*[0.0] * len(kind._fields))).inverse[1:]
    return jnp.stack(inverse) if len(inverse) == count else jnp.ones(count)


def _length_and_time(args: AbstractScene) -> tuple[Scalar, Scalar]:
    walker, ground = args.walker, args.ground
    known = not any(isinstance(leaf, jax.core.Tracer) for leaf in (walker.l, ground.g))
    xp: Any = np if known else jnp  # where numbers are known nothing is compiled for them
    length = xp.asarray(walker.l) / _LENGTH
    gravity = xp.asarray(ground.g) / _GRAVITY
    found = length, xp.sqrt(length / xp.where(gravity > 0.0, gravity, 1.0))
    return found if known else jax.lax.stop_gradient(found)


def sizes_of(args: PyTree, states: PyTree) -> tuple[float, PyTree]:
    """What counts as 1 in times, √(l/g) [s], and in each leaf of a state, SI units.

    Args:
        args: a scene with a walker's leg length and gravity, numbers.
        states: whose leaves they are for; where it has None there is none.
    """
    length, gravity = float(args.walker.l), float(args.ground.g)
    time = float(np.sqrt(length / gravity)) if gravity > 0.0 else 1.0
    by_name = dict.fromkeys(_LENGTHS, length) | dict.fromkeys(_SPEEDS, length / time)
    by_name |= dict.fromkeys(_RATES, 1.0 / time)
    sizes = {
        name: None if leaf is None else by_name.get(name, 1.0)
        for name, leaf in states._asdict().items()
    }
    return time, type(states)(**sizes)


def relative_to_scene(args: PyTree, times: Numbers, states: PyTree) -> float:
    """The largest of errors of times and states, told in l, √(l/g) and their quotients [–].

    An error that is no number is infinite.

    Args:
        args: a scene with a walker's leg length and gravity, numbers.
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
