"""Modes of a rigid walk in order of time: what stood and what was held, and for how long."""

from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float, Int

from jaxbiped._checks import ArgumentError
from jaxbiped._types import Numbers, Scalar, by_numpy
from jaxbiped.scene._modes import Modes, rigid_modes
from jaxbiped.scene._scene import RigidScene


class ModeHistory(eqx.Module):
    """Modes, of which the first n were saved. Under `vmap` every leaf gains the batch's axes.

    Attributes:
        t: when each began [s], shape (n + 1,), infinite beyond the last. They have no derivatives.
        mode: the modes as in states, shape (n + 1,).
        total: how many changes and heel strikes there were, also of those that there was no room
            for.
    """

    t: Float[Array, "..."]
    mode: Float[Array, "..."]
    total: Int[Array, "..."]
    feet: tuple[str, ...] = eqx.field(static=True)
    stands: str = eqx.field(static=True)
    modes: Modes = eqx.field(static=True)

    @property
    def names(self) -> tuple[tuple[str, ...], ...]:
        """What stood and what was held in each mode: feet, and stops as "NAME held"."""
        return tuple(self._named(float(mode)) for mode in np.asarray(self.mode)[self._known])

    def durations(self, end: Scalar) -> np.ndarray:
        """How long each mode lasted until the walk's end [s]."""
        return np.diff(np.append(np.asarray(self.t)[self._known], float(end)))

    @property
    def _known(self) -> np.ndarray:
        t = np.asarray(self.t)
        if t.ndim != 1:
            raise ArgumentError("modes are those of one walk: take one of a batch at a time.")
        return np.isfinite(t)

    def _named(self, number: float) -> tuple[str, ...]:
        mode = self.modes.decoded(np, np.float64(number))
        feet = [name for name, stands in zip(self.feet, mode.stands, strict=True) if stands]
        limits = zip(self.modes.limits, mode.held, strict=True)
        held = [f"{limit.name} held" for limit, is_held in limits if is_held]
        return (*(feet if self.feet else [self.stands]), *held)


def history_of(scene: RigidScene, begin: Scalar, rows: Numbers, total: Numbers) -> ModeHistory:
    """The modes of a walk, from its first mode and the rows (n, c) for which there was room.

    A row is written behind each change of mode and each heel strike, `total` in all: it begins with
    the time and ends with the mode.
    """
    structure, modes = scene.mechanism.structure, rigid_modes(scene.mechanism)
    told = structure.feet_told

    def columns(numpy: Any, begin: Any, rows: Any, total: Any) -> tuple[Any, Any]:
        known = numpy.arange(rows.shape[0]) < total
        t = numpy.where(known, rows[:, 0], numpy.inf)
        zero = 0.0 * begin[None]
        return (
            numpy.concatenate([zero, t]),
            numpy.concatenate([begin[None], rows[:, -1]]),
        )

    t, mode = by_numpy(columns, begin, rows, total)
    return ModeHistory(
        t=t,
        mode=mode,
        total=total,  # type: ignore[arg-type]
        feet=tuple(told[k] for k in modes.feet),
        stands=told[structure.feet_of_leg[structure.stance_leg][0]],
        modes=modes,
    )
