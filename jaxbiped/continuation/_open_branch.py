"""Branch that a dataset holds, opened to be drawn or followed on."""

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._identity import difference_of
from jaxbiped.continuation._axis import Axis
from jaxbiped.continuation._bifurcations import EVENTS, BifurcationPoint
from jaxbiped.continuation._branch import Branch
from jaxbiped.continuation._branch_dataset import NUMBERS
from jaxbiped.continuation._branch_point import BranchPoint
from jaxbiped.continuation._trace import BranchStop
from jaxbiped.dynamics._state import BristleState, RigidState, State
from jaxbiped.gait._continuation import BranchEnd
from jaxbiped.scene._parameter_access import scene_identity
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene._scene_checks import check_scene

if TYPE_CHECKING:
    import xarray

_STATES = {kind.__name__: kind for kind in (State, BristleState, RigidState)}


def open_branch(dataset: "xarray.Dataset", scene: Scene | RigidScene) -> Branch:
    """The branch that a dataset holds, to be drawn, or followed on by `resume_branch`.

    Args:
        dataset: from `Branch.dataset`, also one that was stored and opened again.
        scene: the walker that it was made with.

    Returns:
        The branch.

    Raises:
        ArgumentError: a dataset of something else, of another scene, or that lacks a variable.
    """
    scene = check_scene(scene, Scene, RigidScene)
    if "branch" not in dataset.attrs:
        raise ArgumentError("dataset is not allowed: it must be that of a branch.")
    settings = json.loads(dataset.attrs["branch"])
    own = scene_identity(scene)
    difference = difference_of({name: settings.get(name) for name in own}, own)
    if difference is not None:
        raise ArgumentError(
            f"scene is not allowed: it differs from the branch's own in {difference}."
        )
    state_type = _STATES[settings["state_type"]]
    special = _points(dataset, state_type, settings["along"], "event_")
    events = [
        BifurcationPoint(EVENTS[int(kind)], point, complex(real, imaginary), *map(float, errors))
        for kind, point, real, imaginary, *errors in zip(
            _column(dataset, "event_kind"),
            special,
            _column(dataset, "event_multiplier_real"),
            _column(dataset, "event_multiplier_imag"),
            _column(dataset, "event_error"),
            _column(dataset, "event_value_error"),
            _column(dataset, "event_beyond"),
            strict=True,
        )
    ]
    first, last = (BranchStop(BranchEnd(end), why, float(at)) for end, why, at in settings["stops"])
    return Branch(
        scene=scene,
        points=tuple(_points(dataset, state_type, settings["along"], "")),
        bifurcations=tuple(events),
        stops=(first, last),
        axis=Axis(**settings["axis"]),
        state_type=state_type,
        footsteps=settings["footsteps"],
        accuracy=settings["accuracy"],
        engine=settings["engine"],
    )


def _column(dataset: "xarray.Dataset", name: str) -> np.ndarray:
    if name not in dataset.variables:
        raise ArgumentError(
            f"dataset is not allowed: it has no variable {name!r}, as branches of this version do."
        )
    return np.asarray(dataset[name].values)


def _points(
    dataset: "xarray.Dataset", state_type: Any, along: str, before: str
) -> list[BranchPoint]:
    def column(name: str) -> np.ndarray:
        return _column(dataset, before + name)

    recurring = np.stack([column(f"state_{name}") for name in state_type._fields[1:]], axis=1)
    values = column("multipliers_real") + 1j * column("multipliers_imag")
    errors, codes = column("multipliers_error"), column("bifurcation")
    numbers = {name: column(name) for name in NUMBERS}
    value, place, tangent = column(along), column("place"), column("tangent")
    return [
        BranchPoint(
            value=float(value[k]),
            recurring=recurring[k],
            multipliers=values[k],
            multiplier_errors=errors[k],
            bifurcation=int(codes[k]),
            place=place[k],
            tangent=tangent[k],
            **{name: float(numbers[name][k]) for name in NUMBERS},
        )
        for k in range(len(value))
    ]
