"""Options of `jaxbiped basin`: which starts."""

import csv
import dataclasses
import re
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from jaxbiped._checks import ArgumentError, check_positive
from jaxbiped.dynamics._rigid_state import rigid_state
from jaxbiped.dynamics._state import State
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.scene._scene import Scene
from jaxbiped.sweep.starts._coordinates import check_coordinates
from jaxbiped.sweep.starts._given_starts import GivenStarts
from jaxbiped.sweep.starts._starts import AbstractStarts, grid, sample

_USUAL = ("theta_swing=-0.5:0.3:100", "omega_swing=-2:4:100")
"""Axes of a basin that nobody chose, and as many starts on each."""
_USUAL_RIGID = ("theta_stance=0:0.5:100", "omega_stance=-2.5:0:100")


@dataclasses.dataclass(frozen=True)
class StartsOptions:
    """Which starts; what is not named keeps the value that the gait has on its section."""

    x: str | None = None
    """Horizontal axis, as name=first:last:count: theta_stance, theta_swing, omega_stance,
    omega_swing, hip_z, hip_vx, hip_vz, or a parameter of the scene."""
    y: str | None = None
    """Vertical axis, likewise."""
    more: tuple[str, ...] = ()
    """Further axes, likewise."""
    samples: int | None = None
    """So many quasi-random starts within the axes' ranges, in place of a grid."""
    sampling: str = "sobol"
    """How they are drawn: uniform, latin-hypercube, sobol or halton."""
    seed: int = 0
    """Of the samples."""
    place: bool = False
    """Place the stance foot on the ground: hip height and velocity follow from the stance leg."""
    starts: Path | None = None
    """Label these starts instead: CSV with the header
    hip_x,hip_z,theta_1,theta_2,hip_vx,hip_vz,omega_1,omega_2, in the slope's frame."""

    def chosen(self, scene: Scene | RigidScene) -> AbstractStarts:
        """The starts; raises `ArgumentError`."""
        if self.starts is not None:
            if self.x or self.y or self.more or self.samples is not None:
                raise ArgumentError(
                    f"starts = {str(self.starts)!r} goes without x, y, more and samples: name "
                    "either."
                )
            return GivenStarts(read_starts(self.starts, scene))
        axes = self._axes(scene)
        if self.samples is None:
            values = {name: np.linspace(a, b, count) for name, (a, b, count) in axes.items()}
            return grid(scene, values, place=self.place)
        bounds = {name: (low, high) for name, (low, high, _) in axes.items()}
        return sample(
            scene,
            bounds,
            self.samples,
            method=self.sampling,
            seed=self.seed,
            place=self.place,
        )

    def _axes(self, scene: Scene | RigidScene) -> dict[str, tuple[float, float, int]]:
        """First, last and count of each axis, the horizontal one last."""
        usual = _USUAL if scene.compliant else _USUAL_RIGID
        named = [text for text in (*self.more, self.y, self.x) if text is not None]
        axes: dict[str, tuple[float, float, int]] = {}
        for text in named or reversed(usual):
            name, axis = parse_axis(text)
            check_coordinates(scene, [name])
            if name in axes:
                raise ArgumentError(f"{name} is named by two axes: each needs its own.")
            axes[name] = axis
        return axes


def parse_axis(text: str) -> tuple[str, tuple[float, float, int]]:
    """Name, first, last and count of an axis, from name=first:last:count."""
    match = re.fullmatch(r"([\w.-]+)=([^:]+):([^:]+):([^:]+)", text.strip())
    try:
        if match is None:
            raise ValueError
        name, first, last, count = match[1], float(match[2]), float(match[3]), int(match[4])
    except ValueError:
        raise ArgumentError(
            f"axis {text!r} is not allowed: write name=first:last:count, such as "
            "theta_swing=-0.5:0.1:200."
        ) from None
    check_positive(f"count of axis {text!r}", count)
    if not first < last:
        raise ArgumentError(
            f"axis {text!r} is empty: its first value must be finite and less than its last."
        )
    return name.replace("-", "_"), (first, last, count)


def read_starts(path: Path, scene: Scene | RigidScene) -> object:
    """Starts from a CSV file, leaves of shape (n,); a rigid walker keeps its part of them.

    Raises:
        ArgumentError: no such file, another header, or an entry that is not a number.
    """
    wanted = ",".join(State._fields)
    try:
        with path.open(newline="") as file:
            rows = [[cell.strip() for cell in row] for row in csv.reader(file) if row]
    except (OSError, UnicodeDecodeError) as error:
        raise ArgumentError(
            f"starts = {str(path)!r} cannot be read ({error}): it must be a CSV file with the "
            f"header {wanted}."
        ) from None
    if not rows or rows[0] != list(State._fields):
        head = ",".join(rows[0]) if rows else ""
        raise ArgumentError(f"starts = {str(path)!r} has the header {head!r}: it must be {wanted}.")
    if len(rows) == 1:
        raise ArgumentError(f"starts = {str(path)!r} holds no starts: give at least one row.")
    numbers = []
    for line, row in enumerate(rows[1:], start=2):
        try:
            numbers.append([float(cell) for cell in row])
        except ValueError:
            raise ArgumentError(
                f"starts = {str(path)!r}, line {line}: {','.join(row)!r} is not all numbers."
            ) from None
        if len(row) != len(State._fields):
            raise ArgumentError(
                f"starts = {str(path)!r}, line {line}: {len(row)} numbers instead of "
                f"{len(State._fields)}."
            )
    whole = State(*[jnp.asarray(column) for column in np.array(numbers).T])
    return whole if scene.compliant else rigid_state(whole)
