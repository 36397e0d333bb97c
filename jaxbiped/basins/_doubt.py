"""Doubt about labels: where several solves of one start do not agree."""

import enum


class Doubt(enum.IntEnum):
    """Whether a label was, or is, in doubt.

    - none: all three solves gave the same label, and no foot grazed the ground.
    - settled: they did not, or one did; at two finer tolerances in a row two methods gave this one.
    - remains: no two tolerances in a row did; the label is that of the finest.
    """

    NONE = 0
    SETTLED = 1
    REMAINS = 2


class Witness(enum.IntFlag):
    """Which solves gave another label than the first: at a looser tolerance, by another method."""

    LOOSER = 1
    OTHER = 2
