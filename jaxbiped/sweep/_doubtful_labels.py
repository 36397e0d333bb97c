"""Doubtful labels: starts whose label is in doubt are labelled again more tightly.

A label is a category, whose error is no small number: near a boundary any tolerance may lead to
either side. So each start is solved three times, and again more tightly where these disagree.
"""

from collections.abc import Callable
from typing import Any

import jax.tree_util as jtu
import numpy as np

from jaxbiped.basins._labels import Doubt, Witness
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.solve._accuracy import resolve_slip_speed
from jaxbiped.solve._error_estimate import LOOSER
from jaxbiped.solve._solvers import solver_named
from jaxbiped.solve.rosenbrock._rodas import Rodas5P
from jaxbiped.sweep._follow_starts import Effort
from jaxbiped.sweep._labelling_loop import Labelled

_FINER = 10.0
"""From one tolerance to the next."""
_FINEST = {True: 1e-10, False: 1e-13}
"""Finest tolerance that is tried, compliant or not."""
_LEAST = 2.0
"""How many times looser the looser tolerance is at least."""
_STEPS = 2
"""How many times more steps a finer tolerance may take."""

Follow = Callable[[np.ndarray, Effort], Labelled]
"""Labels of the starts with these numbers, by one solve of each."""


def relabel_doubtful(
    follow: Follow, count: int, effort: Effort, scene: Scene | RigidScene
) -> Labelled:
    """Labels of n starts, solved again where they are in doubt; no start's depends on another's.

    In doubt is what a ten times looser tolerance or another method of steps labels otherwise, and
    what grazes the ground: whether there was a contact may decide. It is solved by both methods at
    ten times finer tolerances, until all four labels of two tolerances in a row agree; where they
    never do the doubt remains. The effort is that of the first solve.
    """
    every = np.arange(count)
    first, other = follow(every, effort), follow(every, _by_other_method(effort))
    # One that leaves slip unresolved doubts three times more labels, and finds no more wrong ones.
    loose = max(float(resolve_slip_speed(LOOSER * effort.rtol, scene)), _LEAST * effort.rtol)
    looser = follow(every, effort._replace(rtol=loose))
    agree = ~_differ(first, other)
    disagreed = np.where(_differ(first, looser), int(Witness.LOOSER), 0)
    disagreed = disagreed + np.where(agree, 0, int(Witness.OTHER))
    # A copy: what is settled is written into it.
    label = jtu.tree_map(np.array, first)
    label.attempted[:] += looser.attempted + other.attempted
    doubtful = disagreed > 0 if first.grazes is None else (disagreed > 0) | (first.grazes > 0)
    doubt = np.where(doubtful, int(Doubt.REMAINS), int(Doubt.NONE))
    open_ = np.flatnonzero(doubtful)
    agree, finer, finest = agree[open_], effort, _FINEST[scene.compliant]
    while len(open_) and finer.rtol > 1.001 * finest:
        finer = finer._replace(rtol=max(finer.rtol / _FINER, finest))
        finer = finer._replace(max_attempts=_STEPS * finer.max_attempts)
        found, check = follow(open_, finer), follow(open_, _by_other_method(finer))
        agree_now = ~_differ(found, check)
        settled = agree & agree_now & ~_differ(found, _some(label, open_))
        found.attempted[:] += check.attempted + label.attempted[open_]
        for into, values in zip(jtu.tree_leaves(label), jtu.tree_leaves(found), strict=True):
            into[open_] = values
        doubt[open_[settled]] = int(Doubt.SETTLED)
        open_, agree = open_[~settled], agree_now[~settled]
    return label._replace(
        doubt=doubt.astype(np.int8),
        disagreed=disagreed.astype(np.int8),
        changed=_differ(label, first).astype(np.int8),
    )


def _by_other_method(effort: Effort) -> Effort:
    """Another method of steps: of the rigid walker the embedded one."""
    name = "rodas4p" if isinstance(effort.solver, Rodas5P) else "rodas5p"
    solver: Any = solver_named(name)
    return effort._replace(solver=solver, embedded=True)


def _differ(one: Labelled, another: Labelled) -> np.ndarray:
    """Whether starts have other labels, gaits or cycles (boolean)."""
    differ = one.label != another.label
    return differ | (one.gait != another.gait) | (one.cycle_footsteps != another.cycle_footsteps)


def _some(labelled: Labelled, places: np.ndarray) -> Labelled:
    return jtu.tree_map(lambda leaf: leaf[places], labelled)
