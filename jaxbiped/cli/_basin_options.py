"""Options of `jaxbiped basin`: which starts, and how they are followed."""

import dataclasses
import re
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING

from jaxbiped._checks import ArgumentError, check_choice, check_count, check_positive
from jaxbiped.cli._choices import CHUNK, SAMPLINGS
from jaxbiped.cli._option_checks import check_accuracy, check_engine
from jaxbiped.cli._option_fields import Engine

if TYPE_CHECKING:
    from jaxbiped.scene._scene import RigidScene, Scene
    from jaxbiped.sweep.starts._starts import AbstractStarts


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

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that were named, the horizontal one last."""
        return tuple(text for text in (*self.more, self.y, self.x) if text is not None)

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself."""
        if self.starts is not None and (self.axes or self.samples is not None):
            raise ArgumentError(
                f"starts = {str(self.starts)!r} goes without x, y, more and samples: name either."
            )
        for text in self.axes:
            parse_axis(text)
        check_choice("sampling", self.sampling, SAMPLINGS)
        if self.samples is not None:
            check_count("samples", self.samples)

    def chosen(self, scene: "Scene | RigidScene") -> "AbstractStarts":
        """The starts; raises `ArgumentError`."""
        from jaxbiped.cli._chosen_starts import chosen_starts

        self.check()
        return chosen_starts(self, scene)


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


@dataclasses.dataclass(frozen=True)
class SweepOptions:
    """How starts are followed, and where the results go."""

    footsteps: int = 30
    """After which a start that is not certain yet is unresolved."""
    accuracy: str = "draft"
    """How accurately to solve: draft, balanced or tight; or the share of the labels that may be
    wrong, such as 1e-4."""
    engine: Engine = "auto"
    store: Path | None = None
    """Zarr store for the results; a run that was killed continues there."""
    any_version: bool = False
    """Continue a store that another version or revision of jaxbiped wrote."""
    chunk: int = CHUNK
    """Starts that are labelled and written at once."""
    workers: int = 1
    """Processes of this machine that share the work, each with its share of the cores."""
    scheduler: str | None = None
    """Address of a dask scheduler whose workers do the work."""

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself."""
        check_accuracy(self.accuracy)
        check_engine(self.engine)
        for name in ("footsteps", "chunk", "workers"):
            check_count(name, getattr(self, name))

    def executor(self) -> tuple[Executor | None, int]:
        """What runs the chunks, and how many at once; raises `ArgumentError`."""
        if self.scheduler is None and self.workers == 1:
            return None, 1
        from jaxbiped.sweep._workers import cluster_executor, local_executor

        if self.scheduler is not None:
            return cluster_executor(self.scheduler)
        return local_executor(self.workers), self.workers
