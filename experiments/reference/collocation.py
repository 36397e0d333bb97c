"""Radau IIA collocation, and its steps on one smooth piece of the compliant walker's motion."""

import functools
from typing import Any, NamedTuple

import numpy as np

from .compliant import compiled
from .smooth_pieces import field, slopes


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


@compiled
def collocate(y, h, p, pressing, band, nodes, matrix):
    """States at the stages of one step (s, 8), and whether Newton's method converged."""
    s, none = len(nodes), np.zeros(0, np.int64)
    first = field(y, p, pressing, band)
    at = np.empty((s, 8))
    for i in range(s):
        at[i] = y + nodes[i] * h * first
    change = np.inf
    for _ in range(30):
        system, left = np.eye(8 * s), np.empty(8 * s)
        rates = np.empty((s, 8))
        for j in range(s):
            rates[j] = field(at[j], p, pressing, band)
            own = slopes(at[j], p, pressing, band, none)
            for i in range(s):
                system[8 * i : 8 * i + 8, 8 * j : 8 * j + 8] -= h * matrix[i, j] * own
        for i in range(s):
            total = y - at[i]
            for j in range(s):
                total = total + h * matrix[i, j] * rates[j]
            left[8 * i : 8 * i + 8] = total
        if not (np.isfinite(left).all() and np.isfinite(system).all()):
            return at, False
        step = np.linalg.solve(system, left)
        at += step.reshape((s, 8))
        before, change = change, np.max(np.abs(step))
        if not np.isfinite(change):
            return at, False
        if change < 1e-15 or (change < 1e-11 and change > 0.5 * before):
            return at, True
    return at, False


@compiled
def carry(w, at, h, p, pressing, band, matrix, varied):
    """Tangents at the stages (s, 8, 8 + k): what the collocation's solution changes by."""
    s, count = len(at), 8 + len(varied)
    system, left = np.eye(8 * s), np.empty((8 * s, count))
    every = np.empty((s, 8, count))
    for j in range(s):
        every[j] = slopes(at[j], p, pressing, band, varied)
    for i in range(s):
        total = w.copy()
        for j in range(s):
            total[:, 8:] += h * matrix[i, j] * every[j][:, 8:]
            system[8 * i : 8 * i + 8, 8 * j : 8 * j + 8] -= h * matrix[i, j] * every[j][:, :8]
        left[8 * i : 8 * i + 8] = total
    return np.linalg.solve(system, left).reshape((s, 8, count))
