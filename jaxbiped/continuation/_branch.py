"""Branch of gaits along a parameter: its points, bifurcations and ends."""

from typing import TYPE_CHECKING, cast

import equinox as eqx
import jax.tree_util as jtu
import numpy as np

from jaxbiped._types import as_float
from jaxbiped.continuation._axis import Axis
from jaxbiped.continuation._bifurcations import BifurcationPoint
from jaxbiped.continuation._branch_dataset import branch_dataset
from jaxbiped.continuation._branch_point import BranchPoint
from jaxbiped.continuation._trace import BranchStop
from jaxbiped.dynamics._state import WalkerState
from jaxbiped.scene._parameter_access import parameter_quantities, with_parameters
from jaxbiped.scene._scene import RigidScene, Scene

if TYPE_CHECKING:
    import xarray


class Branch(eqx.Module):
    """A branch of periodic gaits along a parameter, n points in the order of its arclength.

    Attributes:
        scene: the walker; on the branch its parameter takes other values.
        points: the gaits, each a `BranchPoint`.
        bifurcations: folds, period doublings, Neimark–Sacker points, limits and what was not
            located, in their order along the branch, each a `BifurcationPoint`.
        stops: how the branch ended at its two ends, each a `BranchStop`.
        axis: the parameter and its range.
        state_type: of the states on the section.
        footsteps: how many a cycle has.
        accuracy, engine: by which it was followed.
    """

    scene: Scene | RigidScene
    points: tuple[BranchPoint, ...]
    bifurcations: tuple[BifurcationPoint, ...]
    stops: tuple[BranchStop, BranchStop]
    axis: Axis
    state_type: type = eqx.field(static=True)
    footsteps: int = eqx.field(static=True)
    accuracy: str = eqx.field(static=True)
    engine: str = eqx.field(static=True)

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        low, high = self.values.min(initial=np.inf), self.values.max(initial=-np.inf)
        span = f"{low:.6g} to {high:.6g}" if len(self) else "none"
        kinds = ", ".join(map(str, self.bifurcations))
        return (
            f"Branch({len(self)} gaits of {self.footsteps} footsteps along {self.axis.name}: "
            f"{span}; {kinds or 'no bifurcations'}; ends: {self.stops[0].end}, "
            f"{self.stops[1].end})"
        )

    @property
    def along(self) -> str:
        """Name of the parameter."""
        return self.axis.name

    @property
    def unit(self) -> str:
        """SI unit of the parameter."""
        return parameter_quantities(self.scene)[self.axis.name].unit

    @property
    def values(self) -> np.ndarray:
        """Of the parameter, SI units, shape (n,)."""
        return np.array([point.value for point in self.points])

    @property
    def stable(self) -> list[bool | None]:
        """Of each gait whether it is stable; None where the errors leave it open."""
        return [point.stable for point in self.points]

    @property
    def multipliers(self) -> np.ndarray:
        """Largest first, shape (n, m − 1), complex."""
        return np.stack([point.multipliers for point in self.points])

    def state(self, point: int | BranchPoint | BifurcationPoint) -> WalkerState:
        """The state on the section of a gait: of the point of that number, or of the one given."""
        if isinstance(point, int):
            point = self.points[point]
        if isinstance(point, BifurcationPoint):
            point = point.point
        state = self.state_type(0.0, *point.recurring.tolist())
        return cast("WalkerState", jtu.tree_map(as_float, state))

    def scene_at(self, point: int | BranchPoint | BifurcationPoint) -> Scene | RigidScene:
        """The scene of a gait, of the point of that number or of the one given."""
        value = self.points[point].value if isinstance(point, int) else point.value
        return with_parameters(self.scene, {self.axis.name: value})

    def dataset(self) -> "xarray.Dataset":
        """The branch as a dataset for `to_netcdf` or `to_zarr`; `open_branch` takes it back.

        Returns:
            Along `point` the parameter, `state_…`, period, step_length, speed, peak_normal,
            multipliers with their errors, `stable` (1, 0, and −1 where the errors leave it open)
            and `bifurcation`, SI units; the same of the special points along `event`, with kind,
            critical multiplier and its error; all else in the attributes.
        """
        return branch_dataset(self)
