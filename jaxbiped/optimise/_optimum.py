"""Optimum: the best design that an optimisation came to, how it ended, and every iterate."""

import dataclasses
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from jaxbiped._ending import NamedCode
from jaxbiped._quantity import Quantity
from jaxbiped._tables import Entry, Tabular, variables_of
from jaxbiped.gait._gait import Gait
from jaxbiped.optimise._design_problem import DesignProblem
from jaxbiped.optimise._objective_values import Evaluation
from jaxbiped.optimise._optimality import Curvature, Optimality
from jaxbiped.optimise._optimum_sensitivities import Sensitivities
from jaxbiped.scene._parameter_access import parameter_quantities
from jaxbiped.scene._scene import WalkerScene

if TYPE_CHECKING:
    import xarray


class Outcome(NamedCode):
    """How an optimisation ended. `str(outcome)` is its name in words.

    - converged: the optimiser's own test is met, every requirement holds to within its measure's
      error bar, the design's own derivatives balance to 1e-3 of the objective, as surely as that,
      and the gait is not at a fold.
    - corner: no better design was found nearby, but it is not certain to be an optimum, for one of
      these does not hold (the message says which), for example at a ridge of the objective.
    - unfinished: the iterations were used up, or the optimiser could not go on.
    - interrupted: by Ctrl-C; the best so far is kept.
    - infeasible: no design was found that meets the requirements; the nearest one is returned.
    - beyond range: the distance of a fold or doubling was to be optimised, and for the best design
      it lies beyond the range that is followed. The distance has no derivatives there, so better
      designs cannot be distinguished.
    - flat: the objective does not depend on the variables, as far as its error bars show.
    """

    CONVERGED = 0
    CORNER = 1
    UNFINISHED = 2
    INTERRUPTED = 3
    INFEASIBLE = 4
    BEYOND_RANGE = 5
    FLAT = 6


class Iteration(NamedTuple):
    """An iterate of an optimisation.

    Attributes:
        variables: parameters by name.
        objective: the requested sum of measures.
        excess: largest violation of a requirement, relative to its bound.
        measures: measures in the objective and the requirements, by name.
        beyond_range: those of them whose bifurcation lies beyond the range that is followed; the
            value is a lower bound.
    """

    variables: dict[str, float]
    objective: float
    excess: float
    measures: dict[str, float]
    beyond_range: tuple[str, ...] = ()


@dataclasses.dataclass(frozen=True, repr=False)
class Optimum(Tabular):
    """The best design that an optimisation found.

    Attributes:
        outcome: how the optimisation ended.
        message: the optimiser's message, why the design is not certain to be an optimum, and which
            fold or doubling lies beyond its range.
        scene: scene of the best design.
        gait: its gait, with the sensitivities to all parameters.
        variables: its parameters by name.
        objective: the requested sum of measures.
        error: estimated error of the objective, with what the errors of the measures that are held
            are worth.
        known: measures in the objective and the requirements, with gradients and errors.
        quantities: words, symbol and unit of these by name, of those that have some.
        optimality: the optimality conditions.
        curvature: the reduced Hessian of an optimum that converged; None of others.
        sensitivities: derivatives of the optimum with respect to all that is fixed.
        history: every iterate, of all runs one after the other.
        evaluations: number of designs whose gait was found.
        lost: number of evaluations in which no gait was found or a measure of the gait was not
            finite.
        unmeasured: number of gaits with a measure that was not finite.
        problem: what was optimised, for `torque_gap` and `refine`.
        formulation: the one in use, "gait by gait" or "together".
    """

    rows: ClassVar[str] = "variable"
    outcome: Outcome
    message: str
    scene: WalkerScene
    gait: Gait
    variables: dict[str, float]
    objective: float
    error: float
    known: Evaluation
    quantities: dict[str, Quantity]
    optimality: Optimality
    curvature: Curvature | None
    sensitivities: Sensitivities
    history: list[Iteration]
    evaluations: int
    lost: int
    unmeasured: int
    problem: DesignProblem
    formulation: str

    @property
    def measures(self) -> dict[str, float]:
        """Measures in the objective and the requirements, and those of its gait, by name."""
        return dict(self.known.values)

    def __repr__(self) -> str:
        variables = ", ".join(f"{name}={value:.6g}" for name, value in self.variables.items())
        return (
            f"Optimum({self.outcome}, objective={self.objective:.6g}, {variables}, "
            f"engine={self.gait.engine}, {self.evaluations} gaits)"
        )

    def to_dataset(self) -> "xarray.Dataset":
        """The optimum as a labelled dataset, for `to_netcdf` or `to_zarr`.

        Returns:
            The best design's parameters along `variable`; the measures with their errors along
            `measure`; the derivatives of all these with respect to what is fixed along `parameter`
            (`sensitivity_…`); and every iterate along `iteration`: the objective, the largest
            violation of a requirement (`excess`), the design (`design_…`) and its measures
            (`measure_…`).
            `gait.to_dataset()` has the gait.
        """
        import xarray

        units = parameter_quantities(self.scene)
        names = list(self.variables)
        measures, quantities = list(self.quantities), list(self.quantities.values())
        at, value = ("iteration",), Quantity("value", unit="SI")
        values, errors = (
            [part[name] for name in measures] for part in (self.known.values, self.known.errors)
        )
        entries = {
            "value": Entry(("variable",), list(self.variables.values()), value),
            "measured": Entry(("measure",), values, value, errors),
            "objective": Entry(at, [each.objective for each in self.history], value),
            "excess": Entry(at, [each.excess for each in self.history], Quantity("excess")),
        }
        slopes, along = self.sensitivities, ("parameter",)
        of_values, value_errors = (
            [part[name] for name in names] for part in (slopes.variables, slopes.variable_errors)
        )
        of_measures, measure_errors = (
            [part[name] for name in measures] for part in (slopes.measures, slopes.measure_errors)
        )
        entries |= {
            "sensitivity_objective": Entry(along, slopes.objective, value, slopes.objective_errors),
            "sensitivity_value": Entry(("variable", *along), of_values, value, value_errors),
            "sensitivity_measured": Entry(("measure", *along), of_measures, value, measure_errors),
        }
        for name in names:
            column = [each.variables[name] for each in self.history]
            entries[f"design_{name}"] = Entry(at, column, units[name])
        for name, quantity in zip(measures, quantities, strict=True):
            column = [each.measures.get(name, np.nan) for each in self.history]
            entries[f"measure_{name}"] = Entry(at, column, quantity)
        coordinates = {
            "variable": np.array(names, object),
            "unit": ("variable", np.array([units[name].unit for name in names], object)),
            "parameter": np.array(slopes.parameters, object),
            "measure": np.array(measures, object),
            "measure_unit": ("measure", np.array([each.unit for each in quantities], object)),
        }
        attributes = {
            "outcome": str(self.outcome),
            "objective": self.objective,
            "objective_error": self.error,
            "message": self.message,
            "evaluations": self.evaluations,
            "formulation": self.formulation,
        }
        return xarray.Dataset(variables_of(entries), coordinates, attributes)
