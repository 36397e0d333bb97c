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
)

MEASURES = ("period", "step_length", "speed", "peak_normal")
"""Measures of a gait that may be given, as in `Measures`."""
ANGLES = ("theta_1", "theta_2")


@dataclasses.dataclass(frozen=True)
class MeasuredAngles:
    """Leg angles over the first footstep of a cycle.

    Attributes:
        times: since mid-stance [s], shape (n,).
        deviation: standard deviation of every angle [rad].
        theta_1, theta_2: angles of the legs as in `State` [rad], shape (n,); None where unknown.

    Raises:
        ArgumentError: numbers or shapes that are not allowed.
    """

    times: npt.ArrayLike
    deviation: float
    theta_1: npt.ArrayLike | None = None
    theta_2: npt.ArrayLike | None = None

    def __post_init__(self) -> None:
        check_not_negative("times", self.times, "s")
        if not np.size(self.times):
            raise ArgumentError("times = [] is not allowed: give one at least.")
        check_positive("deviation", self.deviation, "rad")
        if not self.known:
            raise ArgumentError("theta_1 = None and theta_2 = None: give one of them at least.")
        for name, values in self.known.items():
            check_finite(name, values)
            if np.ndim(values) != 1 or np.shape(values) != np.shape(self.times):
                raise ArgumentError(
                    f"{name} has the shape {np.shape(values)}: it must be (n,), that of times, "
                    f"which is {np.shape(self.times)}."
                )

    @property
    def known(self) -> dict[str, npt.ArrayLike]:
        """The angles that are known, by name."""
        return {name: each for name in ANGLES if (each := getattr(self, name)) is not None}


@dataclasses.dataclass(frozen=True)
class MeasuredGait:
    """Observations of one steady gait.

    Attributes:
        measures: by name (period [s], step_length [m], speed [m/s], peak_normal [N]) the value and
            its standard deviation.
        conditions: parameters that are known and were others than the scene's, by name, such as the
            slope.
        angles: leg angles over time, if any.
        footsteps: in a cycle.

    Raises:
        ArgumentError: an unknown name, or a number that is not allowed.

    Examples:
        >>> import jaxbiped as jb
        >>> gait = jb.identify.MeasuredGait({"period": (0.441, 1e-3)}, conditions={"slope": 0.02})
        >>> len(gait.values)
        1
    """

    measures: Mapping[str, tuple[float, float]]
    conditions: Mapping[str, float] = dataclasses.field(default_factory=dict)
    angles: MeasuredAngles | None = None
    footsteps: int = 1

    def __post_init__(self) -> None:
        check_count("footsteps", self.footsteps)
        check_type("measures", self.measures, Mapping)
        check_type("conditions", self.conditions, Mapping)
        for name, pair in self.measures.items():
            check_choice("measures", name, MEASURES)
            if np.shape(pair) != (2,):
                raise ArgumentError(
                    f"measures[{name!r}] = {pair!r} is not allowed: give the value and its "
                    "standard deviation."
                )
            check_finite(f"measures[{name!r}]", pair[0])
            check_positive(f"the standard deviation of {name}", pair[1])
        if not self.measures and self.angles is None:
            raise ArgumentError("measures = {} is not allowed: give a measure or angles.")

    @property
    def values(self) -> np.ndarray:
        """All that was measured, one number behind the other, shape (n,)."""
        return np.concatenate(
            [
                [value for value, _ in self.measures.values()],
                *([] if self.angles is None else self.angles.known.values()),
            ]
        )

    @property
    def deviations(self) -> np.ndarray:
        """Their standard deviations, shape (n,)."""
        parts = [np.array([deviation for _, deviation in self.measures.values()])]
        if self.angles is not None:
            size = np.size(self.angles.times) * len(self.angles.known)
            parts.append(np.full(size, self.angles.deviation))
        return np.concatenate(parts)
