"""Periodic gait: its state, measures, stability and sensitivities, found or not, and its table."""

from enum import IntEnum
from typing import TYPE_CHECKING, Any, NamedTuple

import equinox as eqx
import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt
from jaxtyping import PyTree

from jaxbiped._checks import check_unbatched
from jaxbiped._ending import NamedCode, endings_named
from jaxbiped._quantity import Quantity
from jaxbiped._summary import call_text, in_short, notebook_html, summary
from jaxbiped._tables import Entry, Tabular, variables_of
from jaxbiped._types import Scalar, by_numpy, is_traced
from jaxbiped.dynamics._state import recurring_names, state_quantity
from jaxbiped.gait._fixed_point_search import (
    Search,
)
from jaxbiped.gait._search_provenance import BranchEnd, FoundBy, Origin, OtherGait
from jaxbiped.gait._stability import Bifurcation
from jaxbiped.solve._error_estimate import ErrorEstimate

if TYPE_CHECKING:
    import xarray

QUANTITIES = {
    "period": Quantity("period", "$T$", "s"),
    "step_length": Quantity("step length", "$L$", "m"),
    "speed": Quantity("speed", "$v$", "m/s"),
    "peak_normal": Quantity("peak normal force", "$F$", "N"),
    "spectral_radius": Quantity("spectral radius", "$\\rho$"),
}
"""What is measured of a gait by the fields of its `Measures`, the state left out."""


class Measures(NamedTuple):
    """Measures of a gait, or their derivatives; all leaves have one shape.

    The peak force of a rigid walker is that of single support; its impacts have impulses instead.

    Attributes:
        period: duration of the cycle [s].
        step_length: advance along the slope in a cycle [m]; of a hybrid system, that of its first
            cyclic coordinate, None if it has none.
        speed: mean speed along the slope [m/s]; None likewise.
        peak_normal: largest normal force on a foot [N]; None if the gradient mode does not provide
            it.
        spectral_radius: largest absolute value of a Floquet multiplier, without the trivial one;
            None if the gradient mode does not provide it.
        state: the state on the section, a `State` or a `RigidState`, hip_x zero.
    """

    period: Scalar
    step_length: PyTree
    speed: PyTree
    peak_normal: PyTree
    spectral_radius: PyTree
    state: PyTree

    def __repr__(self) -> str:
        return in_short(self)


class Gait(eqx.Module, Tabular):
    """A periodic gait, with p parameters. Under `vmap`, every array gains the axes of the batch.

    A state has m components besides the root point's place along the slope.

    Attributes:
        ending: code of a `Search`; `outcome` names it.
        walk_ending: code of the `Ending` of the last trial that did not return; 0 if all returned.
        measures: period, step length, speed, peak force, spectral radius and state.
        measure_errors: estimated errors of the measures, from the changes due to Newton's last
            correction and to a solve at a tolerance ten times looser; for the spectral radius, the
            error of the leading multiplier.
        residual: largest change of a component of the state over the cycle, SI units.
        multipliers: Floquet multipliers, largest first, without the trivial one; shape (m − 1,).
            Those of a mode, and of what a stop or a flat foot holds as a cycle begins, are 0.
        multiplier_errors: estimated errors of the multipliers, shape (m − 1,).
        directions: eigenvectors of the multipliers, in the space of the state without hip_x, shape
            (m, m − 1).
        monodromy: derivative of the motion over one cycle at a fixed time, shape (m, m).
        return_jacobian: derivatives of the returning state, the period and the step length with
            respect to the state on the section, shape (m + 2, m).
        unit_multiplier_error: distance from 1 of the multiplier that must be exactly 1.
        bifurcation: code of a `Bifurcation`: whether one lies within its error of the unit circle.
        sensitivities: derivatives of the measures with respect to each parameter, with leaves of
            shape (p,); NaN if the search did not converge.
        sensitivity_errors: estimated errors of the sensitivities, from two further solves and with
            a floor.
        elasticities: d log |measure| / d log parameter, with leaves of shape (p,); zero for a
            parameter that is zero, NaN for a measure that is zero.
        evaluations: number of evaluations of the return map in the search.
        history: residual of each evaluation, NaN beyond the last.
        solver_steps: solver steps attempted in the last cycle.
        grazes: how often the cycle touches a switch, for example a foot the ground, or misses it,
            by less than the tolerance resolves. Derivatives on the two sides then differ:
            multipliers are those of one side, their errors are infinite, and sensitivities are NaN.
        cycle_footsteps: smallest number of footsteps after which the orbit closes, a divisor of the
            requested number.
        sound: whether the orbit is a walk (boolean), and not one of those that *no walk* of
            `Search` describes.
        origin: how the search found the gait, which other gaits it found, and where the branch of
            the seed's gait ended on the way to this scene; see `found_by` and `others`.
        step_lengths: distance of each heel strike from the one before [m], shape (footsteps,).
        orbit: times [s] and states at the ends of the solver steps of the last cycle, NaN beyond
            the last.
        error: error bars of `measures`, `multipliers` and `sensitivities`, an `ErrorEstimate`; None
            unless the accuracy was a number.
        parameters: names of the p parameters.
        engine: engine that computed it: "xla" or "lanes".
        cycle: "step" for a mirrored walker, "stride" for any other, "cycle" for a hybrid system.
        quantities: words, symbols and units of the parameters; () if they are not known.
        endings: names of the endings of a hybrid system, which `walk_ending` may tell; None for a
            walker.
    """

    ending: Scalar
    walk_ending: Scalar
    measures: Measures
    measure_errors: Measures
    residual: Scalar
    multipliers: Scalar
    multiplier_errors: Scalar
    directions: Scalar
    monodromy: Scalar
    return_jacobian: Scalar
    unit_multiplier_error: Scalar
    bifurcation: Scalar
    sensitivities: Measures
    sensitivity_errors: Measures
    elasticities: Measures
    evaluations: Scalar
    history: Scalar
    solver_steps: Scalar
    grazes: Scalar
    cycle_footsteps: Scalar
    sound: Scalar
    origin: Origin
    step_lengths: Scalar
    orbit: tuple[Scalar, PyTree]
    parameters: tuple[str, ...] = eqx.field(static=True)
    engine: str = eqx.field(static=True)
    cycle: str = eqx.field(static=True)
    quantities: tuple[Quantity, ...] = eqx.field(static=True, default=())
    endings: tuple[str, ...] | None = eqx.field(static=True, default=None)
    error: ErrorEstimate | None = None
    _repr_html_ = notebook_html

    def __repr__(self) -> str:
        like, code = self.measures.period, self.ending
        if is_traced(self) or np.ndim(code):
            return summary(self, like=like, code=code, names=Search, engine=self.engine)
        numbers: dict[str, Any] = {"outcome": str(self.outcome), "residual": self.residual}
        if self.outcome is Search.FOUND:
            numbers |= {name: getattr(self.measures, name) for name in self.measured}
            numbers["stable"] = bool(self.stable)
        return call_text("Gait", numbers | {"cycle": self.cycle, "engine": self.engine})

    @property
    def measured(self) -> dict[str, Quantity]:
        """What is measured of it: those of `QUANTITIES` that its system has."""
        known = QUANTITIES.items()
        return {name: q for name, q in known if getattr(self.measures, name) is not None}

    @property
    def state(self) -> PyTree:
        """The state on the section, `measures.state`."""
        return self.measures.state

    @property
    def outcome(self) -> Search:
        """Outcome of the search, as a `Search`; for one gait, not a batch."""
        return Search.of(self.ending)

    @property
    def walk_outcome(self) -> NamedCode:
        """Ending of the last trial that did not return; for one gait, not a batch."""
        return endings_named(self.endings).of(self.walk_ending)

    @property
    def found_by(self) -> FoundBy:
        """The stage of the search that found it, as a `FoundBy`; for one gait, not a batch."""
        return FoundBy.of(self.origin.found_by)

    @property
    def others(self) -> list[OtherGait]:
        """Other gaits that the search found, by spectral radius; for one gait, not a batch."""
        seen = self.origin.others
        known = int(np.sum(np.isfinite(np.asarray(seen.period))))
        return [jtu.tree_map(lambda leaf, k=k: float(leaf[k]), seen) for k in range(known)]

    @property
    def critical(self) -> Bifurcation:
        """The bifurcation at which the gait is, as a `Bifurcation`; for one gait, not a batch."""
        return Bifurcation(int(self.bifurcation))

    @property
    def stable(self) -> Scalar:
        """Whether a gait was found and all its multipliers lie inside the unit circle."""
        return by_numpy(
            lambda _, ending, radius: (ending == int(Search.FOUND)) & (radius < 1.0),
            self.ending,
            self.measures.spectral_radius,
        )

    def to_dataset(self) -> "xarray.Dataset":
        """The gait as a labelled dataset, for `to_netcdf` or `to_zarr`; for one gait, not a batch.

        Returns:
            Measures and the state on the section (`state_…`) with their errors; multipliers along
            `multiplier`; sensitivities and elasticities along `parameter` (in tables:
            `along="parameter"`). NaN if no gait was found.

        Raises:
            ArgumentError: this is a batch of gaits.
        """
        import xarray

        check_unbatched("gait", self.ending, "one gait")
        attributes = {"engine": self.engine, "cycle": self.cycle}
        entries = variables_of(gait_entries(self))
        return xarray.Dataset(entries, gait_coordinates(self), attributes)


def gait_entries(gait: Gait) -> dict[str, Entry]:
    """Variables of a dataset of a gait; NaN where none was found.

    Measures and the state on the section with their errors, multipliers along `multiplier`,
    sensitivities and elasticities along `parameter`. Arrays of several gaits keep their first axis,
    which the entries' dimensions leave out.
    """
    found = np.asarray(gait.ending) == int(Search.FOUND)
    entries: dict[str, Entry] = {}

    def known(value: npt.ArrayLike) -> np.ndarray:
        number = np.asarray(value, dtype=np.float64)
        own = found.reshape(found.shape + (1,) * (number.ndim - found.ndim))
        return np.where(own, number, np.nan)

    def add(name: str, value: Any, quantity: Quantity, error: Any = None, *own: str) -> None:
        entries[name] = Entry(own, known(value), quantity, None if error is None else known(error))

    codes: dict[str, tuple[Any, type[IntEnum]]] = {
        "ending": (gait.ending, Search),
        "found_by": (gait.origin.found_by, FoundBy),
        "branch_end": (gait.origin.branch_end, BranchEnd),
    }
    for name, (code, kind) in codes.items():
        flags = {int(each): str(each) for each in kind}
        words = Quantity(name.replace("_", " "))
        entries[name] = Entry((), np.asarray(code, dtype=np.int8), words, flags=flags)
    for name, quantity in gait.measured.items():
        add(name, getattr(gait.measures, name), quantity, getattr(gait.measure_errors, name))
    for name in recurring_names(gait.measures.state):
        quantity = state_quantity(name) or Quantity(name)
        value, error = (getattr(each.state, name) for each in (gait.measures, gait.measure_errors))
        add(f"state_{name}", value, quantity, error)
    parts = {"real": np.real(gait.multipliers), "imaginary": np.imag(gait.multipliers)}
    for name, part in parts.items():
        words = Quantity(f"multiplier, {name}")
        add(f"multiplier_{name[:4]}", part, words, gait.multiplier_errors, "multiplier")
    words = Quantity("error of the unit multiplier")
    add("unit_multiplier_error", gait.unit_multiplier_error, words)
    add("residual", gait.residual, Quantity("residual", "", "SI"))
    add("grazes", gait.grazes, Quantity("switches that are grazed"))
    for name, quantity in gait.measured.items():
        slope, slope_error, elasticity = (
            np.asarray(getattr(each, name))
            for each in (gait.sensitivities, gait.sensitivity_errors, gait.elasticities)
        )
        per = Quantity(
            f"sensitivity of the {quantity.words}",
            unit=f"{quantity.unit or 1} per unit of the parameter",
        )
        add(f"sensitivity_{name}", slope, per, slope_error, "parameter")
        with np.errstate(divide="ignore", invalid="ignore"):
            bar = np.where(slope == 0.0, 0.0, slope_error * np.abs(elasticity / slope))
        words = Quantity(f"elasticity of the {quantity.words}")
        add(f"elasticity_{name}", elasticity, words, bar, "parameter")
    return entries


def gait_coordinates(gait: Gait) -> dict[str, Any]:
    """Coordinates of these: names of the parameters, and their SI units where they are known."""
    found: dict[str, Any] = {"parameter": np.array(gait.parameters, object)}
    if gait.quantities:
        units = np.array([each.unit for each in gait.quantities], object)
        found["parameter_unit"] = ("parameter", units)
    return found
