"""Optimisers: how a design problem is handed to SciPy and to optax, and what comes back.

All of them see variables in [0, 1] and functions of the order of one. Where a design has no gait,
the objective is raised well above the latest one's, so that line searches and trust regions turn
back towards it.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
import scipy  # its submodules are imported where they are first used

from jaxbiped._checks import ArgumentError
from jaxbiped.optimise._design_problem import DesignProblem, scale_of
from jaxbiped.optimise._multiplier_cluster import CONDITIONS, ClusterRow, cluster_of
from jaxbiped.optimise._objective_values import Evaluation

if TYPE_CHECKING:
    import optax

_ACTIVE = 1e-4
"""Largest part of its bound by which an active requirement is missed or kept too well."""
OPTIMISERS = ("trust-region", "slsqp", "trust-constr", "optax")
_RAISED = 10.0
"""By how much the scaled objective is raised where there is no gait."""
_RATE = 0.05
"""Learning rate of Adam, in logits of u."""
_EDGE = 1e-3
"""Distance from a bound, in u, at which optax begins at least: logits are infinite there."""


class RunEnding(NamedTuple):
    """How an optimiser ended: whether it says that it converged, and its own words."""

    converged: bool
    message: str


class Row(NamedTuple):
    """A requirement as a function that must be at least zero, or zero where `equality`.

    Attributes:
        name: of the measure; `bound` that it is held to, `sign` 1 from below and −1 from above.
    """

    name: str
    bound: float
    sign: float
    equality: bool

    def value(self, known: Evaluation) -> float:
        """How much there is to spare, in units of the bound."""
        return self.sign * (known.values[self.name] - self.bound) / scale_of(self.bound)

    def slopes(self, known: Evaluation) -> np.ndarray:
        return self.sign * known.slopes[self.name] / scale_of(self.bound)

    def slope_errors(self, known: Evaluation) -> np.ndarray:
        return known.slope_errors[self.name] / scale_of(self.bound)

    def by_bound(self, known: Evaluation) -> float:
        return -self.sign / scale_of(self.bound)

    def is_active(self, known: Evaluation) -> bool:
        return self.equality or self.value(known) <= _ACTIVE


AnyRow: TypeAlias = Row | ClusterRow


def rows_of(problem: DesignProblem) -> tuple[AnyRow, ...]:
    """The requirements one by one.

    An upper bound of the spectral radius is the conditions on the cluster of leading multipliers,
    and one on the next modulus: all of them are smooth where multipliers meet.
    """
    rows: list[AnyRow] = []
    for each in problem.requirements:
        if each.low is not None and each.low == each.high:
            rows.append(Row(each.name, each.low, 1.0, True))
            continue
        if each.low is not None:
            rows.append(Row(each.name, each.low, 1.0, False))
        if each.high is not None:
            if each.name == "spectral_radius" and problem.has_cluster:
                rows += cluster_rows(problem, each.high)
            else:
                rows.append(Row(each.name, each.high, -1.0, False))
    return tuple(rows)


def cluster_rows(problem: DesignProblem, bound: float) -> list[AnyRow]:
    """An upper bound of the spectral radius."""
    errors = tuple(cluster_of(problem.asked[0].known).errors.tolist())
    every: list[AnyRow] = [
        ClusterRow("spectral_radius", bound, -1.0, False, place, errors)
        for place in range(CONDITIONS)
    ]
    return [*every, Row("next_modulus", bound, -1.0, False)]


class Functions:
    """The scaled objective and the requirements of a problem, with their gradients."""

    def __init__(self, problem: DesignProblem) -> None:
        self.problem, self.rows = problem, rows_of(problem)
        assert problem.latest is not None
        self.scale = scale_of(problem.objective(problem.latest.known).value)

    def objective(self, u: np.ndarray) -> tuple[float, np.ndarray]:
        known, raised = self._evaluation(u)
        found = self.problem.objective(known)
        gradient = self.problem.gradient(u, found.slopes)
        return found.value / self.scale + raised, gradient / self.scale

    def spare(self, u: np.ndarray, rows: tuple[AnyRow, ...]) -> np.ndarray:
        known, _ = self._evaluation(u)
        return np.asarray([row.value(known) for row in rows])

    def spare_gradients(self, u: np.ndarray, rows: tuple[AnyRow, ...]) -> np.ndarray:
        known, _ = self._evaluation(u)
        return np.stack([self.problem.gradient(u, row.slopes(known)) for row in rows])

    def _evaluation(self, u: np.ndarray) -> tuple[Evaluation, float]:
        u = np.clip(np.asarray(u, dtype=float), 0.0, 1.0)
        known = self.problem.at(u)
        if known is not None:
            return known, 0.0
        assert self.problem.latest is not None
        return self.problem.latest.known, _RAISED


Callback = Callable[[np.ndarray], None]


def run_slsqp(functions: Functions, u: np.ndarray, iterations: int, report: Callback) -> RunEnding:
    """Sequential quadratic programming with a line search (Kraft 1988), by SciPy."""
    kinds = {
        "eq": tuple(row for row in functions.rows if row.equality),
        "ineq": tuple(row for row in functions.rows if not row.equality),
    }
    constraints: list[dict[str, Any]] = [
        {"type": kind, "fun": functions.spare, "jac": functions.spare_gradients, "args": (rows,)}
        for kind, rows in kinds.items()
        if rows
    ]
    found = scipy.optimize.minimize(
        functions.objective,
        u,
        jac=True,
        method="SLSQP",
        bounds=scipy.optimize.Bounds(0.0, 1.0),
        constraints=constraints,
        callback=report,
        options={"maxiter": iterations, "ftol": 1e-8},
    )
    return RunEnding(bool(found.success), str(found.message))


def run_trust_constr(
    functions: Functions, u: np.ndarray, iterations: int, report: Callback
) -> RunEnding:
    """Byrd and Omojokun's trust region with an interior point (Conn, Gould, Toint), by SciPy."""
    constraints = []
    if functions.rows:
        rows = functions.rows
        upper = np.asarray([0.0 if row.equality else np.inf for row in rows])
        constraints.append(
            scipy.optimize.NonlinearConstraint(
                lambda x: functions.spare(x, rows),
                0.0,
                upper,
                jac=lambda x: functions.spare_gradients(x, rows),
            )
        )
    try:
        found = scipy.optimize.minimize(
            functions.objective,
            np.clip(u, _EDGE, 1.0 - _EDGE),
            jac=True,
            method="trust-constr",
            bounds=scipy.optimize.Bounds(0.0, 1.0, keep_feasible=True),
            constraints=constraints,
            callback=lambda x, _: report(x),
            options={"maxiter": iterations, "gtol": 1e-6, "xtol": 1e-7},
        )
    except ArgumentError:
        raise
    except (ValueError, np.linalg.LinAlgError) as error:
        # Where derivatives grow without bound, as at corners of the spectral radius.
        return RunEnding(False, f"SciPy's trust-constr broke down: {error}.")
    return RunEnding(found.status in (1, 2), str(found.message))


def run_optax(
    functions: Functions,
    u: np.ndarray,
    iterations: int,
    report: Callback,
    transformation: "optax.GradientTransformation | None" = None,
) -> RunEnding:
    """Descent in logits of u, which keep the bounds; requirements it knows none.

    Raises:
        ArgumentError: a problem with requirements.
    """
    if functions.rows:
        raise ArgumentError(
            'optimiser = "optax" is not allowed with subject_to: choose "trust-region".'
        )
    import optax

    method = optax.adam(_RATE) if transformation is None else transformation
    inside = np.clip(u, _EDGE, 1.0 - _EDGE)
    logits = jnp.asarray(np.log(inside / (1.0 - inside)))
    state, best, at_best = method.init(logits), np.inf, logits
    for _ in range(iterations):
        now = 1.0 / (1.0 + np.exp(-np.asarray(logits)))
        value, gradient = functions.objective(now)
        report(now)
        if value < best:
            best, at_best = value, logits
        if value > best + 0.5 * _RAISED:
            logits = 0.5 * (logits + at_best)  # no gait there: half way back
            continue
        with jax.numpy_dtype_promotion("standard"):  # optax's own
            step, state = method.update(jnp.asarray(gradient * now * (1.0 - now)), state, logits)
        if float(jnp.max(jnp.abs(jnp.asarray(step)))) < 1e-6:
            return RunEnding(True, "Steps became small.")
        logits = jnp.asarray(optax.apply_updates(logits, step))
    return RunEnding(False, "Iteration limit reached")
