"""Measured gait: what was observed of a walker, with standard deviations."""

import dataclasses
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from jaxbiped._checks import (
    ArgumentError,
    check_choice,
    check_count,
    check_finite,
    check_not_negative,
    check_positive,
    check_type,
    holds_somewhere,
)

MEASURES = ("period", "step_length", "speed", "peak_normal")
"""Measures of a gait that may be given, as in `Measures`."""
CLOCKS = ("mid-stance", None)
_LONGEST = 20.0
"""Time beyond which milliseconds are suspected [s]."""


@dataclasses.dataclass(frozen=True, init=False)
class MeasuredAngles:
    """Angles of bodies over time. Masked entries count as missing.

    Each angle belongs to one body throughout: of two legs, `theta_2` is that of the leg that stands
    at the beginning and swings in the next footstep.

    Args:
        times: see below.
        deviation: see below.
        theta_1, theta_2: angles of the legs of a walker with bodies "1" and "2".
        since: see below.
        **angles: angles of any bodies by their names in states, such as `theta_thigh_1`.

    Attributes:
        times: times on the data's own clock [s], shape (n,).
        deviation: standard deviation of every angle [rad].
        known: the angles by their names in states [rad], shape (n,) each.
        since: "mid-stance" if the clock reads zero at mid-stance of the leg that stands when a
            cycle begins, for any model. None: the clock is unknown, and its zero is fitted too.

    Raises:
        ArgumentError: a number or a shape is not allowed.
    """

    times: npt.ArrayLike
    deviation: float
    known: dict[str, npt.ArrayLike]
    since: str | None

    def __init__(
        self,
        times: npt.ArrayLike,
        deviation: float,
        theta_1: npt.ArrayLike | None = None,
        theta_2: npt.ArrayLike | None = None,
        since: str | None = None,
        **angles: npt.ArrayLike | None,
    ) -> None:
        given = {"theta_1": theta_1, "theta_2": theta_2} | angles
        known = {name: each for name, each in given.items() if each is not None}
        fields = {"times": times, "deviation": deviation, "known": known, "since": since}
        for name, value in fields.items():
            object.__setattr__(self, name, value)
        self._check()

    def _check(self) -> None:
        check_not_negative("times", _as_array(self.times), "s")
        if not np.size(self.times):
            raise ArgumentError("times = [] is not allowed: give one at least.")
        _check_seconds("times", _as_array(self.times))
        check_positive("deviation", self.deviation, "rad")
        check_choice("since", self.since, CLOCKS)
        if not self.known:
            raise ArgumentError(
                "no angle is given, which is not allowed: give one of them at least, as theta_1."
            )
        for name, values in self.known.items():
            if not name.startswith("theta_"):
                raise ArgumentError(
                    f"{name} is not allowed: give angles of bodies by their names in states, as "
                    "theta_1."
                )
            if np.ndim(values) != 1 or np.shape(values) != np.shape(self.times):
                raise ArgumentError(
                    f"{name} has the shape {np.shape(values)}: it must be (n,), that of times, "
                    f"which is {np.shape(self.times)}."
                )
            check_finite(name, _as_array(values))
            if holds_somewhere(np.abs(_as_array(values)) > 2.0 * np.pi):
                raise ArgumentError(
                    f"{name} holds {np.max(np.abs(_as_array(values))):g}, which is beyond a whole "
                    "turn: it must be in radians; are these degrees?"
                )
        if not any(np.any(each) for each in self.seen.values()):
            raise ArgumentError(
                f"{' and '.join(self.known)} hold no angle that is known: give one."
            )

    @property
    def seen(self) -> dict[str, np.ndarray]:
        """Whether each angle is known at each time, by name (booleans), shape (n,)."""
        timed = ~np.ma.getmaskarray(np.ma.asarray(self.times))
        return {
            name: timed & ~np.ma.getmaskarray(np.ma.asarray(each))
            for name, each in self.known.items()
        }

    @property
    def values(self) -> np.ndarray:
        """The known angles, one body after the other."""
        return np.concatenate(
            [np.asarray(_as_array(self.known[n]))[at] for n, at in self.seen.items()]
        )


def _as_array(values: npt.ArrayLike) -> npt.ArrayLike:
    """Zeros where masked."""
    return np.ma.filled(values, 0.0) if isinstance(values, np.ma.MaskedArray) else values


def _check_seconds(name: str, values: npt.ArrayLike) -> None:
    seconds = np.asarray(_as_array(values), dtype=float)
    if holds_somewhere(seconds > _LONGEST):
        raise ArgumentError(
            f"{name} = {np.max(seconds):g} s is not allowed: it must be at most {_LONGEST:g} s; "
            "are these milliseconds?"
        )


@dataclasses.dataclass(frozen=True)
class MeasuredGait:
    """Observations of one steady gait.

    Attributes:
        measures: value and standard deviation of each measure by name (period [s], step_length [m],
            speed [m/s], peak_normal [N]); masked values count as missing.
        conditions: known parameters whose values differ from the scene's, by name, such as the
            slope.
        angles: angles of bodies over time, if any.
        footsteps: number of footsteps of a cycle; None for the smallest possible number.

    Raises:
        ArgumentError: a name is unknown, or a number is not allowed.

    Examples:
        >>> import jaxbiped as jb
        >>> gait = jb.identify.MeasuredGait({"period": (0.441, 1e-3)}, conditions={"slope": 0.02})
        >>> len(gait.values)
        1
    """

    measures: Mapping[str, tuple[float, float]]
    conditions: Mapping[str, float] = dataclasses.field(default_factory=dict)
    angles: MeasuredAngles | None = None
    footsteps: int | None = None

    def __post_init__(self) -> None:
        if self.footsteps is not None:
            check_count("footsteps", self.footsteps)
        check_type("measures", self.measures, Mapping)
        check_type("conditions", self.conditions, Mapping)
        known = {name: pair for name, pair in self.measures.items() if not _is_masked(pair)}
        object.__setattr__(self, "measures", known)
        for name, pair in self.measures.items():
            check_choice("measures", name, MEASURES)
            if np.shape(pair) != (2,):
                raise ArgumentError(
                    f"measures[{name!r}] = {pair!r} is not allowed: give the value and its "
                    "standard deviation."
                )
            check_finite(f"measures[{name!r}]", pair[0])
            check_positive(f"the standard deviation of {name}", pair[1])
            if name == "period":
                _check_seconds(name, pair[0])
        if not self.measures and self.angles is None:
            raise ArgumentError("measures = {} is not allowed: give a measure or angles.")

    @property
    def values(self) -> np.ndarray:
        """All measured values, one after the other, shape (n,)."""
        return np.concatenate(
            [
                [value for value, _ in self.measures.values()],
                [] if self.angles is None else self.angles.values,
            ]
        )

    @property
    def clocks(self) -> int:
        """Number of clocks whose zero is fitted: 1 if that of the angles is unknown."""
        return int(self.angles is not None and self.angles.since is None)

    @property
    def deviations(self) -> np.ndarray:
        """Standard deviations of the measured values, shape (n,)."""
        parts = [np.array([deviation for _, deviation in self.measures.values()])]
        if self.angles is not None:
            parts.append(np.full(len(self.angles.values), self.angles.deviation))
        return np.concatenate(parts)


def _is_masked(pair: object) -> bool:
    """Whether a value or its deviation is masked."""
    entries = pair if isinstance(pair, tuple | list | np.ndarray) else (pair,)
    return any(np.ma.is_masked(each) for each in (pair, *entries))
