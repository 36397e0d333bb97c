"""Dataset of a trajectory: labelled, for files and for other programs."""

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from jaxbiped._quantity import Quantity
from jaxbiped._tables import Entry, variables_of
from jaxbiped._types import Scalar
from jaxbiped.dynamics._constrained_motion import violation
from jaxbiped.dynamics._contacts import feet
from jaxbiped.dynamics._energy import energies, powers
from jaxbiped.dynamics._equivalent_states import BodiesState, minimal_state
from jaxbiped.dynamics._foot_forces import foot_forces
from jaxbiped.dynamics._footfalls import touches
from jaxbiped.dynamics._state import state_quantity
from jaxbiped.scene._parameter_access import parameter_quantities, parameter_values
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.simulate._trajectory import Trajectory, check_scene_of

if TYPE_CHECKING:
    import xarray


def trajectory_dataset(
    scene: Scene | RedundantScene | RigidScene, trajectory: Trajectory[Any]
) -> "xarray.Dataset":
    """States, foot forces, penetrations and energies along a trajectory, labelled, in SI units.

    On rigid feet there are no penetrations and no slip, and bodies and feet have the names that the
    states have: legs exchange them at every heel strike. Of a driven walker there is the power of
    its motors and actuators, too.

    Variables have the dimension `time` [s]. Forces and penetrations also have `foot`, with the
    names of the feet; the coordinate `leg` names the leg of each. Attributes hold the outcome and
    every parameter of the scene, with units in `parameter_units` (JSON). Write the dataset with
    `to_netcdf` (or `to_zarr` if zarr is installed).

    Args:
        scene: the scene that was simulated.
        trajectory: one motion, not a batch.

    Returns:
        The dataset, with one entry along `time` for each saved time.

    Raises:
        ArgumentError: the scene is another one.
        ValueError: the trajectory is a batch.
    """
    import xarray

    check_scene_of(trajectory, scene)
    if np.ndim(trajectory.t) != 1:
        raise ValueError("This is a batch of trajectories: take one of them at a time.")
    state = trajectory.state
    forces = foot_forces(scene, state)
    held, driving = energies(scene, state), powers(scene, state).actuation
    coordinates: Any = state if isinstance(scene, RigidScene) else minimal_state(scene, state)
    along, per_foot = ("time",), ("foot", "time")
    entries = {
        name: Entry(along, value, state_quantity(name) or Quantity(name))
        for name, value in coordinates._asdict().items()
    }
    if isinstance(scene, RedundantScene):
        off = np.asarray(violation(scene, cast("BodiesState", state)).position)
        words = Quantity("violation of the constraints", unit="m")
        entries["violation"] = Entry(along, off, words)
    for name, value in held._asdict().items():
        entries[f"{name}_energy"] = Entry(along, value, Quantity(f"{name} energy", unit="J"))
    if driving is not None:
        words = Quantity("power of motors and actuators", unit="W")
        entries["actuation_power"] = Entry(along, driving, words)

    def rows(values: Sequence[Scalar | None]) -> np.ndarray:
        return np.stack([np.asarray(value) for value in values])

    told: dict[str, tuple[Sequence[Scalar | None], str]] = {
        "normal_force": ([force.normal for force in forces], "N")
    }
    if not isinstance(scene, RigidScene):
        found = feet(scene, state)
        told |= {
            "penetration": ([foot.penetration for foot in found], "m"),
            "slip_speed": ([foot.slip_speed for foot in found], "m/s"),
            "touches": ([touches(foot) for foot in found], "1"),
        }
    if forces[0].tangential is not None:
        told["tangential_force"] = ([force.tangential for force in forces], "N")
    for name, (values, unit) in told.items():
        entries[name] = Entry(per_foot, rows(values), Quantity(name.replace("_", " "), unit=unit))
    structure = scene.mechanism.structure
    dataset = xarray.Dataset(
        variables_of(entries),
        coords={
            "time": ("time", np.asarray(trajectory.t), Quantity("time", unit="s").attributes),
            "foot": list(structure.feet_told),
            "leg": ("foot", [structure.legs[leg] for leg in structure.leg_of_foot]),
        },
    )
    return dataset.assign_attrs(ending=str(trajectory.outcome), **_parameters(scene))


def _parameters(scene: Scene | RedundantScene | RigidScene) -> dict[str, float | str]:
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
        words = {name: value for name, value in vars(part).items() if isinstance(value, str)}
        numbers = {name: float(value) for name, value in parameter_values(part).items()}
        found |= {f"{part_name}.{name}": value for name, value in (words | numbers).items()}
        quantities = parameter_quantities(part).items()
        units |= {f"{part_name}.{name}": quantity.unit for name, quantity in quantities}
    return found | {"parameter_units": json.dumps(units)}
