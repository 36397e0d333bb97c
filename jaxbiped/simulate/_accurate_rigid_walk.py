"""Rigid walk to a wanted accuracy, with estimates of its global error by two witnesses.

One witness is the same method at a looser tolerance, the other steps by its embedded method.
"""

import dataclasses

import jax
import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped.dynamics._state import RigidState
from jaxbiped.simulate._accurate_walk import Witness, judge_walk
from jaxbiped.simulate._rigid_simulation import RigidSimulation
from jaxbiped.solve._accuracy import ACCURACIES
from jaxbiped.solve._error_estimate import LOOSER, Judged, refine
from jaxbiped.solve._trajectory import Trajectory

_FIRST = 1e-1
"""First tolerance as a share of the relative error wanted."""
_EMBEDDED = 0.3
"""Tolerance of the embedded method's witness over the walk's: its errors are those that the
tolerance bounds, which the walk's are 10 to 30 times below."""
_FINEST = 1e-13
"""Finest relative tolerance: rolling is smooth and never stiff."""
_LOOSEST = 1e-3
"""Loosest tolerance to begin with."""


def accurate_rigid_walk(run: RigidSimulation, wanted: float) -> Trajectory[RigidState]:
    """The walk whose estimated relative error is at most `wanted`, or as small as can be had.

    Raises:
        ArgumentError: under `jit`, `vmap` or differentiation.
    """
    if any(isinstance(leaf, jax.core.Tracer) for leaf in jtu.tree_leaves(run)):
        raise ArgumentError(
            f"accuracy = {wanted:g} is not allowed under jit, vmap or differentiation: name one of "
            f"{', '.join(ACCURACIES)} there."
        )

    def attempt(tolerance: float) -> tuple[Trajectory[RigidState], Judged]:
        walk = run.with_inputs(rtol=tolerance)()
        looser = run.with_inputs(rtol=LOOSER * tolerance)
        other = run.with_inputs(rtol=_EMBEDDED * tolerance, embedded=True)
        witnesses = tuple(Witness(each(), 1.0) for each in (looser, other))
        bars, relative, obstacle = judge_walk(run.walk.scene, walk, witnesses)
        assert walk.grazes is not None
        # Whether a foot that grazes the ground strikes is for a finer tolerance to tell.
        return walk, (bars, np.inf if int(walk.grazes) else relative, obstacle)

    first = min(_FIRST * wanted, _LOOSEST)
    dtype = run.walk.rtol.dtype
    walk, error = refine(attempt, wanted, first=first, dtype=dtype, finest=_FINEST)
    return dataclasses.replace(walk, error=error)
