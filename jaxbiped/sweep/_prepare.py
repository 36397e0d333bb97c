"""A labelling made ready: its gaits found, from a start or from what the starts themselves do."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jaxbiped._checks import check_finite, check_positive
from jaxbiped.gait._seed_start import seed_start
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._rosenbrock import AbstractRosenbrock
from jaxbiped.sweep._coordinates import check_coordinates
from jaxbiped.sweep._find_family import find_family, with_gaits
from jaxbiped.sweep._label import Label
from jaxbiped.sweep._labelling import Labelled, Labelling, checked_effort
from jaxbiped.sweep._starts import AbstractStarts

_ALIKE = 0.05
"""Distance of two starts' last states, in the components' scales, that count as one guess."""
_MOST_GUESSES = 8
"""Of one period for one combination of parameters."""


def labelling(
    scene: Scene | RigidScene,
    *,
    parameters: Mapping[str, Sequence[float] | np.ndarray] | None = None,
    guess: Any = None,
    footsteps: int = 30,
    accuracy: str = "fast",
    rtol: float | None = None,
    solver: str | AbstractRosenbrock = "rodas4",
    max_solver_steps: int = 65536,
    engine: str = "auto",
) -> Labelling:
    """A labelling of starts that knows the scene's gait.

    Args:
        scene: the walker, compliant or rigid.
        parameters: values of scene parameters for every combination of which the gait is sought.
        guess: where the search begins; the seed's start unless given.
        footsteps: after which a start that is not certain is "unresolved".
        accuracy: "fast", "balanced" or "tight": `ACCURACIES`, a rigid walker's those of
            `rigid_walk`.
        rtol: relative tolerance, in place of the accuracy's; the absolute one (SI) is a hundredth.
        solver: of the compliant walker, "rodas3p" to "rodas5p".
        max_solver_steps: cap on a start's attempted steps.
        engine: "lanes", "xla" or "auto" (see `ENGINES`). Both give the same labels, but for starts
            nearer to a boundary than the tolerance.

    Raises:
        ArgumentError: an argument that is not allowed, before anything is compiled.
    """
    effort = checked_effort(
        scene,
        footsteps=footsteps,
        accuracy=accuracy,
        rtol=rtol,
        solver=solver,
        max_solver_steps=max_solver_steps,
        engine=engine,
    )
    values = {} if parameters is None else dict(parameters)
    check_coordinates(scene, values)
    for name, column in values.items():
        check_finite(name, column)
    start = seed_start(scene) if guess is None else guess
    family = find_family(scene, effort, parameters=values, guess=start)
    return Labelling(scene, family, effort)


def with_gaits_met(labelling: Labelling, starts: AbstractStarts, *, count: int = 512) -> Labelling:
    """The labelling that also knows the gaits that some of the starts converge to.

    As many starts, evenly spread, are followed; where their last footsteps repeat a cycle, a gait
    is sought from there.
    """
    check_positive("count", count)
    chosen = np.unique(np.linspace(0, starts.size - 1, min(count, starts.size)).astype(int))
    batches = [starts.batch(labelling, i, i + 1) for i in chosen]
    first = batches[0]
    states = type(first.states)(
        *[np.concatenate(leaves) for leaves in zip(*[b.states for b in batches], strict=True)]
    )
    parameters = {
        name: np.concatenate([batch.parameters[name] for batch in batches])
        for name in first.parameters
    }
    found = labelling(states, parameters=parameters)
    return with_gaits_of(labelling, found, parameters)


def with_gaits_of(
    labelling: Labelling, found: Labelled, parameters: Mapping[str, np.ndarray]
) -> Labelling:
    """The labelling that also knows the gaits that unresolved starts seem to converge to."""
    family = labelling.family
    open_ = np.flatnonzero((found.label == int(Label.UNRESOLVED)) & (found.period > 0))
    if not len(open_) or (parameters and not family.names):
        return labelling
    rows = family.row_of(parameters) if family.names else np.zeros(len(found.label), dtype=int)
    guesses: dict[int, list[tuple[int, Any]]] = {}
    for row, period in sorted({(int(rows[i]), int(found.period[i])) for i in open_}):
        among = open_[(rows[open_] == row) & (found.period[open_] == period)]
        chosen = _apart(found.final[among] / family.scales[row])
        kind = type(family.states[row])
        for i in among[chosen]:
            guess = kind(0.0, *map(float, found.final[i]))
            guesses.setdefault(row, []).append((period, guess))
    more = with_gaits(labelling.scene, family, labelling.effort, guesses)
    return Labelling(labelling.scene, more, labelling.effort)


def _apart(points: np.ndarray) -> list[int]:
    """Positions of the first few of these points that are not alike, shape (n, m)."""
    chosen: list[int] = []
    for i, point in enumerate(points):
        far = all(np.linalg.norm(point - points[j]) > _ALIKE for j in chosen)
        if far and len(chosen) < _MOST_GUESSES:
            chosen.append(i)
    return chosen
