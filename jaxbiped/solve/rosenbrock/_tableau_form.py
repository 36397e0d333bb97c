"""Form of a Rosenbrock method: the coefficients of its tableau."""

from fractions import Fraction
from typing import NamedTuple, TypeAlias

Row: TypeAlias = tuple[float, ...]


class RosenbrockTableau(NamedTuple):
    """Coefficients of a stiffly accurate Rosenbrock method, in the form without products by J.

    With W = I − h γ J and f_t = ∂f/∂t, the stages are
    W u_i = γ (h f(t + α_i h, y + Σ_j a_ij u_j) + Σ_j c_ij u_j + γ_i h² f_t).
    The last stage's argument plus u_s is the new value.

    Source of the form: Hairer and Wanner, Solving Ordinary Differential Equations II, eq. IV.7.25.

    Attributes:
        order: order of convergence.
        gamma: diagonal coefficient γ.
        a: rows a_ij of the stages from the second on.
        c: rows c_ij of the stages from the second on.
        alpha: times α_i of the stages.
        gammas: coefficients γ_i of the time derivative.
        dense: rows that map the stages to the coefficients of the dense output.
        error: weights of the stages in the error estimate. Default: the estimate is u_s.
    """

    order: int
    gamma: float
    a: tuple[Row, ...]
    c: tuple[Row, ...]
    alpha: Row
    gammas: Row
    dense: tuple[Row, ...]
    error: Row = ()


def end_weights(tableau: RosenbrockTableau) -> Row:
    """Weights of the stages in the change of the value over the step."""
    return (*tableau.a[-1], 1.0)


def error_weights(tableau: RosenbrockTableau) -> Row:
    """Weights of the stages in the error estimate."""
    return tableau.error or last_stage(tableau)


def last_stage(tableau: RosenbrockTableau) -> Row:
    """Weights that select the last stage."""
    return (*[0.0] * (len(tableau.alpha) - 1), 1.0)


def direct_weights(tableau: RosenbrockTableau, row: Row) -> Row:
    """Gives the weights of s_0, u_s1, u_s2 … in (Σ_j row_j u_j)/(γ h) of a component of rate s.

    They are 1ᵀz and (a + I)ᵀz with (I − γ c)ᵀ z = row. Fractions find them exactly: LAPACK and BLAS
    round otherwise on each kind of processor.
    """
    gamma, z = Fraction(tableau.gamma), [*map(Fraction, row)]
    weights = [Fraction(0)] * len(z)
    for i in range(len(z) - 1, 0, -1):
        for j, (a, c) in enumerate(zip(tableau.a[i - 1], tableau.c[i - 1], strict=True)):
            weights[j] += Fraction(a) * z[i]
            z[j] += gamma * Fraction(c) * z[i]
    return (float(sum(z)), *(float(w + last) for w, last in zip(weights, z, strict=True)))
