"""Switching to the branch of doubled period at a period doubling, and on through a cascade.

At the multiplier −1 a cycle of k footsteps throws off one of 2 k, at first along its eigenvector.
Seydel, Practical Bifurcation and Stability Analysis (2010), section 7.4.
"""

from collections.abc import Callable, Collection
from typing import NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError, check_count, check_positive, check_type
from jaxbiped.continuation._bifurcations import BifurcationPoint, BranchEvent
from jaxbiped.continuation._branch import Branch
from jaxbiped.continuation._continue_gait import ContinuationSetup, setup_of
from jaxbiped.continuation._trace import BranchStop, Trace
from jaxbiped.gait._pseudo_arclength import CurvePoint, correct
from jaxbiped.gait._search_provenance import BranchEnd

_AMPLITUDES = (3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5)
"""Distances along the eigenvector, in the sizes of the curve, at which the branch is sought."""
_BESIDE = (0.25, 0.5, 0.75)
"""Shares of that distance at which gaits are added, because the branch bends there like a root."""
_NEAR = 0.01
"""How far in s from the doubling it may be found, unless the doublings themselves lie close."""
_APART = 0.5
"""Share of the distance expected between the two halves of a cycle that tells it from its half."""
_FINER, _NEARER = 20.0, 40.0
"""Shares of the last interval of a cascade that the next branch's steps may have, and the distance
in s from the doubling at which it begins: intervals shrink by 4.7."""


class DoublingCascade(NamedTuple):
    """A sequence of successive period doublings.

    Attributes:
        branches: the first branch, then those with 2, 4, 8, … times its footsteps, each as far as
            it was followed.
        doublings: the first period doubling of each branch in the direction of the cascade.
        values: values of the parameter at the doublings, SI units, shape (n,).
        ratios: ratios of successive intervals between these values, shape (n − 2,); they tend to
            Feigenbaum's constant 4.669….
    """

    branches: tuple[Branch, ...]
    doublings: tuple[BifurcationPoint, ...]
    values: np.ndarray
    ratios: np.ndarray

    @property
    def accumulation(self) -> float:
        """Where the doublings would accumulate if the last ratio stayed: where chaos sets in."""
        last, ratio = self.values[-1] - self.values[-2], self.ratios[-1]
        return float(self.values[-1] + last / (ratio - 1.0))


def switch_branch(
    branch: Branch,
    doubling: BifurcationPoint | None = None,
    *,
    largest_step: float = 0.02,
    max_points: int = 200,
) -> Branch:
    """Follows the branch of gaits with twice the footsteps from a period doubling.

    Args:
        branch: from `continue_gait`.
        doubling: one of the branch's period doublings. Default: the first.
        largest_step: maximum arclength of a step (see `continue_gait`).
        max_points: maximum number of points.

    Returns:
        The branch of doubled period, from just beside the doubling onwards.

    Raises:
        ArgumentError: an argument is not allowed, or there is no doubled gait near the doubling.
    """
    check_type("branch", branch, Branch)
    check_positive("largest_step", largest_step, one=True)
    check_count("max_points", max_points)
    found = _first_doubling(branch) if doubling is None else doubling
    if found is None or found.kind is not BranchEvent.PERIOD_DOUBLING:
        raise ArgumentError("doubling is not allowed: it must be a period doubling of the branch.")
    return _doubled_branch(branch, found, largest_step, max_points)


def doubling_cascade(
    branch: Branch,
    doublings: int = 4,
    *,
    doubling: BifurcationPoint | None = None,
    largest_step: float = 0.02,
    max_points: int = 200,
) -> DoublingCascade:
    """Follows successive period doublings to branches with 2, 4, 8, … times the footsteps.

    Args:
        branch: from `continue_gait`, with a period doubling.
        doublings: number of doublings, including that of the branch.
        doubling: doubling at which the cascade begins. Default: the branch's first.
        largest_step: maximum arclength of a step (see `continue_gait`); steps on later, shorter
            branches are smaller in proportion.
        max_points: maximum number of points on each branch.

    Returns:
        The branches and their doublings; fewer than requested if a branch has no doubling.

    Raises:
        ArgumentError: an argument is not allowed, or there is no doubled gait near a doubling.
    """
    check_type("branch", branch, Branch)
    check_count("doublings", doublings)
    here = _first_doubling(branch) if doubling is None else doubling
    if here is None:
        raise ArgumentError("branch is not allowed: it has no period doubling.")

    def doubled(branch: Branch, doubling: BifurcationPoint, step: float, near: float) -> Branch:
        until = (BranchEvent.PERIOD_DOUBLING,)
        return _doubled_branch(branch, doubling, step, max_points, until=until, near=near)

    return _cascade_from(branch, here, doublings, largest_step, _NEAR, doubled)


def _cascade_from(
    branch: Branch,
    here: BifurcationPoint,
    doublings: int,
    step: float,
    near: float,
    doubled: Callable[[Branch, BifurcationPoint, float, float], Branch],
) -> DoublingCascade:
    """Goes from doubling to doubling; steps, and how near a doubled gait is, shrink on the way."""
    branches, found = [branch], [here]
    while len(found) < doublings:
        branches.append(doubled(branches[-1], found[-1], step, near))
        after = _first_doubling(branches[-1])
        if after is None:
            break
        found.append(after)
        places = [point.place for point in branches[-1].points]
        length = np.linalg.norm(places[-1] - places[min(len(_BESIDE), len(places) - 2)])
        step = min(step, float(length) / _FINER)
        near = min(near, abs(found[-1].point.place[-1] - found[-2].point.place[-1]) / _NEARER)
    values = np.array([each.value for each in found])
    intervals = np.diff(values)
    return DoublingCascade(tuple(branches), tuple(found), values, intervals[:-1] / intervals[1:])


def _first_doubling(branch: Branch) -> BifurcationPoint | None:
    kinds = (each for each in branch.bifurcations if each.kind is BranchEvent.PERIOD_DOUBLING)
    return next(kinds, None)


def _doubled_branch(
    branch: Branch,
    doubling: BifurcationPoint,
    largest_step: float,
    max_points: int,
    *,
    until: Collection[BranchEvent] = (),
    near: float = _NEAR,
) -> Branch:
    setup = setup_of(branch, footsteps=2 * branch.footsteps)
    cycles = _doubled_cycles(setup, doubling, near)
    if not cycles:
        raise ArgumentError(
            f"doubling at {branch.along} = {doubling.value:.6g} is not allowed: no gait of "
            f"{setup.footsteps} footsteps was found near it."
        )
    beyond = setup.trace(cycles[-1], largest_step=largest_step, max_points=max_points, until=until)
    stop = BranchStop(
        BranchEnd.BRANCHES_OFF,
        f"a branch of {branch.footsteps} footsteps doubles its period",
        doubling.value,
    )
    points = [*map(setup.point, cycles[:-1]), beyond.points[0]]
    return setup.branch(Trace(points, [], stop), beyond)


def _doubled_cycles(
    setup: ContinuationSetup, doubling: BifurcationPoint, near: float
) -> list[CurvePoint]:
    """Cycles of doubled period beside a doubling; the last one's tangent points away from it."""
    point, curve, undoubled = doubling.point, setup.curve, setup.arrivals // 2
    sizes = curve.sizes
    seen = setup.cycle(point.recurring, point.value, undoubled)
    m = len(point.recurring)
    values, vectors = np.linalg.eig(
        np.asarray(seen.jacobian[0])[:, :m] / sizes[:m, None] * sizes[:m]
    )
    vector = vectors[:, np.argmin(np.abs(values + 1.0))].real
    along = np.append(vector / np.linalg.norm(vector), 0.0)
    # Normal to the branch of half the period, which then does not cross the plane of the search.
    across = along - (along @ point.tangent) * point.tangent
    across /= np.linalg.norm(across)

    def at(amplitude: float) -> CurvePoint | None:
        guess = point.place + amplitude * along
        found = correct(curve, guess, across, patient=True).found
        if found is None or abs(found.place[-1] - point.place[-1]) > near:
            return None
        own = found.place[:-1] * sizes[:-1]
        half = setup.cycle(own, setup.axis.value(found.place[-1]), undoubled)
        apart = np.linalg.norm((np.asarray(half.recurring[0]) - own) / sizes[:-1])
        return found if apart > _APART * 2.0 * amplitude else None

    for amplitude in _AMPLITUDES:
        if begin := at(amplitude):
            before = (at(share * amplitude) for share in _BESIDE)
            return [*(cycle for cycle in before if cycle is not None), begin]
    return []
