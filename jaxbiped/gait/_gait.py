"""Periodic gait: its state, measures, stability and sensitivities, found or not."""

from typing import TYPE_CHECKING

import equinox as eqx
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import check_unbatched
from jaxbiped._ending import Ending
from jaxbiped._quantity import Quantity
from jaxbiped._summary import notebook_html, summary
from jaxbiped._tables import Tabular, variables_of
from jaxbiped._types import Scalar, by_numpy
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._state import recurring_leaves
from jaxbiped.gait._fixed_point_search import (
    FixedPointProblem,
    Found,
    Search,
    minimal_cycle,
    search_by_lanes,
)
from jaxbiped.gait._gait_table import gait_coordinates, gait_entries
from jaxbiped.gait._measures import (
    Measures,
    elasticities_of,
    measure_errors,
    measure_slopes,
    nodes_of,
    speed_backwards,
    step_lengths,
)
from jaxbiped.gait._orbit_derivatives import orbit_of, with_parameter_columns
from jaxbiped.gait._search_provenance import FoundBy, Origin, OtherGait
from jaxbiped.gait._stability import Bifurcation
from jaxbiped.scene._parameter_access import parameter_quantities
from jaxbiped.solve._error_estimate import ErrorEstimate

if TYPE_CHECKING:
    import xarray


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
        sound: whether the orbit is a walk (boolean): no foot is deep underground, the step leads
            downhill, and more than a fraction of a swing lies between crossings.
        origin: how the search found the gait, which other gaits it found, and where the branch of
            the seed's gait ended on the way to this scene; see `found_by` and `others`.
        step_lengths: distance of each heel strike from the one before [m], shape (footsteps,).
        orbit: times [s] and states at the ends of the solver steps of the last cycle, NaN beyond
            the last.
        error: error bars of `measures`, `multipliers` and `sensitivities`, an `ErrorEstimate`; None
            unless the accuracy was a number.
        parameters: names of the p parameters.
        engine: engine that computed it: "xla" or "lanes".
        cycle: "step" for a mirrored walker, "stride" for any other.
        quantities: words, symbols and units of the parameters; () if they are not known.
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
    error: ErrorEstimate | None = None
    _repr_html_ = notebook_html

    def __repr__(self) -> str:
        like, code = self.measures.period, self.ending
        return summary(self, like=like, code=code, names=Search, engine=self.engine)

    @property
    def outcome(self) -> Search:
        """Outcome of the search, as a `Search`; for one gait, not a batch."""
        return Search.of(self.ending)

    @property
    def walk_outcome(self) -> Ending:
        """`Ending` of the last trial that did not return; for one gait, not a batch."""
        return Ending.of(self.walk_ending)

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
        found: Scalar = by_numpy(
            lambda _, ending, radius: (ending == int(Search.FOUND)) & (radius < 1.0),
            self.ending,
            self.measures.spectral_radius,
        )
        return found

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


@host_jit(search_by_lanes)
def summarise_gait(
    problem: FixedPointProblem, found: Found, names: tuple[str, ...], radius: bool, origin: Origin
) -> Gait:
    """The gait that a search found, with its stability and its derivatives.

    Args:
        problem: what was searched; its active parameters are those that are asked for.
        found: what the search came to.
        names: of the active parameters.
        radius: whether the spectral radius is differentiated.
        origin: how the search came to it.
    """
    path = nodes_of(found.last, problem.guess)  # of the search, whose steps are counted
    found = with_parameter_columns(problem, found)
    orbit = orbit_of(problem, found, radius=radius)
    stability = orbit.stability
    last, m = found.last, found.recurring.shape[0]
    structure = problem.args.mechanism.structure
    lost = found.ending == int(Search.NO_RETURN)

    def known(tree: PyTree) -> PyTree:
        """NaN where no cycle was ever completed."""
        return jtu.tree_map(lambda leaf: jnp.where(lost, jnp.nan, leaf), tree)

    measures = Measures(
        period=last.period,
        step_length=last.advance[0],
        speed=last.advance[0] / last.period,
        peak_normal=last.peak,
        spectral_radius=stability.spectral_radius,
        state=orbit.state,
    )
    measures = known(measures)._replace(state=orbit.state)
    slopes = measure_slopes(orbit, measures, orbit.slopes, orbit.radius_slopes)
    backwards = speed_backwards(measures)
    slope_errors = measure_slopes(orbit, backwards, orbit.slope_errors, orbit.radius_errors)
    errors = measure_errors(measures, orbit)
    rows = jnp.concatenate([last.jacobian, last.period_row[None], last.advance_rows])
    told = dict(
        measure_errors=errors,
        multipliers=stability.multipliers,
        multiplier_errors=stability.errors,
        directions=stability.directions,
        monodromy=last.monodromy[:, :m],
        step_lengths=step_lengths(problem, last, path[1]),
        return_jacobian=rows[:, :m],
        unit_multiplier_error=stability.unit_error,
        sensitivities=jtu.tree_map(lambda leaf: leaf / orbit.sizes, slopes),
        sensitivity_errors=jtu.tree_map(lambda leaf: leaf / jnp.abs(orbit.sizes), slope_errors),
        elasticities=elasticities_of(problem, measures, slopes),
    )
    off = jnp.stack(recurring_leaves(errors.state))
    is_found = found.ending == int(Search.FOUND)
    return Gait(
        **known(told),
        ending=found.ending,
        walk_ending=found.code,
        measures=measures,
        residual=found.residual,
        bifurcation=jnp.where(is_found, stability.bifurcation, int(Bifurcation.NONE)),
        evaluations=found.evaluations,
        history=found.history,
        solver_steps=last.attempted,
        grazes=last.grazes,
        cycle_footsteps=problem.args.arrival_footsteps
        * minimal_cycle(last, off, problem.precision.rtol),
        sound=found.sound,
        origin=jtu.tree_map(jnp.asarray, origin),
        orbit=path,
        parameters=names,
        engine=problem.spec.engine,
        cycle="stride" if len(structure.namings) == 1 else "step",
        quantities=tuple(map(parameter_quantities(problem.args).__getitem__, names)),
    )
