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
from jaxbiped.optimise._objective_values import Evaluations, jacobian_names
from jaxbiped.optimise._objectives import check_objective
from jaxbiped.optimise._optimise_gait import Goal, goal_of, goal_quantity, optimise_gait
from jaxbiped.optimise._optimum import Optimum, Outcome
from jaxbiped.optimise._optimum_grid import GridPoint, OptimumGrid
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
    radius = "spectral_radius" in measures and not jacobian_names(scene, measures)
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
        design = problem.begin(u, first.gait.measures.state)
        grid.points[origin], missing = GridPoint(problem, design, first), _LOST
        try:
            grid.follow(now)
        except KeyboardInterrupt:
            missing = _NOT_REACHED
    return _dataset(grid, goal_quantity(told, measures), first, missing)


def _dataset(grid: OptimumGrid, goal: Quantity, first: Optimum, missing: int) -> "xarray.Dataset":
    """What is known of each point; `missing` is the outcome of those that have no optimum."""
    import xarray

    dims, units = tuple(grid.axes), parameter_quantities(grid.base.scene)
    kind, plain = grid.base.scene.state_type, Quantity("")
    quantities = {"objective": goal} | {f"measure_{n}": q for n, q in first.quantities.items()}
    quantities |= {f"design_{name}": units[name] for name in first.variables}
    quantities |= {f"slope_{axis}": Quantity(f"d objective / d {axis}", unit="SI") for axis in dims}
    quantities |= {f"state_{n}": coordinate_quantity(kind, n) for n in recurring_names(kind)}
    quantities |= {name: Quantity(name) for name in ("residual", "excess", "curvature")}
    values, errors = ({name: np.full(grid.shape, np.nan) for name in quantities} for _ in range(2))
    codes, messages = np.full(grid.shape, missing), np.full(grid.shape, "", object)
    for place, point in grid.points.items():
        codes[place], messages[place] = int(point.optimum.outcome), point.optimum.message
        for name, (value, error) in _numbers_of(grid, point.optimum).items():
            values[name][place], errors[name][place] = value, error
    entries = {
        name: Entry(dims, values[name], quantity, None if np.all(np.isnan(bars)) else bars)
        for (name, quantity), bars in zip(quantities.items(), errors.values(), strict=True)
    }
    entries["outcome"] = Entry(dims, codes, Quantity("outcome"), flags=_OUTCOMES)
    axes = {
        name: (name, column, (units.get(name) or first.quantities.get(name, plain)).attributes)
        for name, column in grid.axes.items()
    }
    return xarray.Dataset({**variables_of(entries), "message": (dims, messages)}, axes)


def _numbers_of(grid: OptimumGrid, optimum: Optimum) -> dict[str, tuple[float, float]]:
    """Numbers of a point and their errors by the names of the dataset's variables."""
    known, slopes, state = optimum.known, optimum.sensitivities, optimum.gait.measures.state
    conditions, curvature = optimum.optimality, optimum.curvature
    least = curvature.values[0] if curvature is not None and len(curvature.values) else np.nan
    numbers = {
        "objective": (optimum.objective, optimum.error),
        "residual": (conditions.residual, conditions.error),
        "excess": (conditions.excess, np.nan),
        "curvature": (least, np.nan if curvature is None else curvature.error),
    }
    for axis in grid.axes:
        if not slopes.message:
            at = slopes.parameters.index(grid.fixed_name(axis))
            numbers[f"slope_{axis}"] = slopes.objective[at], slopes.objective_errors[at]
    numbers |= {f"measure_{n}": (known.values[n], known.errors[n]) for n in optimum.quantities}
    numbers |= {f"design_{name}": (value, np.nan) for name, value in optimum.variables.items()}
    names = recurring_names(type(state))
    return numbers | {f"state_{name}": (float(getattr(state, name)), np.nan) for name in names}
