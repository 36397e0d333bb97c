"""Design variables: parameters within bounds, scaled to the unit interval."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError, check_choice, check_finite
from jaxbiped.scene._parameter_access import parameter_names, parameter_values, with_parameters
from jaxbiped.scene._scene import RigidScene, Scene


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
        """Parameters at u, shape (k,); at 0 and 1 the bounds exactly."""
        ratio = np.where(self.logarithmic, self.high, 1.0) / self._low_or_one()
        geometric = self.low * ratio**u
        values = np.where(self.logarithmic, geometric, self.low + u * (self.high - self.low))
        return np.where(u <= 0.0, self.low, np.where(u >= 1.0, self.high, values))

    def rates(self, u: np.ndarray) -> np.ndarray:
        """Derivatives of the parameters with respect to u, shape (k,)."""
        ratio = np.where(self.logarithmic, self.high, 1.0) / self._low_or_one()
        return np.where(self.logarithmic, self.values(u) * np.log(ratio), self.high - self.low)

    def positions(self, values: np.ndarray) -> np.ndarray:
        """The u of parameters, those outside the bounds moved onto them, shape (k,)."""
        within = np.clip(values, self.low, self.high)
        ratio = np.where(self.logarithmic, self.high, np.exp(1.0)) / self._low_or_one()
        part = np.where(self.logarithmic, within, 1.0) / self._low_or_one()
        u = np.where(
            self.logarithmic, np.log(part) / np.log(ratio), (within - self.low) / self._width()
        )
        return np.clip(u, 0.0, 1.0)

    def named(self, u: np.ndarray) -> dict[str, float]:
        """The parameters at u by name."""
        return dict(zip(self.names, self.values(u).tolist(), strict=True))

    def _low_or_one(self) -> np.ndarray:
        return np.where(self.logarithmic, self.low, 1.0)

    def _width(self) -> np.ndarray:
        return self.high - self.low


def variables_of(scene: Scene | RigidScene, vary: Mapping[str, tuple[float, float]]) -> Variables:
    """The variables that a mapping from names to bounds describes.

    Raises:
        ArgumentError: no variable, an unknown one, or bounds that are empty or not allowed.
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
