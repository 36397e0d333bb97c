"""Rigid walk to a wanted accuracy, with estimates of its global error by two witnesses.

One witness is the same method at a looser tolerance, the other steps by its embedded method.
"""

import dataclasses

import jax
import jax.tree_util as jtu

from jaxbiped._checks import ArgumentError
from jaxbiped._ending import Ending
from jaxbiped.dynamics._rigid_state import RigidState
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
_FALLS = (Ending.FELL_FORWARD, Ending.FELL_BACK)
_MOST_ON = 64
"""Steps by which a fall is followed to the time at which another solve noticed it."""


def accurate_rigid_walk(run: RigidSimulation, wanted: float) -> Trajectory[RigidState]:
    """The walk whose estimated relative error is at most `wanted`, or as small as can be had.

    A fall is noticed at the end of a step; its bars are those of the state at that very time.

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
        witnesses = tuple(Witness(_as_long(each, walk), 1.0) for each in (looser, other))
        return walk, judge_walk(run.walk.scene, walk, witnesses)

    first = min(_FIRST * wanted, _LOOSEST)
    dtype = run.walk.rtol.dtype
    walk, error = refine(attempt, wanted, first=first, dtype=dtype, finest=_FINEST)
    return dataclasses.replace(walk, error=error)


def _as_long(witness: RigidSimulation, walk: Trajectory[RigidState]) -> Trajectory[RigidState]:
    """Another solve; of a walk that fell, up to the time at which it did."""
    if walk.outcome not in _FALLS:
        return witness()
    end = float(walk.t[-1])
    told = witness.with_inputs(duration=end)()
    for _ in range(_MOST_ON):
        left = end - float(told.t[-1])
        if told.outcome not in _FALLS or left <= 0.0:
            break
        # It lies below what counts as fallen: each solve from there ends after one step.
        on = dataclasses.replace(
            witness, walk=witness.walk._replace(state=told.final), max_arrivals=0
        ).with_inputs(duration=left)()
        told = dataclasses.replace(told, t=end - left + on.t, state=on.state, ending=on.ending)
    return told
