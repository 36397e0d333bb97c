"""Optimisers: a trust region for designs with corners, SciPy's, and optax's.

All of them see variables in [0, 1] and functions of the order of one. Where a design has no gait,
the objective is raised well above the latest one's, so that line searches and trust regions turn
back towards it.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy  # its submodules are imported where they are first used

from jaxbiped._checks import ArgumentError
from jaxbiped.optimise._design_functions import RAISED, Functions, rows_of
from jaxbiped.optimise._design_problem import Design, DesignProblem
from jaxbiped.optimise._local_model import Local, Model, local_of
from jaxbiped.optimise._optimality import OPTIMAL, is_untried, lagrangian_change, optimality_of

if TYPE_CHECKING:
    import optax

OPTIMISERS = ("trust-region", "slsqp", "trust-constr", "optax")
_RATE = 0.05
"""Learning rate of Adam, in logits of u."""
_EDGE = 1e-3
"""Distance from a bound, in u, at which optax begins at least: logits are infinite there."""
_FIRST, _LARGEST, _SMALLEST = 0.1, 0.5, 1e-7
"""Half-widths of the trust region in u: at first, at most, and at which it is given up."""
_PENALTY, _MOST = 10.0, 1e5
"""Weight of missed requirements, at first and at most."""
_GAIN, _BETTER = 1e-9, 1e-7
"""Expected gain, relative to the objective's size, below which there is nothing more to gain; and
gain of a scattered design that counts."""
_STEEPEST = 1e6
"""Norm of the curvature beyond which it is forgotten."""
_CUTS = 6
"""Linearisations at rejected trials that are kept, beside those of scattered designs."""
_CORRECTIONS = 2
"""Second-order corrections of a step that did not come where the cluster was expected."""
_DISTANCES = (1e-2, 1e-3, 1e-4)
"""At which others are scattered about a design that seems best, in u."""
Callback = Callable[[np.ndarray], None]


class RunEnding(NamedTuple):
    """How an optimiser ended: whether it says that it converged, and its own words."""

    converged: bool
    message: str


def run_trust_region(
    functions: Functions, u: np.ndarray, iterations: int, report: Callback
) -> RunEnding:
    """Sequential quadratic programming in a trust region, with an exact penalty and cuts.

    A trial that is no better leaves its linearisation behind, as in bundle methods, and the next
    subproblem sees both sides of a corner. Fletcher, Practical Methods of Optimization (1987),
    section 14.4 (Sl1QP). Where a design seems best and its derivatives do not balance, or do but a
    variable was never moved and may be at a maximum, others are scattered about it, and their
    linearisations are cuts, too (gradient sampling: Burke, Lewis, Overton, SIAM J. Optim. 15).
    """
    problem = functions.problem
    search = _Search(problem, u, iterations, report)
    while search.descend():
        balanced = optimality_of(problem, search.design).residual <= OPTIMAL
        if balanced and not is_untried(search.here.u, u):
            return RunEnding(True, search.message)
        if not any(map(search.leaves, _DISTANCES[: 1 if balanced else 3])) and search.left > 0:
            return RunEnding(True, f"{search.message} None of those scattered about it is better.")
    return RunEnding(False, "Iteration limit reached.")


class _Search:
    """A descent under way.

    Attributes:
        design, here: the best design, and its linearisations; `cuts` those of others near it.
        curvature, reach, penalty: of the model, of the trust region, of missed requirements.
        left: designs that may still be tried.
    """

    def __init__(
        self, problem: DesignProblem, u: np.ndarray, iterations: int, report: Callback
    ) -> None:
        assert problem.latest is not None
        known, self.rows = problem.latest.known, rows_of(problem)
        self.problem, self.report, self.left = problem, report, iterations
        self.scale = max(abs(problem.objective(known).value), 1e-300)
        self.design = Design(np.array(u), known)
        self.here = local_of(problem, self.rows, self.scale, self.design)
        self.cuts: list[Local] = []
        self.curvature, self.reach, self.penalty = np.eye(len(u)), _FIRST, _PENALTY
        self.random, self.message = np.random.default_rng(0), ""

    def descend(self) -> bool:
        """Steps until no better design is expected; False where no more may be tried."""
        while self.left > 0:
            step, expected = self.step()
            if expected <= _GAIN:
                self.message = "No better design is expected nearby."
                if not self.cuts:
                    return True
                # What was seen farther away may not hold here.
                nearest = min(float(np.max(np.abs(each.u - self.here.u))) for each in self.cuts)
                self.cuts, self.reach = [], 0.25 * min(self.reach, nearest)
            else:
                self.attempt(step, expected)
                self.message = "The trust region became small."
            if self.reach < _SMALLEST:
                return True
        return False

    def leaves(self, distance: float) -> bool:
        """Whether a better design is found at that distance: scattered, or by what these show."""
        k, before, self.cuts, self.reach = len(self.here.u), self.here, [], distance
        for _ in range(min(2 * k + 2, self.left)):
            aside = self.random.standard_normal(k)
            self.look(self.here.u + distance * aside / np.max(np.abs(aside)))
        for _ in range(_CUTS):
            if self.here is not before or self.left <= 0:
                break
            step, expected = self.step()
            if expected <= _BETTER:
                break
            self.look(self.here.u + step)
        return self.here is not before

    def step(self, here: Local | None = None) -> tuple[np.ndarray, float]:
        """The model's best step, and what it is expected to gain; `here` as corrected."""
        model = Model(here or self.here, self.cuts, self.curvature)
        step, left = model.step(self.reach, self.penalty)
        while left > 1e-6 and self.penalty < _MOST:
            other = model.step(self.reach, 10.0 * self.penalty)
            if other[1] > 0.9 * left:
                break
            (step, left), self.penalty = other, 10.0 * self.penalty
        return step, self.here.merit(self.penalty) - model.merit(step, self.penalty)

    def attempt(self, step: np.ndarray, expected: float) -> None:
        """Tries a step; the trust region and the model learn from it."""
        size, before = float(np.max(np.abs(step))), self.here
        there = self.look(before.u + step, 1e-3 * expected)
        for _ in range(_CORRECTIONS):
            if there is None or there is self.here or not before.has_radius:
                break
            # Multipliers that meet part by the root of what a linearisation is off.
            cuts, self.cuts = self.cuts, self.cuts[:-1]
            again, hoped = self.step(before.exact_at(there))
            if hoped > 1e-3 * expected:
                there = self.look(before.u + again, 1e-3 * expected)
            self.cuts = self.cuts if self.here is not before else cuts
        if there is None:
            self.reach = 0.25 * size
            return
        share = (before.merit(self.penalty) - there.merit(self.penalty)) / expected
        self.cuts = self.cuts[-_CUTS:]
        if share > 0.7 and size > 0.9 * self.reach:
            self.reach = min(2.0 * self.reach, _LARGEST)
        if share < 0.3:
            self.reach = 0.5 * size

    def look(self, u: np.ndarray, least: float = _BETTER) -> Local | None:
        """A design's linearisations, None where it has no gait; a better design is gone on from.

        One that is not better by more than `least` is a cut.
        """
        u, self.left = np.clip(u, 0.0, 1.0), self.left - 1
        known = self.problem.at(u)
        self.report(u if known is not None else self.here.u)
        if known is None:
            return None
        design = Design(u, known)
        there = local_of(self.problem, self.rows, self.scale, design)
        if self.here.merit(self.penalty) - there.merit(self.penalty) > least:
            change = lagrangian_change(self.problem, self.design, design, self.scale)
            self.curvature = _damped_update(self.curvature, u - self.here.u, change)
            self.design, self.here, self.cuts = design, there, []
        else:
            self.cuts = [*self.cuts, there]
        return there


def _damped_update(curvature: np.ndarray, step: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Powell's damped BFGS update of the Lagrangian's curvature by a change of its gradient."""
    image = curvature @ step
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
        if value > best + 0.5 * RAISED:
            logits = 0.5 * (logits + at_best)  # no gait there: half way back
            continue
        with jax.numpy_dtype_promotion("standard"):  # optax's own
            step, state = method.update(jnp.asarray(gradient * now * (1.0 - now)), state, logits)
        if float(jnp.max(jnp.abs(jnp.asarray(step)))) < 1e-6:
            return RunEnding(True, "Steps became small.")
        logits = jnp.asarray(optax.apply_updates(logits, step))
    return RunEnding(False, "Iteration limit reached")


_RUNS: tuple[Callable[[Functions, np.ndarray, int, Callback], RunEnding], ...] = (
    run_trust_region,
    run_slsqp,
    run_trust_constr,
    run_optax,
)
BY_NAME = dict(zip(OPTIMISERS, _RUNS, strict=True))
