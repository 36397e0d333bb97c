"""Optimisation of a gait: the best design within bounds."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, cast

from jaxtyping import PyTree

from jaxbiped._checks import (
    ArgumentError,
    check_choice,
    check_count,
    check_finite,
    check_type,
)
from jaxbiped._files import user_path
from jaxbiped._identity import DECISIVE, identity, provenance
from jaxbiped._progress import stage
from jaxbiped._quantity import Quantity
from jaxbiped._types import JsonObject
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._return_map_spec import arrivals_of
from jaxbiped.gait._search_starts import state_of_guess
from jaxbiped.hybrid._hybrid_system import MINIMAL_SCENES
from jaxbiped.hybrid._sections import AbstractSection, chosen_section
from jaxbiped.optimise._design_gaits import CRITERIA, Ensemble, GaitSettings, ensemble_of
from jaxbiped.optimise._design_problem import DesignProblem, variables_of
from jaxbiped.optimise._formulation import FORMULATIONS, first_design
from jaxbiped.optimise._objective_values import Evaluations, jacobian_names
from jaxbiped.optimise._objectives import (
    Measure,
    Measures,
    Objective,
    check_objective,
    with_parts,
)
from jaxbiped.optimise._optimisers import OPTIMISERS, RunEnding
from jaxbiped.optimise._optimum import Optimum
from jaxbiped.optimise._requirements import (
    SubjectTo,
    add_measure,
    larger_is_worse,
    requirements_of,
)
from jaxbiped.optimise._runs import Runs, optimum_of, scattered_designs
from jaxbiped.optimise._simultaneous_search import check_simultaneous
from jaxbiped.scene._parameter_access import scene_identity
from jaxbiped.scene._scene import AbstractScene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.solve._accuracy import GAIT_ACCURACIES

if TYPE_CHECKING:
    import optax

_ROUNDS = 3
"""Searches for worse members than an ensemble has, each with another run, at most."""
Goal: TypeAlias = str | Measure | Mapping[str | Measure, float] | None
"""A measure by name or a cost, or weights of several."""


def optimise_gait(
    scene: AbstractScene,
    *,
    vary: Mapping[str, tuple[float, float]],
    maximise: Goal = None,
    minimise: Goal = None,
    subject_to: SubjectTo = None,
    guess: Gait | WalkerState | PyTree | None = None,
    section: AbstractSection | None = None,
    optimiser: "str | optax.GradientTransformation" = "trust-region",
    iterations: int = 200,
    restarts: int = 0,
    scatter: Mapping[str, float] | None = None,
    members: int = 8,
    criterion: str = "mean",
    seed: int = 0,
    footsteps: int | None = None,
    formulation: str = "auto",
    segments: int = 7,
    accuracy: str = "balanced",
    engine: str = "auto",
    progress: bool | None = None,
    store: str | Path | None = None,
) -> Optimum:
    """Finds the parameters within bounds whose periodic gait is best.

    The search for the gait of each design starts from a prediction with the derivatives of the
    previous gait. Gradients are exact, by the implicit function theorem. If a design has no gait,
    or its gait is not a walk, the step is shortened.

    Args:
        scene: the walker or hybrid system to begin from; a parameter outside its bounds is moved
            onto them.
        vary: bounds (low, high) by the name of each parameter (see `parameter_names`), SI units.
            Positive parameters are varied through their logarithm.
        maximise, minimise: give one of the two: the name of a measure of the gait (see
            `OBJECTIVES` and `NAMED_COSTS`), an `Integral` or `Extreme` of its motion, a
            `FunctionOf` measures, or weights of several.
        subject_to: bounds (low, high) by measure, with None for no bound and equal bounds for an
            equality; or requirements as text, such as "spectral_radius<0.4", constraints
            `Along` the cycle and `Linear` ones among parameters, one or several.
        guess: a gait or a start near the gait of the first design. Default: the gait that
            `find_gait` finds; a hybrid system needs one.
        section: section on which the cycles of a hybrid system begin. Default: as of `find_gait`.
        optimiser: "trust-region", "slsqp" or "trust-constr"; without requirements, also "optax"
            (Adam in the logits of the bounds) or any optax transformation.
        iterations: maximum number of iterations of each run.
        restarts: number of further runs, from the best of 8 times as many designs scattered over
            the bounds, whose gaits are found as one batch.
        scatter: relative half-widths by parameter; every design is then an ensemble whose members
            differ by factors within these, and measures are taken over all members.
        members: number of sampled members.
        criterion: "mean" for the sample's mean; "worst" for the worst case of each measure over the
            whole box: over the sample, up to 64 corners, and points that a search around the best
            design finds, after which the design is optimised again.
        seed: random seed of scattered designs and of members.
        footsteps: number of footsteps of a cycle. Default: one for a mirrored walker, those of a
            stride for unequal legs.
        formulation: "gait by gait" finds the gait of each design; "together" seeks the cycle, its
            period and the design as unknowns of one problem, for rigid feet of one mode. That needs
            no gait to begin with, only a rough pose (`guess`), and ends with a certified gait, too.
            "auto" chooses "together", where it is possible and the optimiser is the default one,
            for laws of time and where the first design has no gait, or one with a multiplier
            beyond 3 or a fold within a step.
        segments: number of segments of the cycle that are sought "together".
        accuracy: "balanced" or "tight".
        engine: as for `find_gait`.
        progress: whether to show on stderr what is being done, how far it is and what was found; by
            default (None) after two seconds, in a terminal, a notebook or a command.
        store: file that keeps every evaluation, from which the same call continues. It also serves
            calls with another optimiser or with other bounds on the same measures.

    Returns:
        The best design, its gait and its measures; `certify` tests it further.

    Raises:
        ArgumentError: an argument is not allowed (raised before anything is compiled); or the first
            design has no gait.

    Examples:
        >>> import jaxbiped as jb
        >>> best = jb.optimise_gait(
        ...     jb.ladder()["rigid"], vary={"d": (0.08, 0.12)}, maximise="speed"
        ... )
        >>> str(best.outcome), round(best.variables["d"], 4)
        ('converged', 0.0873)
    """
    scene = check_scene(scene, *MINIMAL_SCENES)
    section = chosen_section(scene, section)
    variables = variables_of(scene, vary)
    told, sense, measures = goal_of(scene, maximise, minimise)
    held = requirements_of(scene, subject_to)
    requirements = held.each
    for name, objective in held.measures.items():
        add_measure(measures, name, objective)
    if isinstance(optimiser, str):
        check_choice("optimiser", optimiser, OPTIMISERS)
    else:
        import optax

        check_type("optimiser", optimiser, optax.GradientTransformation)
    check_count("iterations", iterations)
    near = state_of_guess(scene, guess)
    arrivals_of(scene, footsteps)  # refused where they are no whole cycles
    check_count("restarts", restarts, 0)
    check_count("seed", seed, 0)
    check_count("segments", segments)
    check_choice("criterion", criterion, CRITERIA)
    check_count("members", members)
    if scatter is not None:
        check_type("scatter", scatter, Mapping)
    check_choice("formulation", formulation, FORMULATIONS)
    check_choice("accuracy", accuracy, GAIT_ACCURACIES)
    if requirements and optimiser not in OPTIMISERS[:3]:
        raise ArgumentError(
            'subject_to is not allowed with optax: choose optimiser = "trust-region".'
        )
    ensemble = None
    if scatter:
        worse = larger_is_worse(told, sense, requirements) if criterion == "worst" else {}
        ensemble = ensemble_of(scene, scatter, members, criterion, worse, seed)
    radius = "spectral_radius" in measures and not jacobian_names(scene, measures)
    settings = GaitSettings(footsteps, accuracy, engine, section, radius)
    evaluations = Evaluations()
    if store is not None:
        path = user_path(store, "store")
        own = _problem_settings(scene, vary, measures, settings, ensemble)
        if near is not None:  # which of several gaits is followed may depend on it
            own["guess"] = {name: float(leaf) for name, leaf in near._asdict().items()}
        evaluations = Evaluations(path, own)
    problem = DesignProblem(
        scene, variables, told, sense, requirements, measures, settings, evaluations, ensemble
    )
    if formulation == "together":
        check_simultaneous(problem)
    with stage("optimising the gait", unit="iterations", show=progress) as now:
        search = guess, near, segments, iterations, (int(restarts), int(seed)), now
        begin, ended, formulation = first_design(problem, formulation, optimiser, *search)
        runs = Runs(problem, iterations, optimiser, now, formulation)
        try:
            runs.run(begin, ended)
            if restarts and formulation != "together":
                for each in scattered_designs(problem, begin, int(restarts), int(seed)):
                    runs.run(each)
            for _ in range(_ROUNDS):
                harder = problem.worse_ensemble(runs.best, int(seed))
                if harder is None:
                    break
                try:
                    again = problem.begin_again(runs.best, harder)
                except ArgumentError:
                    lost = f"{runs.ended.message} Within the box there are members without a gait."
                    runs.ended = RunEnding(runs.ended.converged, lost)
                    break
                runs.run(again)
        except KeyboardInterrupt:
            runs.ended, runs.interrupted = RunEnding(False, "Interrupted."), True
    return optimum_of(problem, runs)


def goal_of(
    scene: Any, maximise: Goal, minimise: Goal
) -> tuple[dict[str, float], float, dict[str, Objective]]:
    """Weights by name, 1 to minimise their sum or −1 to maximise it, and the measures by name."""
    if (maximise is None) == (minimise is None):
        raise ArgumentError(
            'give either maximise or minimise: a measure of the gait, such as "speed".'
        )
    what, goal = ("minimise", minimise) if maximise is None else ("maximise", maximise)
    given = list(goal.items()) if isinstance(goal, Mapping) else [(goal, 1.0)]
    if not given:
        raise ArgumentError(f"{what} = {goal!r} is not allowed: give a name, or weights by name.")
    weights: dict[str, float] = {}
    measures: dict[str, Objective] = {}
    for each, weight in given:
        name, objective = check_objective(cast("str | Measure", each), scene, what)
        check_finite(f"{what}[{name!r}]", weight)
        add_measure(measures, name, objective)
        weights[name] = float(weight)
    return weights, -1.0 if what == "maximise" else 1.0, measures


def goal_quantity(weights: Mapping[str, float], measures: Measures) -> Quantity:
    """What the sum of measures with these weights is."""
    [name, *others] = weights
    alone = not others and weights[name] == 1.0
    return measures[name].quantity if alone else Quantity("objective", unit="SI")


def _problem_settings(
    scene: Any,
    vary: Mapping[str, tuple[float, float]],
    measures: Measures,
    settings: GaitSettings,
    ensemble: Ensemble | None,
) -> JsonObject:
    """All that evaluations depend on: whatever begins, bounds and optimises may use them."""
    own, section = scene_identity(scene), settings.section
    chosen = section is not None and not section.names_legs  # of walkers there is no choice
    kept = {name: value for name, value in own["scene"].items() if name not in vary}
    functions = {
        name: [each.costs, each.combined, each.measured]
        for name, each in with_parts(measures).items()
    }
    writer = provenance(scene, *functions.values())
    return {
        "scene": kept,
        "model": own["model"],
        "vary": {name: [float(x) for x in bounds] for name, bounds in vary.items()},
        "measures": sorted(measures),
        "functions": identity(functions),
        "settings": settings._asdict() | {"section": identity(section) if chosen else None},
        "ensemble": None if ensemble is None else ensemble._asdict(),
        "writer": {name: writer[name] for name in DECISIVE},
    }
