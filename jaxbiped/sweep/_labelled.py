"""Labelled starts: what became of each."""

from typing import NamedTuple

import numpy as np

from jaxbiped.basins._labels import label_names


class Labelled(NamedTuple):
    """What became of n starts: NumPy's arrays of shape (n,).

    Attributes:
        label: code of a `Label`.
        gait: the gait that it converges to, by its position in `Family.cycles`; −1 for none.
        cycle_footsteps: footsteps in that gait's cycle. Where the label is "unresolved" it is that
            of a cycle which the last footsteps repeated, of a gait that is not among the
            attractors.
        footsteps: heel strikes until the label was certain.
        time: simulated until then [s].
        distance: walked along the slope until then [m].
        rate: share of the distance from the gait that is left after a footstep, over the last
            cycle; NaN without a cycle, and where nothing but rounding is left of the distance.
        closest: smallest distance from any of the gaits, in its metric; infinite without arrival.
        attempted: how many steps the solver attempted; of all its solves, where there were more.
        final: last states on the section without hip_x, shape (n, m); infinite without arrival.
        doubt, disagreed, changed: where the accuracy was asked for by a number, codes of `Doubt`,
            sums of codes of `Witness`, and whether finer tolerances gave another label than the
            first; else None.
        grazes: steps in which a foot touches the ground or misses it by less than the tolerance
            resolves, where the accuracy was asked for by a number and the walker is compliant.
    """

    label: np.ndarray
    gait: np.ndarray
    cycle_footsteps: np.ndarray
    footsteps: np.ndarray
    time: np.ndarray
    distance: np.ndarray
    rate: np.ndarray
    closest: np.ndarray
    attempted: np.ndarray
    final: np.ndarray
    doubt: np.ndarray | None = None
    disagreed: np.ndarray | None = None
    changed: np.ndarray | None = None
    grazes: np.ndarray | None = None

    @property
    def names(self) -> np.ndarray:
        """The labels in words, "walking period-1" and so on, shape (n,)."""
        return label_names(self.label, self.cycle_footsteps)
