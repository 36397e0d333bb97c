"""Design variables within bounds, and requirements on a design's gait, as mappings or in words."""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from jaxbiped._checks import ArgumentError, check_choice, check_finite
from jaxbiped._quantity import si_number
from jaxbiped.optimise._objectives import OBJECTIVES, check_objective
from jaxbiped.scene._parameter_access import parameter_names, parameter_values, with_parameters
from jaxbiped.scene._scene import RigidScene, Scene

_WORDS = re.compile(r"^\s*(\w+)\s*(<=|>=|==|<|>|=)\s*([^<>=]+?)\s*$")


class Variables(NamedTuple):
    """k design variables; u in [0, 1] is linear in a parameter, or in its logarithm.

    Attributes:
        names: of the parameters.
        low, high: their bounds, shape (k,).
        logarithmic: where u is linear in the logarithm (booleans): where both bounds are positive.
        places: of the variables among all parameters of the scene, shape (k,).
    """

    names: tuple[str, ...]
    low: np.ndarray
    high: np.ndarray
    logarithmic: np.ndarray
    places: np.ndarray

    def values(self, u: np.ndarray) -> np.ndarray:
        """Parameters at u, shape (…, k); at 0 and 1 the bounds exactly."""
        geometric = self.low * self._ratio(1.0) ** u
        values = np.where(self.logarithmic, geometric, self.low + u * (self.high - self.low))
        return np.where(u <= 0.0, self.low, np.where(u >= 1.0, self.high, values))

    def rates(self, u: np.ndarray) -> np.ndarray:
        growth = self.values(u) * np.log(self._ratio(1.0))
        return np.where(self.logarithmic, growth, self.high - self.low)

    def positions(self, values: np.ndarray) -> np.ndarray:
        """The u of parameters, those outside the bounds moved onto them, shape (k,)."""
        within = np.clip(values, self.low, self.high)
        part = np.where(self.logarithmic, within, 1.0) / np.where(self.logarithmic, self.low, 1.0)
        geometric = np.log(part) / np.log(self._ratio(np.exp(1.0)))
        linear = (within - self.low) / (self.high - self.low)
        return np.clip(np.where(self.logarithmic, geometric, linear), 0.0, 1.0)

    def _ratio(self, otherwise: float) -> np.ndarray:
        """The upper bound over the lower where u is linear in the logarithm."""
        logarithmic = self.logarithmic
        return np.where(logarithmic, self.high, otherwise) / np.where(logarithmic, self.low, 1.0)

    def by_name(self, u: np.ndarray) -> dict[str, float]:
        return dict(zip(self.names, self.values(u).tolist(), strict=True))


def variables_of(scene: Scene | RigidScene, vary: Mapping[str, tuple[float, float]]) -> Variables:
    """The variables that a mapping from names to bounds describes.

    Raises:
        ArgumentError: there is no variable, one is unknown, or bounds are empty or not allowed.
    """
    if not isinstance(vary, Mapping) or not vary:
        raise ArgumentError(
            f"vary = {vary!r} is not allowed: it must map at least one parameter to its bounds, "
            "such as {'d': (0.05, 0.2)}."
        )
    names = parameter_names(scene)
    for name, bounds in vary.items():
        check_choice("vary", name, names)
        if np.shape(bounds) != (2,):
            raise ArgumentError(f"bounds of {name} = {bounds!r} are not allowed: give (low, high).")
        check_finite(f"bounds of {name}", bounds)
        low, high = bounds
        if not low < high:
            raise ArgumentError(
                f"bounds of {name} = ({low:g}, {high:g}) are empty: low must be below high."
            )
        for bound in bounds:
            with_parameters(scene, {name: bound})
    lows, highs = np.asarray([vary[name] for name in vary], dtype=float).T
    return Variables(
        names=tuple(vary),
        low=lows,
        high=highs,
        logarithmic=lows > 0.0,
        places=np.asarray([names.index(name) for name in vary]),
    )


def start_of(scene: Scene | RigidScene, variables: Variables) -> np.ndarray:
    """The scene's own design in u, moved into the bounds, shape (k,)."""
    own = parameter_values(scene)
    return variables.positions(np.asarray([float(own[name]) for name in variables.names]))


SubjectTo: TypeAlias = Mapping[str, tuple[float | None, float | None]] | Sequence[str] | str | None
"""Bounds by name, or words such as "spectral_radius<0.4"."""


class Requirement(NamedTuple):
    """A measure that must lie in an interval; None for no bound, equal bounds for an equality."""

    name: str
    low: float | None
    high: float | None


def requirements_of(scene: Scene | RigidScene, subject_to: SubjectTo) -> tuple[Requirement, ...]:
    """What must hold, the bounds of each measure gathered.

    Raises:
        ArgumentError: what is not understood, an objective that is unknown or that the scene
            lacks, or bounds that contradict each other.
    """
    if subject_to is None:
        return ()
    if isinstance(subject_to, Mapping):
        pairs = [(name, _pair(name, bounds)) for name, bounds in subject_to.items()]
    else:
        words = [subject_to] if isinstance(subject_to, str) else subject_to
        pairs = [_parse(text) for text in words]
    gathered: dict[str, tuple[float | None, float | None]] = {}
    for name, (low, high) in pairs:
        check_objective(name, scene, "subject_to")
        least, most = gathered.get(name, (None, None))
        gathered[name] = (
            max((each for each in (least, low) if each is not None), default=None),
            min((each for each in (most, high) if each is not None), default=None),
        )
    for name, (least, most) in gathered.items():
        if least is not None and most is not None and least > most:
            raise ArgumentError(
                f"subject_to asks that {name} be at least {least:g} and at most {most:g}: these "
                "contradict each other."
            )
    return tuple(Requirement(name, low, high) for name, (low, high) in gathered.items())


def larger_is_worse(
    told: Mapping[str, float], sense: float, requirements: tuple[Requirement, ...]
) -> dict[str, bool]:
    """Of each measure, for the worst of several.

    Raises:
        ArgumentError: a measure of which both more and less would be worse.
    """
    sides = [(name, sense * weight > 0.0) for name, weight in told.items()]
    sides += [(each.name, True) for each in requirements if each.high is not None]
    sides += [(each.name, False) for each in requirements if each.low is not None]
    found = dict(sides)
    for name, larger in sides:
        if larger != found[name]:
            raise ArgumentError(
                f"{name} is bounded and sought from both sides: its worst member is not defined; "
                'choose criterion = "mean".'
            )
    return found


def _pair(name: str, bounds: object) -> tuple[float | None, float | None]:
    if not isinstance(bounds, tuple | list) or len(bounds) != 2 or list(bounds) == [None, None]:
        raise ArgumentError(
            f"subject_to[{name!r}] = {bounds!r} is not allowed: give (low, high), None for none."
        )
    for each in bounds:
        if each is not None:
            check_finite(f"subject_to[{name!r}]", each)
    low, high = (None if each is None else float(each) for each in bounds)
    return low, high


def _parse(text: str) -> tuple[str, tuple[float | None, float | None]]:
    found = _WORDS.match(text) if isinstance(text, str) else None
    try:
        if found is None:
            raise ValueError
        name, sign = found[1], found[2]
        unit = OBJECTIVES[name].quantity.unit if name in OBJECTIVES else None
        value = si_number(found[3], unit)
    except ValueError:
        raise ArgumentError(
            f"subject_to = {text!r} is not understood: write name<number, name>number or "
            "name=number, such as spectral_radius<0.4 or step_length>20cm."
        ) from None
    check_finite("subject_to", value)
    if "<" in sign:
        return name, (None, value)
    return name, (value, None) if ">" in sign else (value, value)
