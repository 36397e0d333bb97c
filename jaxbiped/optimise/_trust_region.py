"""Sequential quadratic programming in a trust region, with an exact penalty and cuts at corners.

Spectral radii have corners where multipliers meet, in which line searches come to rest: here a
trial that is no better leaves its linearisation behind, as in bundle methods, and the next
subproblem sees both sides of the corner. Fletcher, Practical Methods of Optimization (1987),
section 14.4 (Sl1QP); the subproblems are solved by SciPy's SLSQP.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy  # its submodules are imported where they are first used

from jaxbiped.optimise._design_problem import DesignProblem
from jaxbiped.optimise._objectives import CLUSTER, Evaluation
from jaxbiped.optimise._optimisers import Ended, Row, rows_of

_FIRST, _LARGEST, _SMALLEST = 0.1, 0.5, 1e-7
"""Half-widths of the trust region in u: at first, at most, and at which it is given up."""
_PENALTY, _MOST = 10.0, 1e5
"""Weight of missed requirements, at first and at most."""
_GAIN = 1e-9
"""Expected gain, relative to the objective's size, below which there is nothing more to gain."""
_STEEPEST = 1e6
"""Norm of the curvature beyond which it is forgotten."""
_CUTS = 6
"""Linearisations at rejected trials that are kept."""


class _Local(NamedTuple):
    """Linearisations at a design u, all scaled to the order of one.

    Attributes:
        u: the design.
        objective, gradient: of the sum, but for the spectral radius in it; (), (k,).
        radii, radii_gradients: moduli of which the largest is in the sum, weighed; (c,), (c, k).
        spare, spare_gradients: requirements, at least zero where kept; (r,), (r, k).
        equal: which of them are equalities, (r,).
    """

    u: np.ndarray
    objective: float
    gradient: np.ndarray
    radii: np.ndarray
    radii_gradients: np.ndarray
    spare: np.ndarray
    spare_gradients: np.ndarray
    equal: np.ndarray

    @property
    def sum(self) -> float:
        """The whole scaled objective."""
        return self.objective + float(np.max(self.radii, initial=-np.inf if len(self.radii) else 0))

    def merit(self, penalty: float) -> float:
        """The objective with the requirements that are missed."""
        return self.sum + penalty * float(np.sum(self.missed))

    @property
    def missed(self) -> np.ndarray:
        return np.where(self.equal, np.abs(self.spare), np.maximum(-self.spare, 0.0))


def run_trust_region(
    problem: DesignProblem, u: np.ndarray, iterations: int, told: Callable[[np.ndarray], None]
) -> Ended:
    """Minimises from a design whose gait is known."""
    assert problem.latest is not None
    rows, scale = rows_of(problem), max(abs(problem.objective(problem.latest.known)[0]), 1e-300)
    here = _local(problem, rows, scale, u, problem.latest.known)
    curvature, reach, penalty = np.eye(len(u)), _FIRST, _PENALTY
    cuts: list[_Local] = []
    done = 0
    while done < iterations:
        step, left = _step(here, cuts, curvature, reach, penalty)
        while left > 1e-6 and penalty < _MOST:
            other = _step(here, cuts, curvature, reach, 10.0 * penalty)
            if other[1] > 0.9 * left:
                break
            (step, left), penalty = other, 10.0 * penalty
        expected = here.merit(penalty) - _model(here, cuts, curvature, penalty, step)
        if expected <= _GAIN:
            if not cuts:
                return Ended(True, "No better design is expected nearby.")
            # What was seen farther away may not hold here.
            nearest = min(float(np.max(np.abs(each.u - here.u))) for each in cuts)
            cuts, reach = [], 0.25 * min(reach, nearest)
            if reach < _SMALLEST:
                break
            continue
        done += 1
        trial = np.clip(here.u + step, 0.0, 1.0)
        known = problem.at(trial)
        told(trial if known is not None else here.u)
        size = float(np.max(np.abs(step)))
        if known is None:
            reach = 0.25 * size
        else:
            there = _local(problem, rows, scale, trial, known)
            share = (here.merit(penalty) - there.merit(penalty)) / expected
            if share > 1e-3:
                curvature = _updated(curvature, here, there)
                here, cuts = there, []
                if share > 0.7 and size > 0.9 * reach:
                    reach = min(2.0 * reach, _LARGEST)
            else:
                cuts = [*cuts, there][-_CUTS:]
            if share < 0.3:
                reach = 0.5 * size
        if reach < _SMALLEST:
            break
    if done < iterations:
        return Ended(True, "The trust region became small.")
    return Ended(False, "Iteration limit reached.")


def _local(
    problem: DesignProblem, rows: tuple[Row, ...], scale: float, u: np.ndarray, known: Evaluation
) -> _Local:
    weights = dict(problem.weights)
    # Minimised, the radius is the largest of its cluster; maximised it has no such corner.
    radius = weights.pop("spectral_radius", 0.0) / scale if _in_cluster(problem) else 0.0
    names = CLUSTER if radius else ()
    value = sum(w * known.values[name] for name, w in weights.items()) / scale
    slopes = [w * known.slopes[name] / scale for name, w in weights.items()]
    every = len(next(iter(known.slopes.values())))
    total = np.sum(slopes, axis=0) if slopes else np.zeros(every)

    def gradients(of: list[np.ndarray]) -> np.ndarray:
        return problem.gradient(u, np.reshape(of, (len(of), every)))

    return _Local(
        u=np.array(u),
        objective=float(value),
        gradient=problem.gradient(u, total),
        radii=np.asarray([radius * known.values[name] for name in names]),
        radii_gradients=gradients([radius * known.slopes[name] for name in names]),
        spare=np.asarray([row.value(known) for row in rows]),
        spare_gradients=gradients([row.slopes(known) for row in rows]),
        equal=np.asarray([row.equality for row in rows], dtype=bool),
    )


def _in_cluster(problem: DesignProblem) -> bool:
    return problem.weights.get("spectral_radius", 0.0) > 0.0


def _model(
    here: _Local, cuts: list[_Local], curvature: np.ndarray, penalty: float, step: np.ndarray
) -> float:
    """What the linearisations expect of a step: the merit there."""
    spare, radii = _linear(here, cuts, step)
    value = here.objective + here.gradient @ step + 0.5 * step @ curvature @ step
    missed = np.where(here.equal, np.abs(spare), np.maximum(-spare, 0.0)).max(axis=0, initial=0.0)
    return float(
        value + np.max(radii, initial=-np.inf if radii.size else 0.0) + penalty * missed.sum()
    )


def _linear(here: _Local, cuts: list[_Local], step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Requirements (1 + cuts, r) and moduli by all linearisations; an equality by the first."""
    every = [here, *cuts]
    moves = [here.u + step - each.u for each in every]
    spare = [each.spare + each.spare_gradients @ d for each, d in zip(every, moves, strict=True)]
    spare = [np.where(here.equal, spare[0], each) for each in spare]
    radii = [each.radii + each.radii_gradients @ d for each, d in zip(every, moves, strict=True)]
    return np.stack(spare), np.stack(radii)


def _step(
    here: _Local, cuts: list[_Local], curvature: np.ndarray, reach: float, penalty: float
) -> tuple[np.ndarray, float]:
    """The best step within the trust region, and by how much it misses requirements.

    Variables: the step in units of the reach, slacks of the requirements, and the largest modulus.
    """
    k, r = len(here.u), len(here.spare)
    every, has_radius = [here, *cuts], len(here.radii) > 0
    size = k + r + has_radius
    matrix, right = [], []

    def add(gradient: np.ndarray, value: float, slack: int, sign: float = 1.0) -> None:
        row = np.zeros(size)
        row[:k], row[slack] = sign * gradient * reach, 1.0
        matrix.append(row)
        right.append(sign * value)

    for each in every:
        back = here.u - each.u
        for i in range(r):
            value = each.spare[i] + each.spare_gradients[i] @ back
            if each is here or not here.equal[i]:
                add(each.spare_gradients[i], value, k + i)
            if each is here and here.equal[i]:
                add(each.spare_gradients[i], value, k + i, -1.0)
        for value, gradient in zip(each.radii, each.radii_gradients, strict=True):
            add(gradient, value + gradient @ back, k + r, -1.0)
    slopes = np.concatenate([here.gradient * reach, np.full(r, penalty), np.ones(int(has_radius))])
    quadratic = np.zeros((size, size))
    quadratic[:k, :k] = curvature * reach * reach
    lower, upper = np.maximum(-here.u / reach, -1.0), np.minimum((1.0 - here.u) / reach, 1.0)
    bounds = scipy.optimize.Bounds(
        np.concatenate([lower, np.zeros(r), np.full(int(has_radius), -np.inf)]),
        np.concatenate([upper, np.full(r + int(has_radius), np.inf)]),
    )
    begin = np.concatenate(
        [np.zeros(k), here.missed, [np.max(here.radii)] if has_radius else np.zeros(0)]
    )
    constraints = []
    if matrix:
        rows, values = np.stack(matrix), np.asarray(right)
        constraints.append(
            {"type": "ineq", "fun": lambda x: rows @ x + values, "jac": lambda x: rows}
        )
    found = scipy.optimize.minimize(
        lambda x: (slopes @ x + 0.5 * x @ quadratic @ x, slopes + quadratic @ x),
        begin,
        jac=True,
        method="SLSQP",
        bounds=bounds,
        constraints=constraints,
        options={"maxiter": 100, "ftol": 1e-13},
    ).x
    step = np.clip(found[:k], lower, upper) * reach
    spare, _ = _linear(here, cuts, step)
    missed = np.where(here.equal, np.abs(spare), np.maximum(-spare, 0.0)).max(axis=0, initial=0.0)
    return step, float(missed.sum())


def _updated(curvature: np.ndarray, here: _Local, there: _Local) -> np.ndarray:
    """Powell's damped BFGS update of the Lagrangian's curvature."""
    step = there.u - here.u
    multipliers = _multipliers(there)

    def gradient(of: _Local) -> np.ndarray:
        normals = np.concatenate([of.spare_gradients, -of.radii_gradients])
        return of.gradient - multipliers @ normals

    change, image = gradient(there) - gradient(here), curvature @ step
    own = float(step @ image)
    if own <= 1e-16:
        return curvature
    if step @ change < 0.2 * own:
        mixed = 0.8 * own / (own - float(step @ change))
        change = mixed * change + (1.0 - mixed) * image
    updated = curvature - np.outer(image, image) / own
    updated += np.outer(change, change) / float(step @ change)
    # Across a corner derivatives jump, which tells of no curvature.
    return updated if np.linalg.norm(updated) < _STEEPEST else np.eye(len(step))


def _multipliers(of: _Local) -> np.ndarray:
    """Of requirements and moduli that are active, by least squares; zero for the others."""
    top = np.max(of.radii, initial=-np.inf)
    active = np.concatenate([(of.spare < 1e-3) | of.equal, of.radii > top - 1e-3])
    found = np.zeros(len(active))
    if active.any():
        normals = np.concatenate([of.spare_gradients, -of.radii_gradients])[active]
        least = np.where(np.append(of.equal, np.zeros(len(of.radii), dtype=bool)), -np.inf, 0.0)
        found[active] = scipy.optimize.lsq_linear(
            normals.T, of.gradient, bounds=(least[active], np.inf)
        ).x
    return found
