"""Scales of a scene: units of errors and steps, the slip speed to resolve, what float32 can bear.

In units of a scene a walker of any size is solved as exactly as the seed paper's. For that one all
of them are 1, exactly, and a tolerance in them is one in SI units.
"""

from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped._types import Numbers, RealScalarLike, Scalar, is_traced
from jaxbiped.dynamics._state import dimensions_of, recurring_leaves
from jaxbiped.scene._linkage_scene import LinkageScene, LinkageState
from jaxbiped.scene._scene import (
    AbstractScene,
    AbstractWalkerScene,
    CompliantScene,
    is_compliant,
    is_rigid,
    is_walker,
)

_LENGTH = 0.40
"""Leg length of the seed paper's walker [m]."""
_GRAVITY = 9.8
"""Gravity in the seed paper [m/s²]."""
_Sizes: TypeAlias = dict[tuple[float, float], Any]
"""Numbers by the powers of length and time in a unit."""
_RESOLVED = 0.5
"""Error of a walker's speed √(g l), in units of the slip speed over which friction builds up, from
which steps may chatter about that."""
_CHATTERS = 1000.0
"""Times that a tolerance is coarser than what resolves slip from which errors were seen."""


def is_stiff(args: PyTree) -> bool:
    """Whether a motion may be stiff: that of a scene as it says, of other parameters always."""
    return not isinstance(args, AbstractScene) or args.stiff


def resolve_slip_speed(rtol: RealScalarLike, scene: PyTree) -> RealScalarLike:
    """A relative tolerance, or the largest below it that resolves how friction builds up."""
    law = getattr(scene, "friction", None)
    name = getattr(law, "builds_up_over", None)
    if name is None:
        return rtol
    leaves = (getattr(law, name), scene.ground.g, scene.mechanism.height)
    traced = is_traced(leaves)
    xp: Any = jnp if traced else np  # where numbers are known nothing is compiled for them
    slow, g, l = (jax.lax.stop_gradient(leaf) if traced else np.asarray(leaf) for leaf in leaves)
    fast = xp.sqrt(g * l)
    finest = _RESOLVED * slow / xp.where(fast > 0.0, fast, 1.0)
    return xp.where(_RESOLVED * slow < rtol * fast, finest, rtol)


def unresolved_slip(rtol: RealScalarLike, scene: PyTree) -> str:
    """A sentence on a tolerance far coarser than what resolves how friction builds up, or none."""
    if isinstance(rtol, jax.core.Tracer):
        return ""
    finest = resolve_slip_speed(float(rtol), scene)
    if isinstance(finest, jax.core.Tracer) or float(rtol) <= _CHATTERS * float(finest):
        return ""
    name = scene.friction.builds_up_over
    return (
        f"rtol = {float(rtol):g} is too coarse for {name} = "
        f"{float(getattr(scene.friction, name)):g} m/s: steps may chatter about that slip "
        f"speed; {float(finest):.1g} resolves it"
    )


def check_precision(scene: CompliantScene, dtype: np.dtype) -> None:
    """Refuses a precision too coarse for the scene's contact.

    Rounding a position of the order of l moves a foot by ε l. Where that alone changes the
    reaction (its stiffness K at one metre's penetration, times ε l) by more than the walker's
    weight, contact is noise.

    Raises:
        ArgumentError: for float32 (or less) where contact is too stiff.
    """
    if dtype == np.float64 or is_traced(scene):
        return
    mechanism = scene.mechanism
    stiffness = scene.normal.elastic_force(jnp.ones_like(mechanism.height))
    rounding = stiffness * float(jnp.finfo(dtype).eps) * mechanism.height
    worst = float(jnp.max(rounding / (mechanism.total_mass * scene.ground.g)))
    if worst > 1.0:
        raise ArgumentError(
            f"dtype = {np.dtype(dtype).name} is too coarse for this contact: rounding a position "
            f"changes the reaction by {worst:.3g} times the walker's weight; use float64."
        )


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
    if not is_walker(args) and isinstance(args, AbstractScene):
        inverses = jtu.tree_map(lambda size: np.asarray(1.0 / size), _own_sizes(state))
        return Units(inverses, np.asarray(args.time_unit))
    if not is_compliant(args):
        return Units(jtu.tree_map(jnp.ones_like, state), np.ones(()))
    length, time = _length_and_time(args)
    one = length / length
    inverse: _Sizes = {(1, 0): one / length, (1, -1): time / length, (0, -1): time, (0, 0): one}
    inverse[0, 1] = one / time
    return Units(_by_dimension(state, inverse), time)


def _own_sizes(state: PyTree) -> PyTree:
    """Sizes of the leaves of a system's state, as its class tells them by coordinate; else 1."""
    scales = getattr(type(state), "scales", {})

    def sizes(name: str, leaves: PyTree) -> PyTree:
        return jtu.tree_map(lambda _: float(scales.get(name, 1.0)), leaves)

    return type(state)(*(sizes(name, leaves) for name, leaves in state._asdict().items()))


def si_units(units: Units) -> Units:
    """The same with each leaf of the state in SI units: for a tolerance that is told in these."""
    return units._replace(inverse=jtu.tree_map(lambda each: each / each, units.inverse))


def recurring_inverse_units(args: PyTree, count: int) -> Scalar:
    """`Units.inverse` of a minimal state without hip_x, shape (count,)."""
    if is_rigid(args) or not isinstance(args, AbstractScene):
        return jnp.ones(count)
    kind = args.minimal.state_type
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
    if isinstance(args, LinkageScene):
        return _linkage_sizes(args)
    if not is_walker(args):
        return args.time_unit, _own_sizes(states)
    length, gravity = float(args.mechanism.height), float(args.ground.g)
    time = float(np.sqrt(length / gravity)) if gravity > 0.0 else 1.0
    sizes: _Sizes = {(1, 0): length, (1, -1): length / time, (0, -1): 1.0 / time, (0, 0): 1.0}
    sizes[0, 1] = time
    return time, _by_dimension(states, sizes)


def _linkage_sizes(scene: LinkageScene) -> tuple[float, LinkageState]:
    """With the longest arm from a centre of mass to a joint for l; 1 where that is nothing."""
    length, fall = scene.linkage.longest_arm or 1.0, float(np.hypot(*scene.gravity))
    time = float(np.sqrt(length / fall)) if fall > 0.0 else 1.0
    turns = [1.0] * (scene.linkage.coordinates - 2)
    q = (length, length, *turns) * len(scene.linkage.bodies)
    return time, LinkageState(q, tuple(size / time for size in q))


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
