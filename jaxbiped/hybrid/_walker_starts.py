"""Starts of walkers: in one precision, of one scene, and not below the ground."""

from typing import NamedTuple

import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_unbatched, warn
from jaxbiped._jax_versions import untraced
from jaxbiped._types import Scalar, as_float, is_traced
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._constrained_motion import Consistent, consistent_state
from jaxbiped.dynamics._contacts import feet, limits_of
from jaxbiped.dynamics._footfalls import touches
from jaxbiped.dynamics._state import check_state, state_for, without_whole_turns
from jaxbiped.scene._modes import check_mode, rigid_modes
from jaxbiped.scene._scene import CompliantScene, RedundantScene, RigidScene, Scene

_PRECISIONS = (np.float16, np.float32, np.float64)
"""Of NumPy's, those that JAX has."""
_DEEPEST = 0.25
"""Penetration of a foot that touches, in units of l, from which it starts below the ground."""
_HIGHEST = 100.0
"""Energy stored in a foot's contact, in units of m g l, from which it does."""
_TOLD_DEPTH = 0.01
"""Penetration of a foot that is reported, in units of the walker's height."""
_TOLD_ANGLE = 0.1
"""Angle beyond a stop that is reported [rad]."""


def walking_start(scene: Scene, state: PyTree) -> PyTree:
    """A checked start of the kind that a scene needs.

    Raises:
        ArgumentError: a start that is not allowed.
    """
    check_single_scene(scene)
    start = state_for(scene, in_own_precision(state))
    check_unbatched("state", start, "one start")
    return in_one_precision(start)


def rolling_start(scene: RigidScene, state: PyTree) -> PyTree:
    """A checked start on rigid feet, in a mode that can occur.

    Raises:
        ArgumentError: a start that is not allowed.
    """
    check_single_scene(scene)
    state = check_state(in_own_precision(state), scene.state_type)
    start = in_one_precision(without_whole_turns(scene, state))
    check_unbatched("state", start, "one start")
    if (modes := rigid_modes(scene.mechanism)).any:
        check_mode(scene.mechanism, modes, scene.ground.slope, start)
    return start


def consistent_start(scene: RedundantScene, state: PyTree) -> Consistent:
    """A checked start that was put on its constraints.

    A walker's are independent: its hinges make a tree, and couplings that repeat each other are
    no mechanism.

    Raises:
        ArgumentError: a start that is not allowed.
    """
    check_single_scene(scene)
    state = in_own_precision(state)
    check_unbatched("state", state, "one start")
    return consistent_state(scene, state)


def in_own_precision(state: PyTree) -> PyTree:
    """A start with NumPy's floating-point leaves as arrays of JAX, which keep their precision."""

    def kept(leaf: object) -> object:
        own = isinstance(leaf, np.ndarray | np.generic) and leaf.dtype in _PRECISIONS
        return jnp.asarray(leaf) if own else leaf

    return jtu.tree_map(kept, state)


def in_one_precision(state: PyTree) -> PyTree:
    """A start with all leaves as precise as the most precise one."""
    kinds = {leaf.dtype for leaf in jtu.tree_leaves(state)}
    if len(kinds) == 1:
        return state
    finest = max(kinds, key=lambda kind: jnp.finfo(kind).bits)
    return jtu.tree_map(lambda leaf: leaf.astype(finest), state)


def check_single_scene(scene: Scene | RigidScene | RedundantScene) -> None:
    """Raises `ArgumentError` for a batch of scenes.

    Laws of the user's own may hold arrays.
    """
    parts = [*vars(scene.minimal).items(), *(("actuation", part) for part in scene.actuation or ())]
    for name, part in parts:
        if type(part).__module__.partition(".")[0] == "jaxbiped":
            check_unbatched(f"scene.{name}", part, "one scene")


@untraced()
def check_start_height(scene: Scene | RedundantScene, state: PyTree) -> None:
    """Refuses a start in minimal coordinates below the ground, where all values are known.

    The deepest that is allowed is l/4, and so deep that the contact stores what would throw the
    walker a hundred legs high, 100 m g l: contact so stiff is to be started near its surface.

    Raises:
        ArgumentError: a deeper start.
    """
    if is_traced((scene, state)):
        return
    state = jtu.tree_map(as_float, state)
    root = f"{scene.mechanism.structure.root}_z"
    if not hasattr(state, root):
        return
    # Plain numbers: operations of JAX by themselves would be compiled one by one.
    mechanism = scene.mechanism
    structure, length = mechanism.structure, float(mechanism.height)
    lift = float(mechanism.total_mass) * float(scene.ground.g) * length
    height = float(getattr(state, root))
    if height <= 0.0:
        raise ArgumentError(
            f"state.{root} = {height:g} is not allowed: the walker starts below the ground, its "
            f"{structure.root} under the surface; start higher."
        )
    begun = _contacts_at(scene, state)
    depths, energies, passed = (list(map(float, each)) for each in begun)
    names = structure.feet_told
    stored, depth, foot = max(zip(energies, depths, names, strict=True))
    if stored > 0.0 and (depth > _DEEPEST * length or stored > _HIGHEST * lift > 0.0):
        raise ArgumentError(
            f"state.{root} = {height:g} is not allowed: foot {foot} starts {depth:.3g} m below the "
            f"ground, where its contact stores {stored:.3g} J (m g l is {lift:.3g} J); it just "
            f"touches at {root} = {height + depth:.9g}."
        )
    if stored > 0.0 and depth > _TOLD_DEPTH * length:
        warn(
            f"foot {foot} starts {depth:.3g} m below the ground; it just touches at "
            f"{root} = {height + depth:.9g}.",
            UserWarning,
        )
    if passed and max(passed) > _TOLD_ANGLE:
        warn(
            f"a stop is passed by {max(passed):.3g} rad at the start: begin within its limits.",
            UserWarning,
        )


class _Begun(NamedTuple):
    """Contacts at a start, in lists.

    Attributes:
        depths: of each foot [m].
        energies: in its contact, 0 where it does not touch [J].
        passed: how far each limit of a stop is passed [rad].
    """

    depths: list[Scalar]
    energies: list[Scalar]
    passed: list[Scalar]


@cached_jit
def _contacts_at(scene: CompliantScene, state: PyTree) -> _Begun:
    found = feet(scene, state)
    energies = [
        jnp.where(touches(foot), scene.normal.elastic_energy(foot.penetration), 0.0)
        for foot in found
    ]
    passed = [limit.penetration for _, limit in limits_of(scene, state)]
    return _Begun([foot.penetration for foot in found], energies, passed)
