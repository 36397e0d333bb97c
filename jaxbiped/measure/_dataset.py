"""Dataset of a trajectory: labelled, for files and for other programs."""

import json
from typing import TYPE_CHECKING, cast

import numpy as np

from jaxbiped._checks import check_type
from jaxbiped._parameter_declaration import parameter_infos
from jaxbiped._types import Scalar
from jaxbiped.dynamics._contacts import feet, foot_forces, touches
from jaxbiped.dynamics._energy import energies
from jaxbiped.dynamics._redundant_motion import violation
from jaxbiped.dynamics._redundant_state import LegsState, minimal_state
from jaxbiped.dynamics._state_quantities import STATE_QUANTITIES
from jaxbiped.scene._scene import RedundantScene, Scene
from jaxbiped.solve._scene_key import check_scene_of
from jaxbiped.solve._trajectory import Trajectory

if TYPE_CHECKING:
    import xarray


def trajectory_dataset(scene: Scene | RedundantScene, trajectory: Trajectory) -> "xarray.Dataset":
    """States, foot forces, penetrations and energies along a trajectory, labelled, in SI units.

    Variables have the dimension `time` [s]; forces and penetrations also `leg` (1, 2). Attributes
    hold how the motion ended and every parameter of the scene, with their units in
    `parameter_units` (JSON). Write it with `to_netcdf` (or
    `to_zarr`, with zarr installed).

    Args:
        scene: what was simulated.
        trajectory: the motion; only one, not a batch.

    Returns:
        The dataset, one entry along `time` for each time saved.

    Raises:
        ArgumentError: a rigid walker's scene.
        ValueError: a batch of trajectories.
    """
    import xarray

    check_type("scene", scene, Scene, RedundantScene)
    check_scene_of(trajectory, scene)
    if np.ndim(trajectory.t) != 1:
        raise ValueError("This is a batch of trajectories: take one of them at a time.")
    state = trajectory.state
    both, forces = feet(scene, state), foot_forces(scene, state)
    held = energies(scene, state)  # type: ignore[arg-type]
    variables = {
        name: ("time", np.asarray(value), {"units": STATE_QUANTITIES[name].unit or "1"})
        for name, value in minimal_state(scene, state)._asdict().items()
    }
    if isinstance(scene, RedundantScene):
        off = np.asarray(violation(scene, cast("LegsState", state)).position)
        variables["violation"] = ("time", off, {"units": "m"})
    for name, value in held._asdict().items():
        variables[f"{name}_energy"] = ("time", np.asarray(value), {"units": "J"})

    def legs(values: list[Scalar | None]) -> np.ndarray:
        return np.stack([np.asarray(value) for value in values])

    per_leg = {
        "normal_force": (legs([force.normal for force in forces]), "N"),
        "penetration": (legs([foot.penetration for foot in both]), "m"),
        "slip_speed": (legs([foot.slip_speed for foot in both]), "m/s"),
        "touches": (legs([touches(foot) for foot in both]), "1"),
    }
    if forces.foot_1.tangential is not None:
        per_leg["tangential_force"] = (legs([force.tangential for force in forces]), "N")
    dataset = xarray.Dataset(
        variables
        | {
            name: (("leg", "time"), data, {"units": unit}) for name, (data, unit) in per_leg.items()
        },
        coords={"time": ("time", np.asarray(trajectory.t), {"units": "s"}), "leg": [1, 2]},
    )
    return dataset.assign_attrs(ending=str(trajectory.outcome), **_parameters(scene))


def _parameters(scene: Scene | RedundantScene) -> dict[str, float | str]:
    """Every parameter of a scene, and the names of its laws, by dotted path."""
    found: dict[str, float | str] = {}
    units: dict[str, str] = {}
    parts = vars(scene)
    if isinstance(scene, RedundantScene):
        parts = vars(scene.scene) | {"method": scene.method}
        found["orientation"] = scene.orientation
    actuators = {f"actuation_{k}": part for k, part in enumerate(scene.actuation or (), 1)}
    parts = {name: part for name, part in parts.items() if name != "actuation"} | actuators
    for part_name, part in parts.items():
        found[part_name] = type(part).__name__
        infos = parameter_infos(part)
        for name, value in vars(part).items():
            several = enumerate(value, 1) if isinstance(value, tuple) else [("", value)]
            for number, each in several:
                full = f"{part_name}.{name}" + (f"_{number}" if number else "")
                if each is not None:  # a parameter that the law does without
                    found[full] = each if isinstance(each, str) else float(each)
                if name in infos:
                    units[full] = infos[name].quantity.unit
    return found | {"parameter_units": json.dumps(units)}
