"""Retracing: whether a point of a branch is a gait that the branch has passed before."""

from collections.abc import Sequence

import numpy as np

from jaxbiped.continuation._branch_point import BranchPoint
from jaxbiped.gait._pseudo_arclength import Curve, CurvePoint, correct

_ASIDE = 0.1
"""Distance from a chord between two points, in its length, up to which the curve is asked."""
_SAME, _CORRECTIONS = 1e-7, 10.0
"""Distance of two gaits that are one, at least; and in units of the corrector's last step."""


def passed_before(curve: Curve, passed: Sequence[BranchPoint], there: CurvePoint) -> float | None:
    """Whether a point lies on the curve through points that are passed, in their order.

    Returns:
        The cosine between the tangents there; None where it is another gait than all of them.
    """
    if len(passed) < 2:
        return None
    places, tangents = (
        np.stack([getattr(p, name) for p in passed]) for name in ("place", "tangent")
    )
    chords = np.diff(places, axis=0)
    lengths = np.linalg.norm(chords, axis=1)
    off = there.place - places[:-1]
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = np.sum(off * chords, axis=1) / lengths**2
    aside = np.linalg.norm(off - shares[:, None] * chords, axis=1)
    for k in np.flatnonzero((shares >= 0.0) & (shares <= 1.0) & (aside < _ASIDE * lengths)):
        # In the plane through the point normal to the chord, which is crossed once, also at a fold.
        t, along = shares[k], chords[k] / lengths[k]
        bend = lengths[k] * ((1.0 - t) * tangents[k] - t * tangents[k + 1])
        guess = places[k] + t * chords[k] + t * (1.0 - t) * (bend - (bend @ along) * along)
        known = correct(curve, guess, along, along).found
        if known is None:
            continue
        apart = np.linalg.norm(known.place - there.place)
        if apart < max(_SAME, _CORRECTIONS * curve.converged):
            return float(known.tangent @ there.tangent)
    return None
