"""Labels: what became of a start, and whether that is in doubt."""

import enum

import numpy as np
import numpy.typing as npt

from jaxbiped._checks import ArgumentError
from jaxbiped._ending import Ending, NamedCode

WALKING_NAME = "walking period-{cycle_footsteps}"
"""What a start that walks is called, by the footsteps in a cycle of its gait."""


class Label(NamedCode):
    """What became of a start. `str(label)` is its name in words; every `Ending` of a walk is
    a label.

    - walking: it converges to a periodic gait.
    - fell forward, fell back, stopped, stumbled, out of steps, solver failed, timed out: as in
      `Ending`.
    - slid: a foot slid along the ground by more than a leg's length between two footsteps.
    - unresolved: all the footsteps asked for were walked, and nothing was certain yet.
    - pending: not labelled yet.
    """

    WALKING = Ending.WALKING.value
    FELL_FORWARD = Ending.FELL_FORWARD.value
    FELL_BACK = Ending.FELL_BACK.value
    STOPPED = Ending.STOPPED.value
    STUMBLED = Ending.STUMBLED.value
    OUT_OF_STEPS = Ending.OUT_OF_STEPS.value
    SOLVER_FAILED = Ending.SOLVER_FAILED.value
    SLID = 7
    UNRESOLVED = 8
    TIMED_OUT = Ending.TIMED_OUT.value
    PENDING = -1


def label_name(label: int, cycle_footsteps: int = 0) -> str:
    """A label in words, where it walks with the footsteps in a cycle of its gait.

    Args:
        label: code of a `Label`.
        cycle_footsteps: footsteps in the cycle of the gait.

    Returns:
        The name.

    Raises:
        ValueError: a code that no `Label` has.

    Examples:
        >>> import jaxbiped as jb
        >>> jb.basins.label_name(0, 2), jb.basins.label_name(1)
        ('walking period-2', 'fell forward')
    """
    walks = label == Label.WALKING
    return WALKING_NAME.format(cycle_footsteps=cycle_footsteps) if walks else str(Label(label))


def label_names(label: npt.ArrayLike, cycle_footsteps: npt.ArrayLike) -> np.ndarray:
    """`label_name` of every entry; arrays of one shape.

    Args:
        label: codes of `Label`, any shape.
        cycle_footsteps: footsteps in the cycle of each gait, a shape that broadcasts with it.

    Returns:
        Names, of the broadcast shape.

    Raises:
        ValueError: a code that no `Label` has.

    Examples:
        >>> import jaxbiped as jb
        >>> jb.basins.label_names([0, 7], [1, 0]).tolist()
        ['walking period-1', 'slid']
    """
    return np.asarray(np.vectorize(label_name, otypes=[object])(label, cycle_footsteps))


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


def check_label_grid(labels: npt.ArrayLike) -> np.ndarray:
    """Label codes on a grid of one or more dimensions, none of them pending.

    Raises:
        ArgumentError: no entry, no axis, codes that are not whole numbers, or a pending one.
    """
    grid = np.asarray(labels)
    if grid.ndim == 0 or grid.size == 0:
        raise ArgumentError(
            f"labels has shape {grid.shape}: it must be a grid with at least one entry."
        )
    if grid.dtype.kind not in "iu":
        raise ArgumentError(f"labels has dtype {grid.dtype}: it must be whole numbers, the codes.")
    pending = int((grid == Label.PENDING).sum())
    if pending:
        raise ArgumentError(
            f"labels has {pending} pending entries of {grid.size}: they must all be labelled."
        )
    return grid


def check_known(labels: np.ndarray) -> None:
    """Raises `ArgumentError` for whole numbers that are no code of `Label`."""
    unknown = sorted(set(np.unique(labels).tolist()) - set(map(int, Label)))
    if unknown:
        raise ArgumentError(f"labels holds {unknown[0]}: it must hold names or codes of Label.")
