"""Constraint methods: their interface, the algebra of constraints, and the seven of the paper."""

import abc
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped._checks import ArgumentError, check_at_least, check_choice
from jaxbiped._parameter_declaration import AbstractPart, parameter
from jaxbiped._types import Parameter, Scalar, by_numpy
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.compiler import kept_alone
from jaxbiped.constraints._linkage import Linkage, Row, constraints_of, masses_of, row_times
from jaxbiped.linalg._small_matrices import SymmetricFactors, symmetric_factors

if TYPE_CHECKING:
    from typing import ClassVar as AbstractClassVar
else:
    from equinox import AbstractClassVar


class Constrained(NamedTuple):
    """A constrained system at one state: n coordinates q, k constraints Φ(q) = 0.

    Attributes:
        masses: diagonal of M [kg, kg·m²], n entries.
        applied: applied forces Q [N, N·m], n entries.
        rows: of J = ∂Φ/∂q, k of them.
        violation: Φ, k entries.
        rate: Φ̇ = J q̇, k entries.
        bias: γ = −J̇ q̇, k entries.
    """

    masses: list[Scalar]
    applied: list[Scalar]
    rows: list[Row]
    violation: list[Scalar]
    rate: list[Scalar]
    bias: list[Scalar]


class AbstractConstraintMethod(AbstractPart):
    """Finds the multipliers λ of M q̈ = Q − Jᵀ λ. A pytree of its constants.

    Attributes:
        needs_independent: whether repeated constraints make the method singular.
        projects: whether it also corrects the state after every step. A property of the class.
    """

    needs_independent: AbstractClassVar[bool]
    projects: ClassVar[bool] = False

    @abc.abstractmethod
    def multipliers(self, system: Constrained) -> list[Scalar]:
        """λ of each constraint [N]; −Jᵀ λ are the constraints' forces on the coordinates."""


class AbstractProjectingMethod(AbstractConstraintMethod):
    """A method that also projects positions and velocities onto the constraints after every step.

    Attributes:
        iterations: number of corrections of the positions after each step.
    """

    projects: ClassVar[bool] = True
    iterations: eqx.AbstractVar[int]

    @abc.abstractmethod
    def step_back(self, masses: list[Scalar], rows: list[Row], residual: list[Scalar]) -> Row:
        """The correction −W Jᵀ(J W Jᵀ)⁻¹ r of each coordinate that removes a residual r.

        The formula is the same for positions, with r = Φ, and for velocities, with r = Φ̇. W is the
        inverse of the metric.
        """


def gram(rows: list[Row], weights: list[Scalar], shift: Scalar | None = None) -> list[list[Scalar]]:
    """Lower half of J W Jᵀ + s I for a diagonal W. Default: s = 0."""
    matrix = []
    for i, row in enumerate(rows):
        entries = []
        for other in rows[: i + 1]:
            shared = [row[c] * other[c] * weights[c] for c in row if c in other]
            entries.append(sum(shared[1:], shared[0]) if shared else 0.0 * weights[0])
        if shift is not None:
            entries[i] = entries[i] + shift
        matrix.append(entries)
    return matrix


def free_residual(system: Constrained) -> list[Scalar]:
    """J M⁻¹ Q − γ: by how much the applied forces alone would break the constraints."""
    free = [force / mass for force, mass in zip(system.applied, system.masses, strict=True)]
    return [
        sum((entry * free[c] for c, entry in row.items()), -bias)
        for row, bias in zip(system.rows, system.bias, strict=True)
    ]


def stabilised_residual(system: Constrained, damping: Scalar, stiffness: Scalar) -> list[Scalar]:
    """J M⁻¹ Q − γ + damping Φ̇ + stiffness Φ."""
    parts = zip(free_residual(system), system.rate, system.violation, strict=True)
    return [free + damping * rate + stiffness * off for free, rate, off in parts]


def inverse_masses(masses: list[Scalar]) -> list[Scalar]:
    """The diagonal of M⁻¹."""
    return [by_numpy(lambda _, mass: 1.0 / mass, mass) for mass in masses]


class AbstractExactProjection(AbstractProjectingMethod):
    """The exact multipliers within a step, and after it a projection in a metric of its own.

    Raises:
        ArgumentError: fewer than one iteration.
    """

    iterations: int = eqx.field(static=True, default=2)
    needs_independent: ClassVar[bool] = True

    def __check_init__(self) -> None:
        check_at_least("iterations", self.iterations, "1", 1)

    def multipliers(self, system: Constrained) -> list[Scalar]:
        return exact_multipliers(system)


def exact_multipliers(system: Constrained, right: list[Scalar] | None = None) -> list[Scalar]:
    """λ with (J M⁻¹ Jᵀ) λ = right. Default of `right`: the free residual."""
    right = free_residual(system) if right is None else right
    return symmetric_factors(gram(system.rows, inverse_masses(system.masses))).solve(right)


def applied_impulse(rows: list[Row], weights: list[Scalar], multipliers: list[Scalar]) -> Row:
    """−W Jᵀ μ, for the coordinates that any constraint knows."""
    moves: Row = {}
    for row, value in zip(rows, multipliers, strict=True):
        for c, entry in row.items():
            move = -weights[c] * entry * value
            moves[c] = moves[c] + move if c in moves else move
    return moves


def projection(rows: list[Row], weights: list[Scalar], residual: list[Scalar]) -> Row:
    """−W Jᵀ(J W Jᵀ)⁻¹ r for a diagonal W."""
    return applied_impulse(rows, weights, symmetric_factors(gram(rows, weights)).solve(residual))


_LEAST = 1e-10
"""Smallest eigenvalue of J M⁻¹ Jᵀ, in units of the largest, of constraints that are independent."""


def check_independent(
    linkage: Linkage, method: AbstractConstraintMethod, q: Sequence[Scalar]
) -> None:
    """Refuses constraints that say the same twice, where the method cannot bear it.

    Raises:
        ArgumentError: for a method that needs independent constraints. What is being traced, or
            a batch, is not looked at.
    """
    lower = _gram_of(linkage, list(q)) if method.needs_independent else []
    if not lower:
        return
    entries = [entry for row in lower for entry in row]
    if any(isinstance(entry, jax.core.Tracer) or jnp.ndim(entry) for entry in entries):
        return
    matrix = np.zeros((len(lower), len(lower)))
    for i, row in enumerate(lower):
        matrix[i, : i + 1] = matrix[: i + 1, i] = [float(entry) for entry in row]
    values = np.linalg.eigvalsh(matrix)
    excess = int(np.sum(values < _LEAST * values[-1]))
    if excess:
        raise ArgumentError(
            f"method = {type(method).__name__} is not allowed here: {excess} of {len(lower)} "
            "constraints are redundant, because they follow from the others (such as a joint that "
            "is given twice); remove them, or use Penalty, Augmented or Index1Augmented."
        )


@kept_alone
def _gram_of(linkage: Linkage, q: list[Scalar]) -> list[list[Scalar]]:
    """J M⁻¹ Jᵀ of its constraints at rest: the entries of the lower triangle."""
    at = constraints_of(linkage, q, [jnp.zeros_like(value) for value in q])
    return gram(at.rows, inverse_masses(masses_of(linkage)))


_ITERATIONS = 12
"""Of the search for the nearest consistent state: a tenth of a metre is taken off to rounding."""


def correct_step(
    linkage: Linkage,
    method: AbstractProjectingMethod,
    q: Sequence[Scalar],
    v: Sequence[Scalar],
) -> tuple[list[Scalar], list[Scalar]]:
    """Coordinates and rates corrected as a method does after each step.

    Plain arithmetic, a fixed number of times: derivatives pass through as exactly as values.
    """
    masses, q, v = masses_of(linkage), list(q), list(v)
    for _ in range(method.iterations):
        at = constraints_of(linkage, q, v)
        q = _add(q, method.step_back(masses, at.rows, at.violation))
    at = constraints_of(linkage, q, v)
    return q, _add(v, method.step_back(masses, at.rows, at.rate))


@cached_jit
def nearest_consistent(
    linkage: Linkage, q: Sequence[Scalar], v: Sequence[Scalar]
) -> tuple[list[Scalar], list[Scalar]]:
    """The consistent coordinates and rates nearest in the mass metric.

    min Δqᵀ M Δq with Φ(q + Δq) = 0: each iteration solves it with the constraints linearised where
    the last one ended, so that what it converges to is nearest to the start and not only near.
    """
    weights, origin = inverse_masses(masses_of(linkage)), list(q)

    def least(rows: list[Row], residual: list[Scalar]) -> Row:
        # Shifted by nearly nothing, so that constraints that say the same twice share.
        matrix = gram(rows, weights)
        shift = 1e-14 * sum((matrix[i][i] for i in range(1, len(matrix))), matrix[0][0])
        return applied_impulse(
            rows, weights, symmetric_factors(gram(rows, weights, shift)).solve(residual)
        )

    def nearer(_: Scalar, q: list[Scalar]) -> list[Scalar]:
        at = constraints_of(linkage, q, v)
        gone = [a - b for a, b in zip(q, origin, strict=True)]
        left = [off - row_times(row, gone) for off, row in zip(at.violation, at.rows, strict=True)]
        return _add(origin, least(at.rows, left))

    if not constraints_of(linkage, q, v).rows:
        return origin, list(v)
    found = jax.lax.fori_loop(0, _ITERATIONS, nearer, origin)
    at = constraints_of(linkage, found, v)
    return found, _add(v, least(at.rows, at.rate))


def _add(values: Sequence[Scalar], moves: Row) -> list[Scalar]:
    return [value + moves[i] if i in moves else value for i, value in enumerate(values)]


class Standard(AbstractConstraintMethod):
    """[M Jᵀ; J 0] [q̈; λ] = [Q; γ]: the constraints hold at the level of accelerations only.

    Integration errors of positions and velocities remain, and an error of the velocities makes the
    positions drift without bound.

    Source: the seed paper, section 4, "standard".
    """

    needs_independent: ClassVar[bool] = True

    def multipliers(self, system: Constrained) -> list[Scalar]:
        return exact_multipliers(system)


class Baumgarte(AbstractConstraintMethod):
    """As `Standard` with γ − 2 a Φ̇ − b² Φ for γ: a violation decays as Φ̈ + 2 a Φ̇ + b² Φ = 0.

    Source: the seed paper, section 4, "baumgarte"; Baumgarte (1972).

    Attributes:
        a: damping of a violation [1/s].
        b: its frequency [1/s]; a = b damps critically.

    Raises:
        ArgumentError: a or b below 0.
    """

    a: Parameter = parameter("constraint damping", "$a$", "1/s", minimum=0.0, default=5.0)
    b: Parameter = parameter("constraint frequency", "$b$", "1/s", minimum=0.0, default=5.0)
    needs_independent: ClassVar[bool] = True

    def multipliers(self, system: Constrained) -> list[Scalar]:
        return exact_multipliers(system, stabilised_residual(system, 2.0 * self.a, self.b * self.b))


class AbstractPenalised(AbstractConstraintMethod):
    """A method with a penalty, which is regular whatever the constraints say.

    Attributes:
        A: penalty [kg].
        omega: ω, the frequency at which a violation decays [1/s].
        zeta: ζ, its damping [–].

    Raises:
        ArgumentError: A not above 0, or ω or ζ below 0.
    """

    A: Parameter = parameter("penalty", "$A$", "kg", positive=True, default=1e7)
    omega: Parameter = parameter(
        "constraint frequency", r"$\omega$", "1/s", minimum=0.0, default=10.0
    )
    zeta: Parameter = parameter("constraint damping ratio", r"$\zeta$", minimum=0.0, default=1.0)
    needs_independent: ClassVar[bool] = False

    def penalty_system(self, system: Constrained) -> tuple[SymmetricFactors, list[Scalar]]:
        """Factors of J M⁻¹ Jᵀ + 1/A, and the violation that the applied forces alone would leave.

        By Woodbury's identity (M + A JᵀJ)⁻¹ asks for no more than that k × k matrix, which is
        regular whatever the constraints say, and is well conditioned where M + A JᵀJ is not.
        """
        right = stabilised_residual(system, 2.0 * self.zeta * self.omega, self.omega * self.omega)
        return symmetric_factors(
            gram(system.rows, inverse_masses(system.masses), 1.0 / self.A)
        ), right


class AbstractAugmented(AbstractPenalised):
    """Accelerations by the augmented Lagrangian: the penalty's, and again for what that leaves.

    Attributes:
        iterations: how often, for accelerations and for each projection.

    Raises:
        ArgumentError: fewer than one iteration.
    """

    iterations: int = eqx.field(static=True, default=3)

    def __check_init__(self) -> None:
        check_at_least("iterations", self.iterations, "1", 1)

    def multipliers(self, system: Constrained) -> list[Scalar]:
        factors, right = self.penalty_system(system)
        matrix = gram(system.rows, inverse_masses(system.masses))
        return iterate_multipliers(factors, matrix, right, self.iterations)


def iterate_multipliers(
    factors: SymmetricFactors,
    matrix: list[list[Scalar]],
    right: list[Scalar],
    iterations: int,
) -> list[Scalar]:
    """λ after some iterations of λ ← λ + (S + 1/A)⁻¹(r − S λ) from λ = 0; S by its lower half.

    An error of λ that the constraints feel shrinks by 1/(1 + A s) each time, s the eigenvalue of S
    that it belongs to.
    """
    found = factors.solve(right)
    size = len(right)
    for _ in range(iterations - 1):
        left = []
        for i in range(size):
            row = [matrix[max(i, j)][min(i, j)] * found[j] for j in range(size)]
            left.append(right[i] - sum(row[1:], row[0]))
        found = [x + dx for x, dx in zip(found, factors.solve(left), strict=True)]
    return found


class Penalty(AbstractPenalised):
    """(M + A JᵀJ) q̈ = Q − A Jᵀ(J̇ q̇ + 2 ζ ω Φ̇ + ω² Φ): stiff springs in place of constraints.

    The joint is held by λ = A (Φ̈ + 2 ζ ω Φ̇ + ω² Φ), so a loaded joint is open by about λ/(A ω²).
    Accelerations and forces have a relative error of 1/(A s), where s ≈ 1/m is an eigenvalue of J
    M⁻¹ Jᵀ: 2e-11 at the walker's hip. The usual A of 1e7 kg belongs to solving with M + A JᵀJ,
    which a larger A makes ill-conditioned. Here 1/A is added to J M⁻¹ Jᵀ instead, which does no
    harm; as A grows, the method approaches `Baumgarte` with a = ζ ω and b = ω. Repeated constraints
    share the load, with an error of A s roundings.

    Source: the seed paper, section 4, "penalty"; Bayo, García de Jalón and Serna (1988).
    """

    A: Parameter = parameter("penalty", "$A$", "kg", positive=True, default=1e10)

    def multipliers(self, system: Constrained) -> list[Scalar]:
        factors, right = self.penalty_system(system)
        return factors.solve(right)


class Augmented(AbstractAugmented):
    """M q̈⁰ = Q, then (M + A JᵀJ) q̈ᵏ⁺¹ = M q̈ᵏ − A Jᵀ(J̇ q̇ + 2 ζ ω Φ̇ + ω² Φ), repeated.

    The iterations remove the violation that the penalty alone leaves: each multiplies it by about
    1/(A s), where s ≈ 1/m is an eigenvalue of J M⁻¹ Jᵀ. Their number is fixed, so derivatives are
    those of the same arithmetic. At the usual A, three iterations suffice.

    Source: the seed paper, section 4, "augmented"; Bayo, García de Jalón and Serna (1988).
    """


class Index1(AbstractExactProjection):
    """`Standard` within the step; after it q and q̇ are projected in the mass metric.

    Δq = −M⁻¹Jᵀ(J M⁻¹ Jᵀ)⁻¹ Φ, repeated, then likewise q̇ with Φ̇.

    Source: the seed paper, section 4, names an "index-1 projection method" and does not define it;
    this is the usual meaning.
    """

    def step_back(self, masses: list[Scalar], rows: list[Row], residual: list[Scalar]) -> Row:
        return projection(rows, inverse_masses(masses), residual)


class Index1Augmented(AbstractAugmented, AbstractProjectingMethod):
    """`Augmented` within the step; after it q and q̇ are projected in the mass metric.

    The projections are themselves augmented Lagrangian iterations, (M + A JᵀJ) Δq = −A Jᵀ Φ,
    repeated with the remaining violation. Repeated constraints are therefore allowed.

    Source: the seed paper, section 4, "index-1 augmented lagrangian"; Bayo and Ledesma (1996).
    """

    def step_back(self, masses: list[Scalar], rows: list[Row], residual: list[Scalar]) -> Row:
        weights = inverse_masses(masses)
        factors = symmetric_factors(gram(rows, weights, 1.0 / self.A))
        found = iterate_multipliers(factors, gram(rows, weights), residual, self.iterations)
        return applied_impulse(rows, weights, found)


class DirectCorrection(AbstractExactProjection):
    """`Standard` within the step; after it q ← q − Jᵀ(J Jᵀ)⁻¹ Φ, and q̇ likewise with Φ̇.

    The corrections are the smallest in the coordinates' own numbers, metres and radians alike, so
    they split differently between translation and rotation than in the mass metric.

    Source: the seed paper, section 4, "described", the direct correction method.
    """

    def step_back(self, masses: list[Scalar], rows: list[Row], residual: list[Scalar]) -> Row:
        return projection(rows, [jnp.ones_like(mass) for mass in masses], residual)


CONSTRAINT_METHODS: dict[str, type[AbstractConstraintMethod]] = {
    "standard": Standard,
    "baumgarte": Baumgarte,
    "penalty": Penalty,
    "augmented": Augmented,
    "index1": Index1,
    "index1aug": Index1Augmented,
    "described": DirectCorrection,
}
"""Names of the methods, as the seed paper's section 4 has them."""


def method_named(method: str | AbstractConstraintMethod) -> AbstractConstraintMethod:
    """The method of that name with its usual constants, or the method itself where one is given.

    Raises:
        ArgumentError: an unknown name.
    """
    if isinstance(method, AbstractConstraintMethod):
        return method
    check_choice("method", method, CONSTRAINT_METHODS)
    return CONSTRAINT_METHODS[method]()


def name_of(method: AbstractConstraintMethod) -> str:
    """The paper's name of a method."""
    return next(name for name, kind in CONSTRAINT_METHODS.items() if type(method) is kind)
