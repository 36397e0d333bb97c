"""Fixed steps: a walk by steps of one size is held against two by steps of others.

Such steps control no error. Where they are too long the walk goes wrong without a sign of its own.
About switches of the laws errors are erratic: of one other solve, as wrong by chance, nothing is
seen.
"""

import dataclasses
import warnings

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped._ending import Ending
from jaxbiped.simulate._simulation import Simulation
from jaxbiped.solve._trajectory import Trajectory
from jaxbiped.solve._units import relative_to_scene

_LONG = 1e-2
"""Relative change of the final state by other steps from which steps are too long."""
_MANY = 8
"""Steps from which the other ones are longer, and cost less; those of fewer are shorter."""
_LONGER, _SHORTER = (2.0, 2.0**0.5), (1.0 / 2.0, 1.0 / 3.0)


def warn_of_missed_contacts(run: Simulation, walk: Trajectory) -> None:
    """Warns where steps of one size stepped over contacts; nothing is known while tracing."""
    missed = walk.missed_contacts
    if run.dt is None or missed is None or isinstance(missed, jax.core.Tracer) or not int(missed):
        return
    warnings.warn(
        f"dt = {float(run.dt):g} steps over contacts: a foot dips into the ground and leaves it "
        f"between two steps, {int(missed)} times; take shorter steps, or tolerances.",
        RuntimeWarning,
        stacklevel=3,
    )


def warn_of_long_steps(run: Simulation, walk: Trajectory) -> None:
    """Warns where other steps of one size lead elsewhere; nothing is known while tracing.

    Compiles nothing: steps are an input of the program.
    """
    leaves = jtu.tree_leaves((run, walk))
    if run.dt is None or any(isinstance(leaf, jax.core.Tracer) for leaf in leaves):
        return
    if walk.outcome in (Ending.SOLVER_FAILED, Ending.OUT_OF_STEPS):
        return
    many = float(run.duration) >= _MANY * float(run.dt) or run.max_solver_steps < 2 * _MANY
    base = run.dt if many else jnp.minimum(run.dt, run.duration)
    for factor in _LONGER if many else _SHORTER:
        dt = factor * base
        other = dataclasses.replace(run, dt=dt)()
        found = _change(run, walk, other)
        if found:
            break
    else:
        return
    warnings.warn(
        f"dt = {float(run.dt):g} is too long: with steps of {float(dt):g} s {found}; take shorter "
        "steps, or tolerances.",
        RuntimeWarning,
        stacklevel=3,
    )


def _change(run: Simulation, walk: Trajectory, other: Trajectory) -> str:
    """How far another solve leads elsewhere; "" for not far."""
    if int(other.ending) != int(walk.ending):
        return f"it ends as {other.outcome} instead of {walk.outcome}"
    apart = jtu.tree_map(lambda a, b: np.abs(np.asarray(a - b)), walk.final, other.final)
    change = relative_to_scene(run.scene.minimal, np.zeros(()), apart)
    return "" if change <= _LONG else f"the relative change of its final state is {change:.2g}"
