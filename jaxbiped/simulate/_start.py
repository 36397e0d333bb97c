"""Checks of how a simulation starts and steps."""

import diffrax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_positive, check_unbatched, holds_somewhere
from jaxbiped._types import Scalar
from jaxbiped.constraints._projection import check_independent
from jaxbiped.dynamics._consistent_state import Consistent, consistent_state
from jaxbiped.dynamics._redundant_motion import coordinates_of
from jaxbiped.dynamics._state import state_for
from jaxbiped.scene._ground import Ground
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.scene._walker import Walker
from jaxbiped.scene.actuation._catalogue import ACTUATORS
from jaxbiped.scene.laws._catalogue import FRICTION_LAWS, NORMAL_LAWS

_PRECISIONS = (np.float16, np.float32, np.float64)
"""Of NumPy's, those that JAX has."""


def start_for(scene: Scene | RedundantScene, state: PyTree) -> tuple[PyTree, Consistent | None]:
    """A checked start of the kind that a scene needs, and how it was put on its constraints.

    Raises:
        ArgumentError: a start that is not allowed, or constraints that the method cannot hold.
    """
    check_single_scene(scene)
    if not isinstance(scene, RedundantScene):
        start = state_for(scene, in_own_precision(state))
        check_unbatched("state", start, "one start")
        return in_one_precision(start), None
    state = in_own_precision(state)
    check_unbatched("state", state, "one start")
    correction = consistent_state(scene, state)
    q, _ = coordinates_of(scene, correction.state)
    check_independent(scene.linkage, scene.method, q)
    return correction.state, correction


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
    own = (*NORMAL_LAWS.values(), *FRICTION_LAWS.values(), Walker, Ground)
    for name, part in vars(scene.minimal).items():
        if type(part) in own:
            check_unbatched(f"scene.{name}", part, "one scene")
    for part in scene.actuation or ():
        if type(part) in ACTUATORS.values():
            check_unbatched("scene.actuation", part, "one scene")


def check_steps(
    solver: diffrax.AbstractSolver[PyTree],
    dt: float | None,
    *,
    most_steps: int,
    duration: Scalar | float,
) -> None:
    """Raises `ArgumentError` for steps that a solver cannot make or the cap on steps forbids."""
    if dt is None:
        if isinstance(solver, diffrax.Euler):
            raise ArgumentError(
                "dt = None is not allowed for solver = euler, whose steps have one size: give it "
                "in seconds, such as dt = 1e-6."
            )
        return
    check_unbatched("dt", dt)
    check_positive("dt", dt, "s")
    if holds_somewhere(duration > dt * most_steps):
        raise ArgumentError(
            f"dt = {float(dt):g} is not allowed: {float(duration):g} s of such steps are more than "
            f"max_solver_steps = {most_steps}; simulate less time, or allow more."
        )
