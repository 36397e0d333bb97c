"""Classes and functions of a user's own, for tests of laws and for files that name them."""

import enum
from typing import NamedTuple

import numpy as np

import jaxbiped as jb


class Grip(jb.laws.AbstractFrictionLaw):
    """F = grip F_N V_T, opposing V_T."""

    grip: float = jb.laws.parameter("grip per slip", "$G$", "s/m", minimum=0.0)

    def force(self, normal_force, slip_speed):
        return -self.grip * normal_force * slip_speed

    def switches(self, slip_speed):
        return ()


class Side(enum.Enum):
    LEFT = "left"


class Note(NamedTuple):
    side: Side
    numbers: object = None


def half(value):
    return 0.5 * np.asarray(value)
