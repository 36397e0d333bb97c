"""Radau IIA collocation: nodes, matrix and weights of its methods."""

import functools
from typing import Any, NamedTuple

import numpy as np


class Radau(NamedTuple):
    """Radau IIA's method of s stages: numbers of mpmath, or floats.

    Attributes:
        nodes: (s,). matrix: (s, s).
        first: weights that extrapolate rates at the stages to the step's beginning, (s,).
        last: weights that give the coefficient of the last Legendre polynomial, (s,).
    """

    nodes: np.ndarray
    matrix: np.ndarray
    first: np.ndarray
    last: np.ndarray


@functools.cache
def precise_radau(stages: int, context: Any) -> Radau:
    """The method in a context of mpmath's: nodes are the roots of P_s − P_(s−1) on (0, 1)."""

    def legendre(degree: int) -> list[Any]:
        sign = (-1) ** degree
        return [
            sign * (-1) ** k * context.binomial(degree, k) * context.binomial(degree + k, k)
            for k in range(degree + 1)
        ]

    lower = [*legendre(stages - 1), 0]
    ascending = [a - b for a, b in zip(legendre(stages), lower, strict=True)]
    guesses = sorted(root.real for root in np.roots([float(a) for a in ascending[::-1]]))
    nodes = [_root(ascending, context.mpf(float(guess))) for guess in guesses]
    powers, integrals = context.matrix(stages, stages), context.matrix(stages, stages)
    for i, node in enumerate(nodes):
        for k in range(stages):
            powers[i, k] = node**k
            integrals[i, k] = node ** (k + 1) / (k + 1)
    inverse = powers**-1
    return Radau(
        np.array(nodes, object),
        np.array((integrals * inverse).tolist(), object),
        np.array(inverse[0, :].tolist()[0], object),
        # The coefficient of x^(s-1), as that of the Legendre polynomial of this degree.
        np.array(inverse[stages - 1, :].tolist()[0], object)
        / context.binomial(2 * stages - 2, stages - 1),
    )


def _root(ascending: list[Any], x: Any) -> Any:
    """A real root of a polynomial, by Newton's method."""
    for _ in range(10):
        value = slope = 0 * x
        for coefficient in reversed(ascending):
            slope = slope * x + value
            value = value * x + coefficient
        x -= value / slope
    return x


@functools.cache
def radau(stages: int) -> Radau:
    """The method in double precision."""
    from mpmath import mp

    context = mp.clone()
    context.dps = 50
    return Radau(*(each.astype(float) for each in precise_radau(stages, context)))
