"""Preparation of a labelling: its gaits found, from a start or from the starts themselves."""

import warnings
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import PyTree

from jaxbiped.basins._arguments import check_whole
from jaxbiped.basins._labels import Label
from jaxbiped.dynamics._state_quantities import state_of_recurring
from jaxbiped.gait._search_starts import default_guess
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock
from jaxbiped.sweep._gait_family import find_family, with_gaits
from jaxbiped.sweep._labelling import Labelling
from jaxbiped.sweep._labelling_settings import effort_of
from jaxbiped.sweep.starts._coordinates import parameter_axes
from jaxbiped.sweep.starts._starts import AbstractStarts

_ALIKE = 0.05
"""Distance of two starts' last states, in the components' scales, that count as one guess."""
_MOST_GUESSES = 8
"""Of one cycle length for one combination of parameters."""


def labelling(
    scene: Scene | RigidScene,
    *,
    parameters: Mapping[str, Sequence[float] | np.ndarray] | None = None,
    guess: PyTree = None,
    footsteps: int = 30,
    accuracy: str | float = "draft",
    rtol: float | None = None,
    solver: str | AbstractRosenbrock = "rodas4p",
    max_solver_steps: int = 65536,
    engine: str = "auto",
) -> Labelling:
    """A labelling of starts that knows the scene's gait.

    Args:
        scene: the walker, compliant or rigid.
        parameters: values of scene parameters for every combination of which the gait is sought.
        guess: where the search begins; the seed's start unless given.
        footsteps: after which a start that is not certain is "unresolved".
        accuracy: "draft", "balanced" or "tight" (see `ACCURACIES`). Or a number, the share of the
            labels that may be wrong: each start is then solved at a looser tolerance and by a
            second method as well, and where the labels differ again at finer tolerances until they
            agree. Starts whose label remains in doubt are flagged (`Labelled.doubt`); `sweep`
            estimates how many of the others are wrong, and tightens until it is the number.
        rtol: relative tolerance, in place of the accuracy's; the absolute one is a hundredth.
        solver: of the compliant walker, "rodas3p" to "rodas5p".
        max_solver_steps: cap on a start's attempted steps.
        engine: "lanes", "cuda", "xla" or "auto" (see `ENGINES`). All give the same labels, but for
            starts nearer to a boundary than the tolerance.

    Returns:
        A `Labelling`: call it with starts, or give it to `sweep`, `label_at` or `nearest_failure`.
        A `RuntimeWarning` says where no stable gait was found.

    Raises:
        ArgumentError: an argument that is not allowed, before anything is compiled.
    """
    effort = effort_of(
        scene,
        footsteps=footsteps,
        accuracy=accuracy,
        rtol=rtol,
        solver=solver,
        max_solver_steps=max_solver_steps,
        engine=engine,
    )
    values = parameter_axes(scene, parameters or {}, "parameters")
    start = default_guess(scene) if guess is None else guess
    family = find_family(scene, effort, parameters=values, guess=start)
    missing = sum(not row for row in family.rows)
    if missing:
        of = (
            f" for {missing} of {len(family.rows)} combinations of the parameters" if values else ""
        )
        warnings.warn(
            f"no stable gait was found{of}: what walks there is labelled unresolved until one is "
            "met (see `with_gaits_met`).",
            RuntimeWarning,
            stacklevel=2,
        )
    return Labelling(scene, family, effort)


def with_gaits_met(labelling: Labelling, starts: AbstractStarts, *, count: int = 512) -> Labelling:
    """The labelling that also knows the gaits that some of the starts converge to.

    As many starts, evenly spread, are followed; where their last footsteps repeat a cycle, a gait
    is sought from there.

    Args:
        labelling: to which the gaits are added.
        starts: a `grid`, a `sample` or `GivenStarts`.
        count: how many of the starts are followed, at most.

    Returns:
        Another labelling, of the same scene; the one given where no other gait was found.

    Raises:
        ArgumentError: count below 1.
    """
    check_whole("count", count, 1)
    chosen = np.unique(np.linspace(0, starts.size - 1, min(count, starts.size)).astype(int))
    return with_guesses(labelling, guesses_among(labelling, starts, chosen))


Guesses = dict[int, list[tuple[int, list[float]]]]
"""By row of a family: footsteps in a cycle and states, without hip_x, from which to search."""


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
    guesses: Guesses = {}
    for row, length in sorted({(int(rows[i]), int(found.cycle_footsteps[i])) for i in open_}):
        among = open_[(rows[open_] == row) & (found.cycle_footsteps[open_] == length)]
        for i in among[_distinct_points(found.final[among] / family.scales[row])]:
            guesses.setdefault(row, []).append((length, found.final[i].tolist()))
    return guesses


def with_guesses(labelling: Labelling, guesses: Guesses) -> Labelling:
    """The labelling that also knows the gaits to which these guesses lead."""
    if not guesses:
        return labelling
    family = labelling.family
    states = {
        row: [
            (length, state_of_recurring(type(family.states[row]), point)) for length, point in each
        ]
        for row, each in guesses.items()
    }
    more = with_gaits(labelling.scene, family, labelling.effort, states)
    return Labelling(labelling.scene, more, labelling.effort)


def _distinct_points(points: np.ndarray) -> list[int]:
    """Positions of the first few of these points that are not alike, shape (n, m)."""
    chosen: list[int] = []
    for i, point in enumerate(points):
        far = all(np.linalg.norm(point - points[j]) > _ALIKE for j in chosen)
        if far and len(chosen) < _MOST_GUESSES:
            chosen.append(i)
    return chosen
