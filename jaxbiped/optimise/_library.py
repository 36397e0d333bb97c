"""Libraries of optimal gaits over a grid of parameters and required measures."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._progress import stage
from jaxbiped._quantity import Quantity
from jaxbiped._tables import Entry, variables_of
from jaxbiped.dynamics._state import coordinate_quantity, recurring_names
from jaxbiped.gait._gait import Gait
from jaxbiped.optimise._design_gaits import GaitSettings
from jaxbiped.optimise._design_problem import DesignProblem
from jaxbiped.optimise._design_problem import variables_of as design_variables
from jaxbiped.optimise._objective_values import Evaluations, functional_names
from jaxbiped.optimise._objectives import OBJECTIVES, check_objective, with_parts
from jaxbiped.optimise._optimality import objective_error, optimality_of, scale_at
from jaxbiped.optimise._optimise_gait import Goal, goal_of, optimise_gait
from jaxbiped.optimise._optimum import Outcome
from jaxbiped.optimise._optimum_grid import GridPoint, OptimumGrid, grid_point
from jaxbiped.optimise._requirements import SubjectTo, add_measure, requirements_of
from jaxbiped.scene._parameter_access import (
    parameter_names,
    parameter_quantities,
    with_parameters,
)
from jaxbiped.scene._scene import AbstractScene
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.sweep.starts._coordinates import axis_values

if TYPE_CHECKING:
    import xarray

_LOST, _NOT_REACHED = len(Outcome), len(Outcome) + 1
_OUTCOMES = {int(code): str(code) for code in Outcome} | {
    _LOST: "lost",
    _NOT_REACHED: "not reached",
}


def library(
    scene: AbstractScene,
    *,
    over: Mapping[str, Sequence[float] | np.ndarray],
    vary: Mapping[str, tuple[float, float]],
    maximise: Goal = None,
    minimise: Goal = None,
    subject_to: SubjectTo = None,
    guess: Gait | WalkerState | PyTree | None = None,
    footsteps: int | None = None,
    accuracy: str = "balanced",
    engine: str = "auto",
    progress: bool | None = None,
    **options: Any,
) -> "xarray.Dataset":
    """Optimal gaits at every point of a grid, each found from those of its neighbours.

    The first point, that of the first values, is optimised by `optimise_gait`. From there on the
    derivatives of each optimum predict those of its neighbours, and Newton's method corrects them;
    where that fails, the trust region goes on. Gaits are found in batches. Each point is certified
    as the optimum of `optimise_gait` is. Ctrl-C keeps the points that are done.

    Args:
        scene: the walker or hybrid system.
        over: values by name of each axis, arrays of shape (n,): of a parameter that is not varied,
            or of a measure that must have this value.
        vary, maximise, minimise, subject_to, guess, footsteps, accuracy, engine, progress: as for
            `optimise_gait`.
        options: further options of `optimise_gait` for the first point, such as `formulation`.

    Returns:
        A dataset along the axes, in SI units: `outcome` (codes, with names in the attributes: those
        of `Outcome`, "lost" where no gait was found from points up to two steps away, "not
        reached" after Ctrl-C) and `message`; `objective`, and its derivative along each axis,
        `slope_…`, with errors; the conditions' `residual` and `excess`, the least `curvature`; the
        design (`design_…`), its measures (`measure_…`) with errors, and the state of its gait
        (`state_…`). NaN where nothing is known.

    Raises:
        ArgumentError: an argument is not allowed (raised before anything is compiled); or the first
            point has no optimum with derivatives.

    Examples:
        >>> import jaxbiped as jb
        >>> gaits = jb.optimise.library(
        ...     jb.ladder()["rigid"],
        ...     over={"slope": [0.02, 0.021]},
        ...     vary={"d": (0.05, 0.2)},
        ...     maximise="speed",
        ... )
        >>> gaits["outcome"].values.tolist()
        [0, 0]
    """
    check_type("over", over, Mapping)
    axes = {name: axis_values(name, values) for name, values in over.items()}
    if not axes:
        raise ArgumentError(
            f"over = {over!r} is not allowed: map one name or more to values, such as "
            '{"slope": [0.01, 0.02]}.'
        )
    told, sense, measures = goal_of(scene, maximise, minimise)
    held = requirements_of(scene, subject_to)
    for name, objective in held.measures.items():
        add_measure(measures, name, objective)
    for name in axes:
        if name in vary or name in held.measures:
            other = "vary" if name in vary else "subject_to"
            raise ArgumentError(f"{other} has {name!r} already: over sets it itself.")
        if name in parameter_names(scene):
            with_parameters(scene, {name: axes[name]})
        else:
            add_measure(measures, *check_objective(name, scene, "over"))
    for name in {"scatter", "store"} & options.keys():
        raise ArgumentError(f"{name} is not an option of a library.")
    radius = "spectral_radius" in measures and not functional_names(scene, measures)[0]
    settings = GaitSettings(footsteps, accuracy, engine, options.get("section"), radius)
    variables = design_variables(scene, vary)
    base = DesignProblem(
        scene, variables, told, sense, held.each, measures, settings, Evaluations()
    )
    grid = OptimumGrid(base, axes)
    origin = (0,) * len(axes)
    problem = grid.problem_at(origin)
    size = int(np.prod(grid.shape))
    with stage("optimising gaits", total=size, unit="gaits", show=progress) as now:
        given = {held.given[each.name]: (each.low, each.high) for each in held.each}
        bounds = {n: (x, x) for n, x in grid.values_at(origin).items() if n not in grid.parameters}
        first = optimise_gait(
            problem.scene, vary=vary, maximise=maximise, minimise=minimise,
            subject_to=given | bounds, guess=guess, footsteps=footsteps, accuracy=accuracy,
            engine=engine, **options,
        )  # fmt: skip
        if first.sensitivities.message:
            raise ArgumentError(
                f"the first point of the library ended as {first.outcome}, and none can be found "
                f"from it: {first.sensitivities.message}"
            )
        u = variables.positions(np.array(list(first.variables.values())))
        point = grid_point(problem, problem.begin(u, first.gait.measures.state), first.outcome, "")
        grid.points[origin] = point
        now.update()
        missing = _LOST
        try:
            grid.follow(now)
        except KeyboardInterrupt:
            missing = _NOT_REACHED
    return _dataset(grid, missing)


def _dataset(grid: OptimumGrid, missing: int) -> "xarray.Dataset":
    """What is known of each point; `missing` is the outcome of those that have no optimum."""
    import xarray

    base, dims = grid.base, tuple(grid.axes)
    units, measures = parameter_quantities(base.scene), with_parts(base.wanted)
    known = next(iter(grid.points.values())).design.known
    measures |= {n: objective for n, objective in OBJECTIVES.items() if n in known.values}
    [objective, *others] = base.weights
    alone = not others and base.weights[objective] == base.sense
    quantity = measures[objective].quantity if alone else Quantity("objective", unit="SI")
    rows = {place: _row_of(grid, point) for place, point in grid.points.items()}

    def table(name: str) -> np.ndarray:
        values = np.full(grid.shape, np.nan)
        for place, row in rows.items():
            values[place] = row[name]
        return values

    entries = {
        "objective": Entry(dims, table("objective"), quantity, table("objective_error")),
        **{name: Entry(dims, table(name), Quantity(name)) for name in ("residual", "excess")},
        "curvature": Entry(dims, table("curvature"), Quantity("least curvature")),
    }
    for name in dims:
        slope = Quantity(f"derivative of the objective by {name}", unit="SI")
        bars = table(f"slope_{name}_error")
        entries[f"slope_{name}"] = Entry(dims, table(f"slope_{name}"), slope, bars)
    for name in base.variables.names:
        entries[f"design_{name}"] = Entry(dims, table(f"design_{name}"), units[name])
    for name, measure in measures.items():
        bars = table(f"measure_{name}_error")
        entry = Entry(dims, table(f"measure_{name}"), measure.quantity, bars)
        entries[f"measure_{name}"] = entry
    for name in recurring_names(base.scene.state_type):
        own = coordinate_quantity(base.scene.state_type, name)
        entries[f"state_{name}"] = Entry(dims, table(f"state_{name}"), own)
    codes, messages = np.full(grid.shape, missing), np.full(grid.shape, "", object)
    for place, point in grid.points.items():
        codes[place], messages[place] = int(point.outcome), point.message
    entries["outcome"] = Entry(dims, codes, Quantity("outcome"), flags=_OUTCOMES)
    axes = {
        name: (name, values, (units.get(name) or measures[name].quantity).attributes)
        for name, values in grid.axes.items()
    }
    return xarray.Dataset({**variables_of(entries), "message": (dims, messages)}, axes)


def _row_of(grid: OptimumGrid, point: GridPoint) -> dict[str, float]:
    """Numbers of a point by the names of the dataset's variables."""
    problem, (u, known) = point.problem, point.design
    conditions = optimality_of(problem, point.design)
    total, scale = problem.objective(known), scale_at(problem, point.design)
    row = {
        "objective": problem.sense * total.value,
        "objective_error": objective_error(total, conditions),
        "residual": conditions.residual,
        "excess": conditions.excess,
        "curvature": np.nan,
    }
    if point.second is not None:
        row["curvature"] = float(np.min(point.second.curvature.values, initial=np.inf))
    for name in grid.axes:
        slope = error = np.nan
        if point.equations is not None:
            at = point.equations.names.index(grid.fixed_name(name))
            slope = problem.sense * scale * float(point.equations.objective[at])
            error = scale * float(point.equations.objective_errors[at])
        row |= {f"slope_{name}": slope, f"slope_{name}_error": error}
    row |= {f"design_{name}": value for name, value in problem.variables.by_name(u).items()}
    for name, value in known.values.items():
        row |= {f"measure_{name}": value, f"measure_{name}_error": known.errors[name]}
    names = recurring_names(problem.scene.state_type)
    return row | {f"state_{n}": float(x) for n, x in zip(names, known.state, strict=True)}
