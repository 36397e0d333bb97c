"""Deflation: further gaits of one scene, each found by making Newton's method avoid the known.

Farrell, Birkisson and Funke, SIAM J. Sci. Comput. 37 (2015) A2026: the residual is multiplied by
Π (1/|x − xᵢ|² + 1). As that factor is a scalar, the deflated step is Newton's own with another
length, by the Sherman–Morrison formula.
"""

from collections.abc import Iterator
from itertools import cycle, islice
from typing import Any, NamedTuple

import numpy as np

from jaxbiped._checks import check_choice, check_count
from jaxbiped._progress import stage
from jaxbiped.continuation._branch_point import BranchPoint, axis_of
from jaxbiped.continuation._continue_gait import (
    ContinuationSetup,
    check_followed,
    continuation_setup,
)
from jaxbiped.dynamics._state import recurring_leaves, state_for
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._search_starts import rolling_starts
from jaxbiped.scene._parameter_access import parameter_values
from jaxbiped.scene._scene import WALKER_SCENES, WalkerScene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.solve._accuracy import GAIT_ACCURACIES

_MOST_STEPS = 40
_LARGEST = 0.1
"""Step at most, in the sizes of the components."""
_HALVINGS = 6
"""Of a step from whose end the walk does not return."""
_TRIALS = 20
"""Starts drawn at most for each that is used: most end before a cycle is done."""
_SAME = 1e-5
"""Distance up to which two cycles are one."""
_SPREADS = (0.003, 0.01, 0.03, 0.1, 0.3)
"""Largest relative scatter of the starts' components."""


class IsolatedGait(NamedTuple):
    """One of several gaits of a scene that a search found.

    Attributes:
        state: on the section.
        point: its measures and multipliers.
    """

    state: WalkerState
    point: BranchPoint

    @property
    def stable(self) -> bool | None:
        """Whether it is stable; None where the errors leave it open."""
        return self.point.stable


def find_isolated(
    scene: WalkerScene,
    *,
    footsteps: int | None = None,
    known: tuple[WalkerState, ...] = (),
    starts: int = 32,
    seed: int = 0,
    accuracy: str = "balanced",
    engine: str = "auto",
) -> tuple[IsolatedGait, ...]:
    """Finds several gaits of a given number of footsteps without a guess, by deflation.

    From each of many scattered starts, Newton's method searches for gaits as long as it finds new
    ones. Each search avoids the known gaits, wherever they cross the section.

    Args:
        scene: the walker, compliant or rigid.
        footsteps: number of footsteps of a cycle. Default: the smallest possible number. Gaits that
            close after fewer footsteps are avoided, but not returned.
        known: states of gaits to avoid.
        starts: number of starts: the gait that `find_gait` finds, then others whose components
            differ from the gait's by up to 0.3, 1, 3, 10 and 30 %, in turn.
        seed: random seed for the starts.
        accuracy: "balanced" or "tight".
        engine: "xla", "lanes" or "auto" (see `ENGINES`).

    Returns:
        The gaits in the order in which they were found, none twice.

    Raises:
        ArgumentError: an argument is not allowed; raised before anything is compiled.
    """
    check_followed(scene)
    check_scene(scene, *WALKER_SCENES)
    check_count("starts", starts)
    check_choice("accuracy", accuracy, GAIT_ACCURACIES)
    checked = [state_for(scene, each, "guess") for each in known]
    slope = float(parameter_values(scene)["slope"])
    axis = axis_of(scene, "slope", (slope, slope + 0.01), None)
    setup = continuation_setup(scene, axis, footsteps=footsteps, accuracy=accuracy, engine=engine)
    search = _DeflatedNewton(setup, slope)
    for state in checked:
        search.learn(setup.recurring(state), keep=False)
    with stage(f"searching from {starts} starts"):
        drawn = islice(_scattered_starts(setup, int(starts), seed, engine), _TRIALS * int(starts))
        for point in islice(filter(search.returns, drawn), int(starts)):
            while (found := search.from_start(point)) is not None:
                search.learn(found)
    return tuple(search.gaits)


def _scattered_starts(
    setup: ContinuationSetup, count: int, seed: int, engine: str
) -> Iterator[np.ndarray]:
    """Components of starts, without end: about the gait that a search finds, itself the first.

    Rolling starts where it finds none.
    """
    scene: Any = setup.scene
    gait = find_gait(scene, parameters=(), accuracy=setup.accuracy, engine=engine)
    if gait.outcome is not Search.FOUND:
        rolling = rolling_starts(scene, _TRIALS * count, spread=max(_SPREADS), seed=seed)
        yield from np.stack(recurring_leaves(rolling), axis=1)
        return
    yield from _scattered_about(setup.recurring(gait.measures.state), seed)


def _scattered_about(middle: np.ndarray, seed: int) -> Iterator[np.ndarray]:
    """Components without end: those of a gait, and then near it and farther from it in turn."""
    random = np.random.default_rng(seed)
    yield middle
    for spread in cycle(_SPREADS):
        yield middle * (1.0 + spread * random.uniform(-1.0, 1.0, len(middle)))


class _DeflatedNewton:
    """Deflated Newton's method, the cycles that it knows, and the `gaits` that it found."""

    def __init__(self, setup: ContinuationSetup, value: float) -> None:
        self._setup, self._value = setup, value
        self._sizes = setup.curve.sizes[:-1]
        self._crossings: list[np.ndarray] = []
        self.gaits: list[IsolatedGait] = []

    def learn(self, point: np.ndarray, *, keep: bool = True) -> None:
        """Makes a cycle known, wherever it crosses the section."""
        crossings = [point]
        for _ in range(self._setup.arrivals - 1):
            after, code = self._walk(crossings[-1], 1)
            if code or np.linalg.norm((after - point) / self._sizes) < _SAME:
                break
            crossings.append(after)
        self._crossings += [each / self._sizes for each in crossings]
        place = self._setup.at_value(point, self._value).found
        if keep and len(crossings) == self._setup.arrivals and place is not None:
            told = self._setup.point(place)
            self.gaits.append(IsolatedGait(self._setup.state_of(told.recurring), told))

    def returns(self, start: np.ndarray) -> bool:
        """Whether the walk from a start comes through a cycle."""
        return self._walk(start, self._setup.arrivals + 1)[1] == 0

    def from_start(self, start: np.ndarray) -> np.ndarray | None:
        """A cycle that is not known yet, None where the search ends without."""
        point, code = self._walk(start, 1)  # onto the section
        for _ in range(_MOST_STEPS):
            here = self._setup.curve.change(point, self._setup.axis.place(self._value))
            if code or here.code:
                return None
            try:
                step = np.linalg.solve(here.by_point, -here.value) / self._sizes
            except np.linalg.LinAlgError:
                return None
            if np.linalg.norm(step) <= self._setup.curve.converged:
                apart = [np.linalg.norm(point / self._sizes - each) for each in self._crossings]
                return point if min(apart, default=np.inf) > _SAME else None
            point, code = self._advance(point, self._deflated_step(point / self._sizes, step))
        return None

    def _deflated_step(self, scaled: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Newton's step with the length, or in the sense, that avoids the known crossings."""
        away = [scaled - each for each in self._crossings]
        squares = [float(each @ each) for each in away]
        slopes = [-2.0 * each / (r2 * (r2 + 1.0)) for each, r2 in zip(away, squares, strict=True)]
        step = step / (1.0 - float(sum(slopes, np.zeros_like(step)) @ step))
        return step * min(1.0, _LARGEST / float(np.linalg.norm(step)))

    def _advance(self, point: np.ndarray, step: np.ndarray) -> tuple[np.ndarray, int]:
        """A step on, or as much of it as leads to where the walk returns."""
        for k in range(_HALVINGS):
            ahead = point + 0.5**k * step * self._sizes
            code = self._walk(ahead, self._setup.arrivals)[1]
            if code == 0:
                break
        return ahead, code

    def _walk(self, point: np.ndarray, arrivals: int) -> tuple[np.ndarray, int]:
        found = self._setup.cycle(point, self._value, arrivals)
        return np.asarray(found.recurring[0]), found.failure
