"""Footsteps: what a walk is counted and measured in."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from jaxbiped._checks import check_type
from jaxbiped._quantity import Quantity
from jaxbiped._tables import Entry, Tabular, variables_of
from jaxbiped._types import Numbers, Scalar, rows_of
from jaxbiped.dynamics._contacts import Contacts, contacts
from jaxbiped.dynamics._equivalent_states import minimal_state
from jaxbiped.dynamics._footfalls import landings, standing_leg
from jaxbiped.measure._energy_ledger import ledger_and_motors
from jaxbiped.measure._samples import (
    Samples,
    evaluate_along,
    evaluate_at,
    moments_of_change,
    sample,
)
from jaxbiped.scene._scene import RedundantScene, Scene
from jaxbiped.scene._structure import Structure
from jaxbiped.simulate._trajectory import Trajectory, check_scene_of

if TYPE_CHECKING:
    import xarray

QUANTITIES = {
    "leg": Quantity("leg that strikes"),
    "time": Quantity("time of the strike", "$t$", "s"),
    "period": Quantity("period", "$T$", "s"),
    "length": Quantity("step length", "$L$", "m"),
    "speed": Quantity("speed", "$v$", "m/s"),
    "peak_normal": Quantity("peak normal force", "$F$", "N"),
    "max_penetration": Quantity("largest penetration", "$\\delta$", "m"),
    "double_support": Quantity("double support", "", "s"),
    "cost_of_transport": Quantity("cost of transport", "$C$"),
    "energy_residual": Quantity("energy left open", "", "J"),
}
"""Variables of the dataset of footsteps."""


class HeelStrikes(NamedTuple):
    """Heel strikes of a walk; leaves of shape (n,).

    Attributes:
        time_s: time at which the foot touches down [s].
        foot: number of the leg that strikes, counted from 1 in the order of the mechanism's legs.
    """

    time_s: np.ndarray
    foot: np.ndarray


@dataclasses.dataclass(frozen=True)
class Footsteps(Tabular):
    """Footsteps of a walk, each from one heel strike to the next; leaves of shape (n,).

    Attributes:
        time_s: time of the heel strike that completes the step [s].
        period_s: time since the heel strike before [s].
        length_m: distance along the slope between the places where the two legs struck, measured at
            the foot of each that touched first [m].
        speed_m_s: length over period [m/s].
        peak_normal_N: largest normal force on a foot [N].
        max_penetration_m: largest penetration of a foot that touches [m].
        double_support_s: time from the first strike until a single leg carries the load again [s].
        cost_of_transport: see `jaxbiped.measure.cost_of_transport` [–].
        energy_residual_J: residual of the step's energy ledger [J].
        leg: name of the leg that strikes.
    """

    rows: ClassVar[str] = "footstep"
    time_s: np.ndarray
    period_s: np.ndarray
    length_m: np.ndarray
    speed_m_s: np.ndarray
    peak_normal_N: np.ndarray  # noqa: N815 (newton)
    max_penetration_m: np.ndarray
    double_support_s: np.ndarray
    cost_of_transport: np.ndarray
    energy_residual_J: np.ndarray  # noqa: N815 (joule)
    leg: np.ndarray

    def to_dataset(self) -> "xarray.Dataset":
        """The footsteps as a labelled dataset, for `to_netcdf` or `to_zarr`.

        Returns:
            The fields along `footstep`, named without their units, in SI units.
        """
        fields = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return footstep_dataset(fields)


def footstep_dataset(fields: Mapping[str, Any]) -> "xarray.Dataset":
    """Footsteps as a dataset: columns by names that end with their units, as "period_s"."""
    import xarray

    entries = {}
    for name, quantity in QUANTITIES.items():
        unit = quantity.unit.replace("/", "_")
        own = f"{name}_{unit}" if unit else name
        if own in fields:
            entries[name] = Entry((Footsteps.rows,), fields[own], quantity)
    return xarray.Dataset(variables_of(entries))


def heel_strikes(scene: Scene, trajectory: Trajectory) -> HeelStrikes:
    """Heel strikes: a leg touches down ahead of the leg that carries the load, which struck before.

    The feet of a leg count as one: a toe that follows its heel does not count as a strike.

    Args:
        scene: the scene that was simulated.
        trajectory: the motion, with every step saved.

    Returns:
        Time [s] and leg of all n heel strikes, with leaves of shape (n,).

    Raises:
        ArgumentError: the scene is that of a rigid walker, whose trajectory holds its heel strikes.
        ValueError: the trajectory has no continuous solution, or is a batch.
    """
    check_type("scene", scene, Scene, RedundantScene)
    check_scene_of(trajectory, scene)
    trajectory.require_dense()
    found_feet = evaluate_along(scene, trajectory.state, contacts).feet
    before, after = (rows_of(found_feet, part) for part in (slice(-1), slice(1, None)))
    structure = scene.mechanism.structure
    lands = np.stack(landings(structure, before, after))
    last = int(standing_leg(structure, rows_of(found_feet, 0)))
    found: list[tuple[int, int]] = []
    for k in np.flatnonzero(lands.any(axis=0)):
        for leg in range(1, 1 + len(lands)):
            if lands[leg - 1, k] and (leg != last or len(lands) == 1):
                found.append((int(k), leg))
                last = leg
    steps = np.array([k for k, _ in found], dtype=int)
    foot = np.array([leg for _, leg in found], dtype=int)

    def strikes(now: Contacts) -> np.ndarray:
        return np.choose(foot[:, None] - 1, _of_legs(structure, now.touching))

    t = np.asarray(trajectory.t)
    time = moments_of_change(scene, trajectory, contacts, strikes, t[steps], t[steps + 1])
    return HeelStrikes(time, foot)


def footsteps(scene: Scene, trajectory: Trajectory) -> Footsteps:
    """Measures of every footstep that a trajectory completes.

    Args:
        scene: the scene that was simulated.
        trajectory: the motion, with every step saved.

    Returns:
        The measures of all n footsteps, with leaves of shape (n,), also for n = 0; the names of the
            fields contain the units.

    Raises:
        ArgumentError: the scene is that of a rigid walker, whose trajectory holds its heel strikes.
        ValueError: the trajectory has no continuous solution, or is a batch.

    Examples:
        >>> import jaxbiped as jb
        >>> scene = jb.seed_scene()
        >>> how = dict(footsteps=2, accuracy="draft", engine="lanes")
        >>> walk = jb.simulate(scene, jb.seed_state(), **how)
        >>> jb.footsteps(scene, walk).length_m.round(3)
        array([0.18])
    """
    strikes = heel_strikes(scene, trajectory)
    count = max(len(strikes.time_s) - 1, 0)
    structure = scene.mechanism.structure
    leg = np.array(structure.legs)[strikes.foot[1:] - 1]
    if count == 0:
        nothing = {field.name: np.zeros(0) for field in dataclasses.fields(Footsteps)}
        return Footsteps(**nothing | {"leg": leg[:0]})
    time = strikes.time_s
    period, length = np.diff(time), np.diff(strike_places(scene, trajectory, strikes))
    loads = sample(scene, trajectory, contacts, time)
    distance = np.diff(evaluate_at(scene, trajectory, root_place, time))
    ledger, motors = ledger_and_motors(scene, trajectory, time)
    weight = float(scene.mechanism.total_mass) * float(scene.ground.g)
    normal = np.max([np.asarray(force.normal) for force in loads.values.forces], axis=0)
    return Footsteps(
        time_s=time[1:],
        period_s=period,
        length_m=length,
        speed_m_s=length / period,
        peak_normal_N=_largest(normal, loads, time),
        max_penetration_m=_largest(_depth(loads.values), loads, time),
        double_support_s=_double_support(scene, trajectory, time, loads),
        cost_of_transport=(motors + ledger.gravity_work) / (weight * distance),
        energy_residual_J=ledger.residual,
        leg=leg,
    )


def root_place(scene: Scene, state: Any) -> Scalar:
    """Place of the root point along the slope [m]."""
    return getattr(minimal_state(scene, state), scene.mechanism.structure.coordinates[0])


def strike_places(scene: Scene, trajectory: Trajectory, strikes: HeelStrikes) -> np.ndarray:
    """Where legs strike along the slope [m], shape (n,): each with its foot that touches first."""
    feet = evaluate_at(scene, trajectory, contacts, strikes.time_s).feet
    places = np.zeros(len(strikes.time_s))
    for leg, own in enumerate(scene.mechanism.structure.feet_of_leg, 1):
        first = np.argmax([feet[k].penetration for k in own], axis=0)
        place = np.choose(first, [feet[k].x for k in own])
        places = np.where(strikes.foot == leg, place, places)
    return places


def _of_legs(structure: Structure, of_feet: Sequence[Numbers]) -> list[np.ndarray]:
    """Of each leg whether any of its feet does (booleans)."""
    return [
        np.asarray(np.any([of_feet[k] for k in feet], axis=0)) for feet in structure.feet_of_leg
    ]


def _depth(now: Contacts) -> np.ndarray:
    """The largest penetration of a foot that touches [m]."""
    depths = [
        np.where(touching, foot.penetration, 0.0)
        for touching, foot in zip(now.touching, now.feet, strict=True)
    ]
    return np.max(depths, axis=0)


def _largest(values: np.ndarray, loads: Samples, time: np.ndarray) -> np.ndarray:
    largest = np.zeros(len(time) - 1)
    step, inside = loads.stretches(time)
    np.maximum.at(largest, step[inside], values[inside].max(axis=1))
    return largest


def _double_support(
    scene: Scene, trajectory: Trajectory, time: np.ndarray, loads: Samples
) -> np.ndarray:
    """Time from each heel strike but the last until one leg alone carries again [s]."""
    durations, edges = np.zeros(len(time) - 1), loads.edges

    def shared(now: Contacts) -> np.ndarray:
        carry = [force.normal > 0.0 for force in now.forces]
        return np.asarray(np.sum(_of_legs(scene.mechanism.structure, carry), axis=0) > 1)

    carried = np.asarray(shared(loads.values).all(axis=1))
    spans = []
    for k, start in enumerate(time[:-1]):
        first = int(np.searchsorted(edges, start))
        ends = np.flatnonzero(~carried[first:])
        if ends.size and ends[0] > 0:
            spans.append((k, edges[first + ends[0] - 1], edges[first + ends[0] + 1]))
    if spans:
        which, left, right = (np.array(column) for column in zip(*spans, strict=True))
        released = moments_of_change(scene, trajectory, contacts, shared, left, right)
        durations[which] = released - time[which]
    return durations
