"""Starts of `jaxbiped basin`: a grid, samples, or those of a file."""

import re
from pathlib import Path
from typing import Annotated, Any

import jaxbiped as jb
from jaxbiped._checks import ArgumentError, check_positive
from jaxbiped.cli import _options as options

_USUAL = ("theta_{swing}=-0.5:0.3:100", "omega_{swing}=-2:4:100")
"""Axes of a basin that nobody chose, and as many starts on each."""
_USUAL_RIGID = ("theta_{stance}=0:0.5:100", "omega_{stance}=-2.5:0:100")


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


_IS_AXIS = options.Check(lambda _, text: parse_axis(text))
Axis = Annotated[str | None, _IS_AXIS]


class StartsOptions(options.Options, of=("starts.sample", "starts.grid")):
    """The starts; coordinates that are not named have the value of the gait on its section."""

    x: Axis = None
    """Horizontal axis, as name=first:last:count: theta_stance, theta_swing, omega_stance,
    omega_swing, hip_z, hip_vx, hip_vz, or a parameter of the scene."""
    y: Axis = None
    """Vertical axis, in the same form."""
    more: Annotated[
        tuple[str, ...], options.Check(lambda _, text: parse_axis(text), each=True)
    ] = ()
    """Further axes, in the same form."""
    samples: options.Count | None = None
    """Number of random starts within the ranges of the axes, instead of a grid."""
    sampling: Annotated[str, options.one_of("starts.SAMPLINGS")] = "sobol"
    """How random starts are drawn: uniform, latin-hypercube, sobol or halton."""
    seed: int
    """Random seed for drawing the starts."""
    place: bool = False
    """Place the stance leg on the ground, which determines the height and the velocity of the root
    point. Always on if an axis is an angle or rate of a body by its name in the state."""
    starts: Path | None = None
    """Label the starts of this file instead: CSV with the names of the state as its header, such as
    hip_x,hip_z,theta_1,theta_2,hip_vx,hip_vz,omega_1,omega_2, in the slope's frame."""

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that were named, the horizontal one last."""
        return tuple(text for text in (*self.more, self.y, self.x) if text is not None)

    def check(self) -> None:
        if self.starts is not None and (self.axes or self.samples is not None):
            raise ArgumentError(
                f"starts = {str(self.starts)!r} is not allowed with x, y, more or "
                "samples: give one or the other."
            )
        super().check()

    def chosen(self, scene: "jb.Scene | jb.RigidScene") -> "jb.starts.AbstractStarts":
        """The starts; raises `ArgumentError`."""
        import numpy as np

        if self.starts is not None:
            return jb.starts.GivenStarts(read_starts(self.starts, scene))
        axes = self._ranges(scene)
        if self.samples is None:
            values = {name: np.linspace(*axis) for name, axis in axes.items()}
            return jb.starts.grid(scene, values, place=self.place or None)
        return jb.starts.sample(
            scene,
            {name: (low, high) for name, (low, high, _) in axes.items()},
            self.samples,
            method=self.sampling,
            seed=self.seed,
            place=self.place or None,
        )

    def _ranges(self, scene: "jb.Scene | jb.RigidScene") -> dict[str, tuple[float, float, int]]:
        """First, last and count of each axis, the horizontal one last."""
        from jaxbiped.sweep.starts._coordinates import check_coordinates

        axes: dict[str, tuple[float, float, int]] = {}
        for text in self.axes or _usual_axes(scene):
            name, axis = parse_axis(text)
            check_coordinates(scene, [name])
            if name in axes:
                raise ArgumentError(f"{name} is named by two axes: each needs its own.")
            axes[name] = axis
        return axes


def _usual_axes(scene: "jb.Scene | jb.RigidScene") -> tuple[str, ...]:
    """Of what swings and what stands where a cycle begins: one of the first pair each."""
    structure, roles = scene.mechanism.structure, {"swing": "swing", "stance": "stance"}
    if "theta_swing" not in jb.starts.coordinate_names(scene):
        roles = {role: structure.bodies[j] for role, j in zip(roles, structure.roles, strict=True)}
    y, x = (axis.format(**roles) for axis in (_USUAL if scene.compliant else _USUAL_RIGID))
    return x, y


def read_starts(path: Path, scene: "jb.Scene | jb.RigidScene") -> object:
    """Starts from a CSV file, leaves of shape (n,); a rigid walker keeps its part of them."""
    import csv

    import numpy as np

    from jaxbiped._types import as_float
    from jaxbiped.scene._state_types import state_type_of

    structure = scene.mechanism.structure
    named, names = f"starts = {str(path)!r}", [*structure.coordinates, *structure.rates]
    wanted = ",".join(names)
    try:
        with path.open(newline="") as file:
            rows = [[cell.strip() for cell in row] for row in csv.reader(file) if row]
    except (OSError, UnicodeDecodeError) as error:
        raise ArgumentError(
            f"{named} cannot be read ({error}): it must be a CSV file with the header {wanted}."
        ) from None
    if not rows or rows[0] != names:
        head = ",".join(rows[0]) if rows else ""
        raise ArgumentError(f"{named} has the header {head!r}: it must be {wanted}.")
    if len(rows) == 1:
        raise ArgumentError(f"{named} holds no starts: give at least one row.")
    numbers = []
    for line, row in enumerate(rows[1:], start=2):
        try:
            numbers.append([float(cell) for cell in row])
        except ValueError:
            raise ArgumentError(
                f"{named}, line {line}: {','.join(row)!r} is not all numbers."
            ) from None
        if len(row) != len(names):
            raise ArgumentError(
                f"{named}, line {line}: {len(row)} numbers instead of {len(names)}."
            )
    whole: Any = state_type_of(names)(*map(as_float, np.array(numbers).T))
    return whole if scene.compliant else jb.dynamics.rigid_state(whole)
