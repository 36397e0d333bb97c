"""Preparation of a labelling: its settings checked, its gaits found, from a start or the starts.

And the labelling as a function of coordinates, as the analyses of basins ask for it.
"""

from collections.abc import Mapping, Sequence

import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_count, check_positive, check_type, warn
from jaxbiped.basins._label_oracle import LabelOf
from jaxbiped.basins._labels import Doubt, Label
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._search_starts import default_guess, state_of_guess
from jaxbiped.hybrid._hybrid_system import MINIMAL_SCENES
from jaxbiped.hybrid._scales import resolve_slip_speed
from jaxbiped.hybrid._sections import AbstractSection, chosen_section
from jaxbiped.scene._scene import AbstractScene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.solve._accuracy import ACCURACIES, check_accuracy_name
from jaxbiped.solve._engine_names import engine_for
from jaxbiped.solve._error_estimate import check_wanted
from jaxbiped.solve._solvers import solver_named
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock
from jaxbiped.sweep._attractor import turned_offsets
from jaxbiped.sweep._follow_starts import Effort
from jaxbiped.sweep._gait_family import Guesses, find_family, with_gaits
from jaxbiped.sweep._labelling import Labelling
from jaxbiped.sweep.starts._coordinates import check_coordinates, parameter_axes
from jaxbiped.sweep.starts._starts import AbstractStarts, Completion, batch_at, rest_of

_ALIKE = 0.05
"""Distance of two starts' last states, in the components' scales, that count as one guess."""
_MOST_GUESSES = 8
"""Of one cycle length for one combination of parameters."""
_GAP_SHARE = {True: 30.0, False: 3.0}
"""Gap between states that repeat each other in units of the tolerance, by whether the motion is
stiff: if not, solves err by less, and slow transients past an unstable gait move by as little as a
wider gap."""
_FIRST = 3e-3
"""First tolerance as a share of the accuracy wanted, at most that of "draft": of 100,000 labels of
the seed's slice 37 were wrong and not in doubt at 1e-5 by Rodas4, and 11 at 1e-6."""
FINEST_FIRST = {True: 1e-9, False: 1e-11}
"""Finest tolerance at which every start is labelled, by whether the motion is stiff."""


def labelling(
    scene: AbstractScene,
    *,
    parameters: Mapping[str, Sequence[float] | np.ndarray] | None = None,
    guess: Gait | WalkerState | PyTree | None = None,
    section: AbstractSection | None = None,
    footsteps: int = 30,
    accuracy: str | float = "draft",
    rtol: float | None = None,
    solver: str | AbstractRosenbrock = "rodas4p",
    max_solver_steps: int = 65536,
    engine: str = "auto",
) -> Labelling:
    """Finds the scene's gait and returns a labelling of starts.

    Args:
        scene: the walker, compliant or rigid, or a hybrid system (`jb.hybrid.HybridSystem`).
        parameters: values of scene parameters by name; the gait is found for every combination.
        guess: a gait, or a start near one. Default: the seed's start; a hybrid system has none.
        section: section at which a hybrid system's arrivals are compared with its cycles. Default:
            at its first guard that resets the state. A walker is compared at mid-stance, or with
            rigid feet behind heel strike.
        footsteps: maximum number of footsteps, or of a hybrid system's arrivals; a start that is
            still uncertain after them is "unresolved".
        accuracy: "draft", "balanced" or "tight" (see `ACCURACIES`). Or a number, the fraction of
            the labels that may be wrong: each start is then also solved at a looser tolerance and
            with a second method, and if the labels differ, at finer tolerances until they agree.
            Starts whose label remains in doubt are flagged (`Labelled.doubt`). `sweep` estimates
            how many of the others are wrong, and tightens the tolerance until the number is met.
        rtol: relative tolerance, instead of an accuracy; the absolute one is a hundredth of it.
        solver: solver for a compliant walker or a hybrid system, "rodas3p" to "rodas5p".
        max_solver_steps: maximum number of attempted steps for a start.
        engine: "lanes", "cuda", "xla" or "auto" (see `ENGINES`). All give the same labels, except
            for starts that are nearer to a boundary than the tolerance.

    Returns:
        A `Labelling`: call it with starts, or pass it to `sweep` or to functions of
        `jaxbiped.labels`, such as `label_at` or `nearest_failure`.
        A `RuntimeWarning` is issued if no stable gait was found.

    Raises:
        ArgumentError: an argument is not allowed; raised before anything is compiled.
    """
    effort = effort_of(
        scene,
        section=section,
        footsteps=footsteps,
        accuracy=accuracy,
        rtol=rtol,
        solver=solver,
        max_solver_steps=max_solver_steps,
        engine=engine,
    )
    values = parameter_axes(scene, parameters, "parameters") if parameters else {}
    near = state_of_guess(scene, guess)
    start = default_guess(scene) if near is None else near
    family = find_family(scene, effort, parameters=values, guess=start)
    missing = sum(not row for row in family.rows)
    if missing:
        of = f" for {missing} of {len(family.rows)} combinations of the parameters"
        warn(
            f"no stable gait was found{of if values else ''}: starts that walk there are labelled "
            "unresolved until one is met (see `jaxbiped.labels.with_gaits_met`).",
        )
    return Labelling(scene, family, effort)


def effort_of(
    scene: AbstractScene,
    *,
    section: AbstractSection | None = None,
    footsteps: int = 30,
    accuracy: str | float = "draft",
    rtol: float | None = None,
    solver: str | AbstractRosenbrock = "rodas4p",
    max_solver_steps: int = 65536,
    engine: str = "auto",
) -> Effort:
    """How to follow starts, from the arguments of `labelling`; raises `ArgumentError`."""
    scene = check_scene(scene, *MINIMAL_SCENES)
    check_count("footsteps", footsteps)
    check_count("max_solver_steps", max_solver_steps)
    if any(np.ndim(leaf) for leaf in jtu.tree_leaves(scene)):
        raise ArgumentError(
            "scene has parameters that are arrays: give one scene, and name what differs from "
            "start to start among the parameters."
        )
    wanted = _share_wanted(accuracy, rtol)
    named = ACCURACIES["draft" if wanted is not None else str(accuracy)]
    own = named.walk if scene.stiff else named.rigid_walk
    if wanted is not None:
        own = min(own, max(_FIRST * wanted, FINEST_FIRST[scene.stiff]))
    tolerance = resolve_slip_speed(own, scene) if rtol is None else rtol
    check_positive("rtol", tolerance, one=True)
    method = solver_named(solver)
    if not isinstance(method, AbstractRosenbrock):
        raise ArgumentError(
            f"solver = {type(method).__name__} is not allowed: labelling takes rodas3p to rodas5p."
        )
    return Effort(
        rtol=float(tolerance),
        footsteps=int(footsteps),
        max_attempts=int(max_solver_steps),
        gap_share=_GAP_SHARE[scene.stiff],
        solver=method,
        engine=engine_for(engine, obstacle=None, by_device=True, by_any=True),
        may_move=engine == "auto",
        wanted=wanted,
        section=chosen_section(scene, section),
    )


def _share_wanted(accuracy: str | float, rtol: float | None) -> float | None:
    """The share of wrong labels that is allowed; None where an accuracy is asked for by name."""
    if isinstance(accuracy, str):
        check_accuracy_name(accuracy)
        return None
    check_wanted(accuracy, rtol=rtol)
    if not accuracy < 1.0:
        raise ArgumentError(
            f"accuracy = {accuracy:g} is not allowed: it is the fraction of the labels that may be "
            "wrong, and must be below 1."
        )
    return float(accuracy)


def with_gaits_met(labelling: Labelling, starts: AbstractStarts, *, count: int = 512) -> Labelling:
    """The labelling, extended by further gaits to which some of the starts converge.

    Some starts, evenly spread, are followed. If their last footsteps repeat a cycle, a gait is
    searched from there.

    Args:
        labelling: the labelling to extend.
        starts: a `grid`, a `sample` or `GivenStarts`.
        count: maximum number of starts to follow.

    Returns:
        A new labelling of the same scene; the given one if no other gait was found.

    Raises:
        ArgumentError: count below 1.
    """
    check_count("count", count)
    chosen = np.unique(np.linspace(0, starts.size - 1, min(count, starts.size)).astype(int))
    return with_guesses(labelling, guesses_among(labelling, starts, chosen))


def guesses_among(labelling: Labelling, starts: AbstractStarts, numbers: np.ndarray) -> Guesses:
    """Where to seek the gaits that the starts with these numbers seem to converge to."""
    batch = starts.at(labelling, numbers)
    found = labelling(batch.states, parameters=batch.parameters)
    family = labelling.family
    open_ = np.flatnonzero((found.label == int(Label.UNRESOLVED)) & (found.cycle_footsteps > 0))
    if not len(open_) or (batch.parameters and not family.names):
        return {}
    rows = np.zeros(len(found.label), dtype=int)
    if family.names:
        rows = family.row_of(batch.parameters)
    guesses: dict[int, list[tuple[int, list[float]]]] = {}
    for row, length in sorted({(int(rows[i]), int(found.cycle_footsteps[i])) for i in open_}):
        among = open_[(rows[open_] == row) & (found.cycle_footsteps[open_] == length)]
        distinct = _distinct_points(family.states[row], found.final[among], family.scales[row])
        for i in among[distinct]:
            guesses.setdefault(row, []).append((length, found.final[i].tolist()))
    return guesses


def with_guesses(labelling: Labelling, guesses: Guesses) -> Labelling:
    if not guesses:
        return labelling
    more = with_gaits(labelling.scene, labelling.family, labelling.effort, guesses)
    return Labelling(labelling.scene, more, labelling.effort)


def _distinct_points(state: PyTree, points: np.ndarray, scales: np.ndarray) -> list[int]:
    """Positions of the first few of these points that are not alike, shape (n, m).

    They are recurring coordinates of states of the same kind as the given one.
    """
    chosen: list[int] = []
    for i, point in enumerate(points):
        off = turned_offsets(state, point - points[chosen]) / scales
        far = np.all(np.linalg.norm(off, axis=1) > _ALIKE)
        if far and len(chosen) < _MOST_GUESSES:
            chosen.append(i)
    return chosen


def label_at(
    labelling: Labelling,
    names: Sequence[str],
    *,
    failing: bool = False,
    place: bool | None = None,
    follow: Completion | None = None,
    base: PyTree = None,
) -> LabelOf:
    """The labelling as a function of points, for the analyses in `jaxbiped.basins`.

    Args:
        labelling: a `Labelling`.
        names: names of the d coordinates of points (see `coordinate_names`).
        failing: whether to distinguish only convergence to a cycle (0) from everything else (1).
        place, follow, base: as in `grid`.

    Returns:
        A function from points, shape (n, d), to codes of `Label`, shape (n,). If the labelling's
        accuracy is a number, a `RuntimeWarning` reports labels that remain in doubt.

    Raises:
        ArgumentError: a coordinate is unknown, or points have another number of coordinates.
    """
    check_type("labelling", labelling, Labelling)
    check_coordinates(labelling.scene, names)
    rest = rest_of(labelling.scene, names, place, follow, base)

    def label_of(points: np.ndarray) -> np.ndarray:
        points = np.asarray(points, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != len(names):
            raise ArgumentError(
                f"points has shape {points.shape}: it must be (n, {len(names)}), one column for "
                f"each of {', '.join(names)}."
            )
        columns = {name: points[:, i] for i, name in enumerate(names)}
        batch = batch_at(labelling, columns, rest)
        labelled = labelling(batch.states, parameters=batch.parameters)
        remain = np.sum(labelled.doubt == int(Doubt.REMAINS)) if labelled.doubt is not None else 0
        if remain:
            warn(f"{remain} of {len(points)} labels remain in doubt at the finest tolerance.")
        found = labelled.label.astype(int)
        return (found != int(Label.WALKING)).astype(int) if failing else found

    return label_of
