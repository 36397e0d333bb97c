"""Goals: gaits that starts may converge to, as numbers that a labelling loop reads."""

import math
from typing import NamedTuple

from jaxbiped._types import Numbers

NO_GAIT = -math.inf
"""Radius of a place for a gait that holds none."""


class Goals(NamedTuple):
    """G gaits of a scene, their states without hip_x having m components.

    Attributes:
        points: a state of each on the section, shape (G, m).
        metrics: W, shape (G, m − 1, m): |W (x − point)| falls from cycle to cycle near the gait.
        models: B, shape (G, m − 1, m − 1): the offset W (x − point) is B times that after a cycle,
            by the derivative of the return map.
        slowest: ℓ, shape (G, 2, m): |ℓ (x − point)| is the offset along the eigenvectors of the
            leading multiplier, of its real and its imaginary part.
        contractions: of the distance in a cycle, half-way between the spectral radius and 1, (G,).
        radii: distance, so measured, within which every start converges; negative where none is
            known to. Shape (G,).
        scales: size of each component, by which recurrences are measured; shape (m,).
    """

    points: Numbers
    metrics: Numbers
    models: Numbers
    slowest: Numbers
    contractions: Numbers
    radii: Numbers
    scales: Numbers
