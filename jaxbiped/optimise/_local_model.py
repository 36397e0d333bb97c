"""Local model of a design problem: linearisations at a design, and at others that were no better.

The sum, the requirements and the moduli outside the cluster are linear in a step; of the leading
multipliers the symmetric functions are, from which the spectral radius follows as a whole. Other
designs' linearisations bound the sum from below, as in bundle methods; they are lowered to what the
best design has, for functions that are not convex (Kiwiel 1985).
"""

from typing import NamedTuple

import numpy as np
import scipy  # its submodules are imported where they are first used

from jaxbiped.optimise._design_functions import (
    CONDITIONS,
    CONJUGATE,
    AnyRow,
    ClusterRow,
    cluster_of,
    conditions,
    radius_of,
)
from jaxbiped.optimise._design_problem import Design, DesignProblem
from jaxbiped.optimise._optimality import smooth_weights

_SCALES = (1.0, 0.1, 0.01, 0.001)
"""Of the trust region, at which a subproblem is tried where multipliers may meet."""
_LOWERED = 1e-3
"""Least distance, in units of the squared one between the designs, of a linearisation below."""


class Local(NamedTuple):
    """Linearisations at a design u, all scaled to the order of one.

    Attributes:
        u: the design.
        objective, gradient: of the sum, but for the spectral radius in it; (), (k,).
        spare, spare_gradients: requirements, at least zero where kept; (r,), (r, k).
        equal: which of them are equalities, (r,).
        weight, bound: of the spectral radius in the sum, and its upper bound; 0 and inf for none.
        cluster, cluster_gradients: symmetric functions of the leading multipliers; (3,), (3, k).
        margin: by how much more than zero the conditions on them must be, (5,).
        next, next_gradient: the largest modulus of the others; (), (k,).
    """

    u: np.ndarray
    objective: float
    gradient: np.ndarray
    spare: np.ndarray
    spare_gradients: np.ndarray
    equal: np.ndarray
    weight: float = 0.0
    bound: float = np.inf
    cluster: np.ndarray = np.zeros(3)
    cluster_gradients: np.ndarray = np.zeros((3, 0))
    margin: np.ndarray = np.zeros(CONDITIONS)
    next: float = 0.0
    next_gradient: np.ndarray = np.zeros(0)

    @property
    def has_radius(self) -> bool:
        """Whether the spectral radius plays a part."""
        return self.weight > 0.0 or bool(np.isfinite(self.bound))

    def merit(self, penalty: float) -> float:
        here = np.zeros_like(self.u)
        return Model(self, [], np.zeros((len(here), len(here)))).merit(here, penalty)

    def radius(self, move: np.ndarray) -> float:
        inside = radius_of(self.cluster + self.cluster_gradients @ move, self.margin)
        return max(inside, float(self.next + self.next_gradient @ move))

    def exact_at(self, there: "Local") -> "Local":
        """These linearisations, the cluster's and the requirements' raised to what is there."""
        move = there.u - self.u
        return self._replace(
            spare=there.spare - self.spare_gradients @ move,
            cluster=there.cluster - self.cluster_gradients @ move,
            next=there.next - float(self.next_gradient @ move),
        )


def local_of(
    problem: DesignProblem, rows: tuple[AnyRow, ...], scale: float, design: Design
) -> Local:
    u, known = design
    weights, weight = smooth_weights(problem)
    of_cluster = [row for row in rows if isinstance(row, ClusterRow)]
    others = [r for r in rows if not isinstance(r, ClusterRow) and r.name != "next_modulus"]
    total = problem.objective(known, weights)
    slopes = np.reshape([row.slopes(known) for row in others], (len(others), len(total.slopes)))
    here = Local(
        u=np.array(u),
        objective=total.value / scale,
        gradient=problem.gradient(u, total.slopes) / scale,
        spare=np.asarray([row.value(known) for row in others]),
        spare_gradients=problem.gradient(u, slopes),
        equal=np.asarray([row.equality for row in others], dtype=bool),
    )
    if not weight and not of_cluster:
        return here
    cluster = cluster_of(known)
    return here._replace(
        weight=weight / scale,
        bound=of_cluster[0].bound if of_cluster else np.inf,
        cluster=cluster.values,
        cluster_gradients=problem.gradient(u, cluster.slopes),
        margin=np.maximum([row.margin(known) for row in of_cluster] or 0.0, CONJUGATE),
        next=known.values["next_modulus"],
        next_gradient=problem.gradient(u, known.slopes["next_modulus"]),
    )


class Model(NamedTuple):
    """What a step from a design is expected to bring.

    Attributes:
        here: the design.
        cuts: others that were no better.
        curvature: of the Lagrangian, (k, k).
    """

    here: Local
    cuts: list[Local]
    curvature: np.ndarray

    def merit(self, step: np.ndarray, penalty: float) -> float:
        here, every = self.here, [self.here, *self.cuts]
        moves = [here.u + step - each.u for each in every]
        sums = [self._lower_sum(e) + e.gradient @ m for e, m in zip(every, moves, strict=True)]
        value = max(sums) + 0.5 * float(step @ self.curvature @ step)
        if here.weight:
            value += here.weight * max(e.radius(m) for e, m in zip(every, moves, strict=True))
        return float(value) + penalty * self.violation(step)

    def violation(self, step: np.ndarray) -> float:
        """By how much requirements are missed there."""
        here, worst, over = self.here, np.zeros(len(self.here.spare)), 0.0
        for each in (here, *self.cuts):
            move = here.u + step - each.u
            spare = each.spare + each.spare_gradients @ move
            both = np.abs(spare) if each is here else np.zeros_like(spare)
            worst = np.maximum(worst, np.where(here.equal, both, np.maximum(-spare, 0.0)))
            if np.isfinite(here.bound):
                over = max(over, each.radius(move) / here.bound - 1.0)
        return float(worst.sum()) + over

    def _lower_sum(self, each: Local) -> float:
        """The linearised sum at that design, lowered to at most this one's where that is needed."""
        back = self.here.u - each.u
        above = each.objective + each.gradient @ back - self.here.objective
        return each.objective - max(above + _LOWERED * float(back @ back), 0.0)

    def step(self, reach: float, penalty: float) -> tuple[np.ndarray, float]:
        """The best step within the trust region, and by how much it misses requirements.

        Where multipliers meet a solver comes to rest that sees too much at once, or has to pass by
        worse designs: it begins at several scales, and with smaller multipliers.
        """
        here, begins = self.here, [(reach, np.zeros_like(self.here.u))]
        if here.has_radius:
            inverse = np.linalg.pinv(here.cluster_gradients)
            for scale in _SCALES:
                shrunk = here.cluster * ((1.0 - 0.1 * scale) ** np.arange(1, 4) - 1.0)
                begins += [(scale * reach, begins[0][1]), (scale * reach, inverse @ shrunk)]
        found = [self._step(size, penalty, begin) for size, begin in begins]
        step = min(found, key=lambda each: self.merit(each, penalty))
        return step, self.violation(step)

    def _step(self, reach: float, penalty: float, begin: np.ndarray) -> np.ndarray:
        """The step that SciPy's SLSQP finds from one where it begins.

        Variables: the step in units of the reach, the sum, slacks of the requirements, and where it
        plays a part the spectral radius with its own slack.
        """
        here, every = self.here, [self.here, *self.cuts]
        k, r = len(here.u), len(here.spare)
        size = k + 1 + r + 2 * here.has_radius
        matrix, right = [], []

        def add(gradient: np.ndarray, value: float, place: int, sign: float = 1.0) -> None:
            row = np.zeros(size)
            row[:k], row[place] = sign * gradient * reach, 1.0
            matrix.append(row)
            right.append(sign * value)

        for each in every:
            back = here.u - each.u
            add(each.gradient, self._lower_sum(each) + each.gradient @ back, k, -1.0)
            for i in range(r):
                value = each.spare[i] + each.spare_gradients[i] @ back
                if each is here or not here.equal[i]:
                    add(each.spare_gradients[i], value, k + 1 + i)
                if each is here and here.equal[i]:
                    add(each.spare_gradients[i], value, k + 1 + i, -1.0)
            if here.has_radius:
                add(each.next_gradient, each.next + each.next_gradient @ back, size - 2, -1.0)
        if here.has_radius:
            add(np.zeros(k), 1.0, size - 1)
            matrix[-1][size - 2] = -1.0 / here.bound
        rows, values = np.stack(matrix), np.asarray(right)

        def spare(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            found, jacobians = [rows @ x + values], [rows]
            for each in every if here.has_radius else ():
                move = here.u + reach * x[:k] - each.u
                at = each.cluster + each.cluster_gradients @ move
                told = conditions(at, max(x[size - 2], 1e-9))
                by_x = np.zeros((CONDITIONS, size))
                by_x[:, :k] = told.by_symmetric @ each.cluster_gradients * reach
                by_x[:, size - 2] = told.by_radius
                found.append(told.values - each.margin)
                jacobians.append(by_x)
            return np.concatenate(found), np.concatenate(jacobians)

        lower, upper = np.maximum(-here.u / reach, -1.0), np.minimum((1.0 - here.u) / reach, 1.0)
        least, most = np.zeros(size), np.full(size, np.inf)
        least[:k], most[:k], least[k] = lower, upper, -np.inf
        slopes = np.append(np.zeros(k), [1.0, *[penalty] * (size - k - 1)])
        first = np.zeros(size)
        first[:k], first[k] = np.clip(begin / reach, lower, upper), here.objective
        first[k + 1 : k + 1 + r] = np.where(here.equal, np.abs(here.spare), -here.spare).clip(0.0)
        if here.has_radius:
            first[-2] = here.radius(reach * first[:k])
            first[-1], slopes[-2] = max(first[-2] / here.bound - 1.0, 0.0), here.weight
        quadratic = np.zeros((size, size))
        quadratic[:k, :k] = self.curvature * reach * reach
        found = scipy.optimize.minimize(
            lambda x: (slopes @ x + 0.5 * x @ quadratic @ x, slopes + quadratic @ x),
            first,
            jac=True,
            method="SLSQP",
            bounds=scipy.optimize.Bounds(least, most),
            constraints={
                "type": "ineq", "fun": lambda x: spare(x)[0], "jac": lambda x: spare(x)[1]
            },
            options={"maxiter": 100, "ftol": 1e-13},
        ).x  # fmt: skip
        return np.clip(np.nan_to_num(found[:k]), lower, upper) * reach
