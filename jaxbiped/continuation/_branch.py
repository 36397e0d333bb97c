"""Branch of gaits along a parameter: its points, bifurcations and ends, also as a dataset."""

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import equinox as eqx
import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._files import strict_json
from jaxbiped._identity import difference_of
from jaxbiped._quantity import Quantity
from jaxbiped._summary import notebook_html
from jaxbiped._tables import Entry, Tabular, variables_of
from jaxbiped.continuation._bifurcations import EVENTS, BifurcationPoint
from jaxbiped.continuation._branch_point import Axis, BranchPoint, CycleFootsteps
from jaxbiped.continuation._trace import BranchStop
from jaxbiped.dynamics._state import recurring_names, state_quantity
from jaxbiped.gait._branch_along import state_at
from jaxbiped.gait._gait import QUANTITIES
from jaxbiped.gait._search_provenance import BranchEnd
from jaxbiped.gait._stability import Bifurcation
from jaxbiped.hybrid._hybrid_system import MINIMAL_SCENES
from jaxbiped.hybrid._sections import AbstractSection, section_of
from jaxbiped.scene._parameter_access import parameter_quantities, scene_identity, with_parameters
from jaxbiped.scene._scene import AbstractMinimalScene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.scene._state_types import WalkerState

if TYPE_CHECKING:
    import xarray

_STABLE = {True: 1, False: 0, None: -1}
_NUMBERS = ("period", "step_length", "peak_normal", "unit_multiplier_error", "residual")
_HOW = ("footsteps", "accuracy", "engine")
_EVENT_NUMBERS = ("multiplier_real", "multiplier_imag", "error", "value_error", "beyond")
_OWN = {
    "unit_multiplier_error": Quantity("error of the unit multiplier"),
    "residual": Quantity("residual", unit="SI"),
}


class Branch(eqx.Module, Tabular):
    """A branch of periodic gaits along a parameter, n points in the order of its arclength.

    Attributes:
        scene: the walker; on the branch, one of its parameters varies.
        points: the gaits, each a `BranchPoint`.
        bifurcations: folds, period doublings, Neimark–Sacker points, limits and crossings that were
            not located, in their order along the branch, each a `BifurcationPoint`.
        stops: how the branch ended at its two ends, each a `BranchStop`.
        axis: the parameter and its range.
        state_type: type of the states on the section.
        footsteps: number of footsteps of a cycle.
        accuracy, engine: accuracy and engine with which it was followed.
        section: section on which the cycles begin; None for the scene's own.
    """

    rows: ClassVar[str] = "point"
    scene: AbstractMinimalScene
    points: tuple[BranchPoint, ...]
    bifurcations: tuple[BifurcationPoint, ...]
    stops: tuple[BranchStop, BranchStop]
    axis: Axis
    state_type: type = eqx.field(static=True)
    footsteps: int = eqx.field(static=True)
    accuracy: str = eqx.field(static=True)
    engine: str = eqx.field(static=True)
    section: AbstractSection | None = eqx.field(static=True, default=None)

    def __len__(self) -> int:
        return len(self.points)

    _repr_html_ = notebook_html

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
        """Values of the parameter, SI units, shape (n,)."""
        return np.array([point.value for point in self.points])

    @property
    def stable(self) -> list[bool | None]:
        """Whether each gait is stable; None if an error bar crosses the unit circle."""
        return [point.stable for point in self.points]

    @property
    def multipliers(self) -> np.ndarray:
        """Floquet multipliers, largest first, shape (n, m − 1), complex."""
        return np.stack([point.multipliers for point in self.points])

    def state(self, point: int | BranchPoint | BifurcationPoint) -> WalkerState:
        """The state on the section of a gait: of the point of that number, or of a given one."""
        found = self.points[point] if isinstance(point, int) else point
        found = found.point if isinstance(found, BifurcationPoint) else found
        return state_at(self.state_type, found.recurring)

    def scene_at(self, point: int | BranchPoint | BifurcationPoint) -> Any:
        """The scene of a gait: of the point with that number, or of a given point."""
        value = self.points[point].value if isinstance(point, int) else point.value
        return with_parameters(self.scene, {self.axis.name: value})

    def to_dataset(self) -> "xarray.Dataset":
        """The branch as a dataset for `to_netcdf` or `to_zarr`; `open_branch` restores it.

        Returns:
            In SI units. Along `point`: parameter, `state_…`, period, step_length, speed,
            peak_normal, spectral_radius and multipliers with their errors, `stable` (1, 0, or −1 if
            the errors leave it open) and `bifurcation`; `footstep_…` are those of each footstep of
            a cycle. Along `event`: the same for special points, with kind, critical multiplier and
            its error. Everything else is in the attributes.
        """
        return _branch_dataset(self)


def _branch_dataset(branch: Branch) -> "xarray.Dataset":
    import xarray

    entries = _entries(branch, branch.points, "", "point")
    entries |= _entries(branch, [e.point for e in branch.bifurcations], "event_", "event")
    kinds = np.array([EVENTS.index(each.kind) for each in branch.bifurcations], np.int8)
    flags = dict(enumerate(map(str, EVENTS)))
    entries["event_kind"] = Entry(("event",), kinds, Quantity("bifurcation"), flags=flags)
    rows = [
        (e.multiplier.real, e.multiplier.imag, e.error, e.value_error, e.beyond)
        for e in branch.bifurcations
    ]
    numbers = np.array(rows, float).reshape(-1, len(_EVENT_NUMBERS)).T
    value = parameter_quantities(branch.scene)[branch.along]
    critical = "critical multiplier"
    told: dict[str, tuple[Quantity, str | None]] = {
        "multiplier_real": (Quantity(f"{critical}, real"), "event_error"),
        "multiplier_imag": (Quantity(f"{critical}, imaginary"), "event_error"),
        "error": (Quantity(f"error of the {critical}"), None),
        "value_error": (value._replace(words=f"error of the {value.words}"), None),
        "beyond": (value._replace(words=f"{value.words} beyond it"), None),
    }
    for (name, (quantity, bars)), each in zip(told.items(), numbers, strict=True):
        entries[f"event_{name}"] = Entry(("event",), each, quantity, bars)
    name = f"event_{branch.along}"
    entries[name] = entries[name]._replace(errors="event_value_error")
    settings = {
        "along": branch.along,
        "axis": branch.axis._asdict(),
        "stops": [[int(each.end), each.cause, each.value] for each in branch.stops],
        **scene_identity(branch.scene),
        **{name: getattr(branch, name) for name in _HOW},
    }
    text = strict_json(settings, unknown=str)
    return xarray.Dataset(variables_of(entries), attrs={"branch": text})


def _entries(
    branch: Branch, points: Sequence[BranchPoint], before: str, along: str
) -> dict[str, Entry]:
    """Variables of points along a dimension, their names behind `before`."""
    names, n = recurring_names(branch.state_type), len(points)
    m = len(names)

    def table(name: str, width: int, kind: type) -> np.ndarray:
        rows = [getattr(point, name) for point in points]
        return np.array(rows, kind).reshape(n, width)

    values, errors = table("multipliers", m - 1, complex), table("multiplier_errors", m - 1, float)
    own = {name: np.array([getattr(each, name) for each in points], float) for name in _NUMBERS}
    own["speed"] = own["step_length"] / own["period"]
    value = np.array([point.value for point in points], float)
    entries = {
        branch.along: Entry((along,), value, parameter_quantities(branch.scene)[branch.along])
    }
    for name, each in own.items():
        entries[name] = Entry((along,), each, _OWN.get(name) or QUANTITIES[name])
    entries["spectral_radius"] = Entry(
        (along,), np.abs(values[:, 0]), QUANTITIES["spectral_radius"], errors[:, 0]
    )
    for name, each in zip(names, table("recurring", m, float).T, strict=True):
        entries[f"state_{name}"] = Entry((along,), each, state_quantity(name) or Quantity(name))
    each_of = (along, "multiplier")
    for word, part in (("real", values.real), ("imaginary", values.imag)):
        words, bars = Quantity(f"multiplier, {word}"), f"{before}multipliers_error"
        entries[f"multipliers_{word[:4]}"] = Entry(each_of, part, words, bars)
    entries["multipliers_error"] = Entry(each_of, errors, Quantity("error of the multiplier"))
    stable = np.array([_STABLE[point.stable] for point in points], np.int8)
    flags = {-1: "undecided", 0: "unstable", 1: "stable"}
    entries["stable"] = Entry((along,), stable, Quantity("stability"), flags=flags)
    codes = np.array([point.bifurcation for point in points], np.int8)
    words, flags = Quantity("multiplier on the unit circle"), {int(e): str(e) for e in Bifurcation}
    entries["bifurcation"] = Entry((along,), codes, words, flags=flags)
    for name in ("place", "tangent"):
        words = Quantity(f"{name} on the curve of gaits", unit="scaled")
        entries[name] = Entry((along, "component"), table(name, m + 1, float), words)
    if cycles := [point.footsteps for point in points if point.footsteps is not None]:
        begins, *others = map(np.stack, zip(*cycles, strict=True))
        columns = [*(f"state_{name}" for name in names), *CycleFootsteps._fields[1:]]
        for name, rows in zip(columns, [*np.moveaxis(begins, -1, 0), *others], strict=True):
            entries[f"footstep_{name}"] = Entry((along, "footstep"), rows, entries[name].quantity)
    return {before + name: entry for name, entry in entries.items()}


def open_branch(
    dataset: "xarray.Dataset",
    scene: AbstractMinimalScene,
    *,
    section: AbstractSection | None = None,
) -> Branch:
    """The branch that a dataset holds, to draw it or to continue it with `resume_branch`.

    Args:
        dataset: a dataset from `Branch.to_dataset`, also after it was stored and opened again.
        scene: the scene of the branch.
        section: the section of its cycles, if it was given.

    Returns:
        The branch.

    Raises:
        ArgumentError: the dataset is of another kind or another scene, or lacks a variable.
    """
    scene = check_scene(scene, *MINIMAL_SCENES)
    if "branch" not in dataset.attrs:
        raise ArgumentError("dataset is not allowed: it must be that of a branch.")
    settings = json.loads(dataset.attrs["branch"])
    own = scene_identity(scene)
    if difference := difference_of({name: settings.get(name) for name in own}, own):
        raise ArgumentError(
            f"scene is not allowed: it differs from the branch's own in {difference}."
        )
    kind = scene.state_type
    special = _points(dataset, kind, settings["along"], "event_")
    events = [
        BifurcationPoint(EVENTS[int(kind)], point, complex(real, imaginary), *map(float, errors))
        for kind, point, real, imaginary, *errors in zip(
            _column(dataset, "event_kind"),
            special,
            *(_column(dataset, f"event_{name}") for name in _EVENT_NUMBERS),
            strict=True,
        )
    ]
    first, last = (BranchStop(BranchEnd(end), why, float(at)) for end, why, at in settings["stops"])
    return Branch(
        scene=scene,
        points=tuple(_points(dataset, kind, settings["along"], "")),
        bifurcations=tuple(events),
        stops=(first, last),
        axis=Axis(**settings["axis"]),
        state_type=kind,
        section=section_of(scene, section),
        **{name: settings[name] for name in _HOW},
    )


def _column(dataset: "xarray.Dataset", name: str) -> np.ndarray:
    if name not in dataset.variables:
        raise ArgumentError(
            f"dataset is not allowed: it has no variable {name!r}, as branches of this version do."
        )
    return np.asarray(dataset[name].values)


def _points(dataset: "xarray.Dataset", kind: Any, along: str, before: str) -> list[BranchPoint]:
    def column(name: str) -> np.ndarray:
        return _column(dataset, before + name)

    def states(of: str) -> np.ndarray:
        return np.stack([column(f"{of}state_{name}") for name in recurring_names(kind)], axis=-1)

    values = column("multipliers_real") + 1j * column("multipliers_imag")
    errors, codes = column("multipliers_error"), column("bifurcation")
    numbers = {name: column(name) for name in _NUMBERS}
    value, recurring = column(along), states("")
    place, tangent = column("place"), column("tangent")
    steps: list[CycleFootsteps | None] = [None] * len(value)
    if f"{before}footstep_period" in dataset.variables:
        others = (column(f"footstep_{name}") for name in CycleFootsteps._fields[1:])
        steps = [*map(CycleFootsteps, states("footstep_"), *others)]
    return [
        BranchPoint(
            value=float(value[k]),
            recurring=recurring[k],
            multipliers=values[k],
            multiplier_errors=errors[k],
            bifurcation=int(codes[k]),
            place=place[k],
            tangent=tangent[k],
            footsteps=steps[k],
            **{name: float(each[k]) for name, each in numbers.items()},
        )
        for k in range(len(value))
    ]
