"""Forces of the laws by formulas written a second time."""

import numpy as np
from reference.compliant import FRICTION, NORMAL, friction_share, normal_force

_LONGEST = 9
"""Numbers of a law at most: which one it is, and its parameters."""


def by_number(law):
    """A law as the independent equations take it."""
    values = [float(value) for value in vars(law).values() if value is not None]
    kinds = NORMAL if law.name in NORMAL else FRICTION
    return np.array([kinds.index(law.name), *values, *[0.0] * (_LONGEST - 1 - len(values))])


def normal_forces(law, depths, rates):
    numbers = by_number(law)
    return np.vectorize(lambda *at: normal_force(*at, numbers))(depths, rates)


def friction_shares(law, loads, slips, bristles=0.0):
    """Friction against the slip over the load, and the rates of bristles in contact."""
    numbers = by_number(law)
    return np.vectorize(lambda *at: friction_share(*at, numbers))(loads, slips, bristles)
