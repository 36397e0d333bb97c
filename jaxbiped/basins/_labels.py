"""Labels: what became of a start, whether that is in doubt, and how many are likely wrong."""

import enum
import functools
import json
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jaxbiped._checks import ArgumentError, warn
from jaxbiped._ending import FIRST_OF_A_SYSTEM, Ending, NamedCode, endings_named
from jaxbiped._files import JsonObject

if TYPE_CHECKING:
    import xarray

WALKING_NAME = "{motion} period-{cycle_footsteps}"
"""What a start is called that converges to a gait, by the footsteps in a cycle of its gait."""
PERIODIC = "periodic"
"""What the motion of a hybrid system is called that converges to a cycle."""
ENDINGS = "endings"
"""Attribute of a dataset's labels that holds, as JSON, the names of a hybrid system's endings."""
ERRORS = "label_errors"
"""Attribute that holds, as JSON, the estimated errors of labels."""
_QUANTILE = 1.96
"""Of the normal distribution, for a two-sided 95 % interval."""


class Label(NamedCode):
    """What became of a start. `str(label)` is its name in words; every `Ending` of a walk is
    a label. Codes from 100 on are the endings that a hybrid system names.

    - walking: it converges to a periodic gait. A hybrid system, which does not walk, is "periodic".
    - fell forward, fell back, stopped, stumbled, out of steps, solver failed, timed out, chatters:
      as in `Ending`.
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
    CHATTERS = Ending.CHATTERS.value
    PENDING = -1


def label_name(
    label: int, cycle_footsteps: int = 0, *, endings: Sequence[str] | None = None
) -> str:
    """A label in words, where it walks with the footsteps in a cycle of its gait.

    Args:
        label: code of a `Label`, or of an ending that a hybrid system names.
        cycle_footsteps: footsteps in the cycle of the gait.
        endings: names of the endings of a hybrid system (`Labelled.endings`); None for a walker.

    Returns:
        The name.

    Raises:
        ValueError: a code that no `Label` has, nor any of the endings.

    Examples:
        >>> import jaxbiped as jb
        >>> jb.basins.label_name(0, 2), jb.basins.label_name(1)
        ('walking period-2', 'fell forward')
    """
    if label == Label.WALKING:
        motion = str(Label.WALKING) if endings is None else PERIODIC
        return WALKING_NAME.format(motion=motion, cycle_footsteps=cycle_footsteps)
    return word_of_code(label, endings)


def word_of_code(label: int, endings: Sequence[str] | None = None) -> str:
    """The word for a code of `Label` or of an ending that a hybrid system names.

    Raises:
        ValueError: a code that no `Label` has, nor any of the endings.
    """
    if endings is None:
        return str(Label(label))
    if label == Label.WALKING:
        return PERIODIC
    return str(Label(label) if label < FIRST_OF_A_SYSTEM else endings_named(tuple(endings))(label))


def label_names(
    label: npt.ArrayLike,
    cycle_footsteps: npt.ArrayLike,
    *,
    endings: Sequence[str] | None = None,
) -> np.ndarray:
    """`label_name` of every entry; arrays of one shape.

    Args:
        label: codes of `Label`, any shape.
        cycle_footsteps: footsteps in the cycle of each gait, a shape that broadcasts with it.
        endings: names of the endings of a hybrid system (`Labelled.endings`). Default: those that
            `label` tells, if it is a variable of a sweep's dataset; else those of a walker.

    Returns:
        Names, of the broadcast shape.

    Raises:
        ValueError: a code that no `Label` has, nor any of the endings.

    Examples:
        >>> import jaxbiped as jb
        >>> jb.basins.label_names([0, 7], [1, 0]).tolist()
        ['walking period-1', 'slid']
    """
    endings = endings_of(label) if endings is None else endings
    name = functools.partial(label_name, endings=endings)
    return np.asarray(np.vectorize(name, otypes=[object])(label, cycle_footsteps))


def endings_of(labels: object) -> tuple[str, ...] | None:
    """Names of the endings of the hybrid system whose labels these are, as a dataset keeps them.

    None for labels of a walker, and for those that tell nothing.
    """
    names = getattr(labels, "attrs", {}).get(ENDINGS)
    return None if names is None else tuple(json.loads(names))


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
        ArgumentError: no entry, no axis, no whole numbers, a pending code, or a list of starts.
    """
    check_no_dataset(labels)
    if _lists_starts(labels):
        raise ArgumentError(
            "labels is a list of starts, which are no neighbours, as of a sample or of a table's "
            "column: it must be a grid, such as the labels of a sweep over `jaxbiped.starts.grid`."
        )
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


def check_no_dataset(labels: object) -> None:
    """Raises `ArgumentError` for a whole dataset."""
    if hasattr(labels, "data_vars"):
        raise ArgumentError("labels is a whole dataset, which is not allowed: give its `label`.")


def _lists_starts(labels: Any) -> bool:
    """Whether an axis numbers starts, or what lies along it has no coordinates in order."""
    for name in getattr(labels, "dims", ()):
        # By `dict`: where there are none, xarray makes up numbers.
        index = np.asarray(dict(labels.coords).get(name))
        steps = np.diff(index) if index.dtype.kind in "iuf" else np.full(1, np.nan)
        along = any(name in coordinate.dims for coordinate in labels.coords.values())
        if name == "start" or (along and not (np.all(steps > 0) or np.all(steps < 0))):
            return True
    return hasattr(labels, "iloc") and np.ndim(labels) == 1


def check_known(labels: np.ndarray, endings: Sequence[str] | None = None) -> None:
    """Raises `ArgumentError` for whole numbers that are no code of `Label` or of the endings."""
    codes = {*map(int, Label), *range(FIRST_OF_A_SYSTEM, FIRST_OF_A_SYSTEM + len(endings or ()))}
    unknown = sorted(set(np.unique(labels).tolist()) - codes)
    if not unknown:
        return
    if unknown[0] >= FIRST_OF_A_SYSTEM:
        raise ArgumentError(
            f"labels holds {unknown[0]}, an ending that a hybrid system names: give the names of "
            "label_names, or the label of a sweep's dataset."
        )
    raise ArgumentError(f"labels holds {unknown[0]}: it must hold names or codes of Label.")


class LabelErrors(NamedTuple):
    """Estimated errors of labels that were asked for by a number.

    Attributes:
        starts: how many were labelled.
        wanted: share of the labels that may be wrong.
        relabelled: starts that were in doubt, and labelled anew at finer tolerances.
        changed: how many of them got another label.
        in_doubt: how many of them remain in doubt, and are flagged.
        wrong: estimated share of wrong labels among those that are not flagged.
        wrong_high: upper end of its interval, 95 %.
        rtol: relative tolerance at which every start was labelled at last.
        met: whether `wrong_high` is at most `wanted`.
    """

    starts: int
    wanted: float
    relabelled: int
    changed: int
    in_doubt: int
    wrong: float
    wrong_high: float
    rtol: float
    met: bool

    @property
    def fewest(self) -> int:
        """Smallest number of starts that can confirm that accuracy, if no label is in doubt."""
        return math.ceil(_upper_end(0.0, 0.0) / self.wanted)

    def numbers(self) -> JsonObject:
        """Ready for JSON."""
        return self._asdict()

    def sentence(self) -> str:
        """The errors in one sentence."""
        told = (
            f"{self.relabelled} of {self.starts} labels were in doubt at a tolerance of "
            f"{self.rtol:.1e} and labelled again; {self.changed} of them changed and "
            f"{self.in_doubt} remain in doubt; of the others, a fraction of {self.wrong:.1e} "
            f"(up to {self.wrong_high:.1e}) is estimated to be wrong"
        )
        if self.met:
            return f"{told}, of {self.wanted:g} allowed"
        if self.starts < self.fewest:
            told += f"; fewer than {self.fewest} starts cannot confirm it"
        return f"accuracy = {self.wanted:g} is not met: {told}."

    def warn(self) -> None:
        """Issues a `RuntimeWarning` where the accuracy is not met."""
        if not self.met:
            warn(self.sentence())


def label_errors(found: "xarray.Dataset") -> LabelErrors:
    """Estimated errors of a sweep's labels.

    Args:
        found: what `sweep` returned, or the store that it wrote.

    Returns:
        How many labels were in doubt, how many of them remain so, and how many of the others are
        likely to be wrong.

    Raises:
        ArgumentError: the sweep's accuracy was not asked for by a number.
    """
    text = found.attrs.get(ERRORS)
    if text is None:
        raise ArgumentError(
            "found has no error estimates of its labels: it must be a sweep of a labelling whose "
            "accuracy is a number."
        )
    return LabelErrors(**json.loads(text))


class Seen(NamedTuple):
    """Counts of starts, from which errors are estimated.

    Attributes:
        starts: all of them.
        relabelled, changed, in_doubt: see `LabelErrors`.
        looser, other, both: settled starts whose label changed, by who had disagreed with it: the
            looser tolerance, the other method, both.
    """

    starts: int = 0
    relabelled: int = 0
    changed: int = 0
    in_doubt: int = 0
    looser: int = 0
    other: int = 0
    both: int = 0

    def __add__(self, more: object) -> "Seen":
        assert isinstance(more, Seen)
        return Seen(*[a + b for a, b in zip(self, more, strict=True)])


def estimate_label_errors(seen: Seen, *, wanted: float, rtol: float) -> LabelErrors:
    """What the witnesses did not see, from how often both saw what one of them saw.

    Wrong labels are counted as animals are by capture and recapture: of two witnesses who overlook
    independently of each other, the share of what one saw that the other saw as well is the other's
    recall. Chapman, "Some properties of the hypergeometric distribution with applications to
    zoological sample censuses", Univ. Calif. Publ. Stat. 1 (1951) 131; the variance is Seber's.
    """
    a, b, ab = seen.looser, seen.other, seen.both
    # Chapman's (a + 1)(b + 1)/(ab + 1) − 1 in all, less those that were seen.
    overlooked = (a - ab) * (b - ab) / (ab + 1.0)
    variance = (a + 1.0) * (b + 1.0) * (a - ab) * (b - ab) / ((ab + 1.0) ** 2 * (ab + 2.0))
    wrong_high = min(1.0, _upper_end(overlooked, variance) / seen.starts)
    return LabelErrors(
        seen.starts,
        wanted,
        *(seen.relabelled, seen.changed, seen.in_doubt),
        wrong=overlooked / seen.starts,
        wrong_high=wrong_high,
        rtol=rtol,
        met=wrong_high <= wanted,
    )


def _upper_end(overlooked: float, variance: float) -> float:
    """Upper end of the interval of a count and of its estimate's variance.

    One more than estimated: where none was seen, none is not certain. Counts are skewed as the
    log-normal distribution is (Chao, Biometrics 43 (1987) 783).
    """
    more = overlooked + 1.0
    return more * math.exp(_QUANTILE * math.sqrt(math.log1p((variance + more) / more**2)))
