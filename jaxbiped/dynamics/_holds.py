"""What is held of a mechanism on rigid feet: limits of stops, and a foot that lies flat.

Each is a sum of angles that stays as it is. A reaction that works on it is above zero where it is
pressed: a limit of a stop, which its gap leaves as it grows, or the foot of a leg that is not the
tree's root.
"""

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.dynamics._implicit_field import fold
from jaxbiped.dynamics._stance import Stance
from jaxbiped.linalg._elimination import symmetric_factors
from jaxbiped.linalg._sparse_lu import SparseFactors
from jaxbiped.scene._modes import Modes
from jaxbiped.scene._structure import Angle, weighted

ROUNDING = 1e-13
"""Rate [rad/s], or acceleration, that nothing pulls with."""
Row = dict[int, Any]
"""A sum of a tree's free angles: weights by their rows."""


class Holds(NamedTuple):
    """Rows G that may be held, with M⁻¹ Gᵀ and G M⁻¹ Gᵀ.

    Attributes:
        rows: of the flat foot, where the leg that stands has two feet, then of each limit.
        answers: of each row.
        mobility: lower half of a symmetric matrix.
    """

    rows: list[Row]
    answers: list[Row]
    mobility: list[list[Scalar]]

    def along(self, values: Row) -> list[Scalar]:
        """The sums of values."""
        return [_sum(row, values) for row in self.rows]

    def reactions(self, free: Row, held: Sequence[Scalar]) -> list[Scalar]:
        """What holds the sums at zero against free values; zero where nothing is held."""
        one = jnp.ones_like(self.mobility[0][0])
        zero = 0.0 * one
        matrix = [
            [
                jnp.where(held[i] & held[j], entry, one if i == j else zero)
                for j, entry in enumerate(row)
            ]
            for i, row in enumerate(self.mobility)
        ]
        right = [
            jnp.where(h, -value, zero) for h, value in zip(held, self.along(free), strict=True)
        ]
        return symmetric_factors(matrix).solve(right)

    def under(self, free: Row, reactions: Sequence[Scalar]) -> Row:
        """Values with the reactions."""
        found = dict(free)
        for reaction, answer in zip(reactions, self.answers, strict=True):
            for row, value in answer.items():
                found[row] = found[row] + reaction * value
        return found

    def pressed(
        self,
        free: Row,
        held: Sequence[Scalar],
        loose: Sequence[Scalar | bool],
        least: Scalar | float = -ROUNDING,
    ) -> list[Scalar]:
        """What stays held of loose ones: what is pressed on, while the others leave.

        What would have to pull is released, and what would pass its limit is held again, the worst
        first by the energy of its motion.

        `least`: the rate or acceleration that is pressed away, below which one would have to pull.
        """
        held = [jnp.asarray(each) for each in held]
        able = [i for i, each in enumerate(loose) if each is not False]
        wanted = [held[i] & loose[i] for i in able]
        for _ in range(_passes(len(able))):
            reactions = self.reactions(free, held)
            rates = self.along(self.under(free, reactions))
            short = [
                jnp.where(
                    held[i], reactions[i] * self.mobility[i][i] - least, rates[i] + jnp.abs(least)
                )
                / jnp.sqrt(self.mobility[i][i])
                for i in able
            ]
            wrong = [
                jnp.where(w, jnp.minimum(x, 0.0), 0.0) for w, x in zip(wanted, short, strict=True)
            ]
            worst = functools.reduce(jnp.minimum, wrong)
            for i, each in zip(able, wrong, strict=True):
                held[i] = held[i] ^ ((each < 0.0) & (each <= worst))
        return held


def _passes(count: int) -> int:
    """After how many changes of what is held all of so many loose ones are as they belong.

    No more were needed by any of 160,000 random mobilities of two to five.
    """
    return count if count < 3 else 2 * count - 1


def holds_of(stance: Stance, modes: Modes, factors: SparseFactors) -> Holds:
    """The rows of a stance.

    Args:
        stance: on whatever foot.
        modes: of its mechanism.
        factors: of its mass matrix by the tree's free angles.
    """
    tree = stance.tree
    angles = [Angle(((tree.body, 1.0),))] if len(stance.feet) > 1 else []
    angles += [limit.gap for limit in modes.limits]
    rows, answers = [], []
    for angle in angles:
        weights: list[Any] = [None] * (2 + len(tree.bodies))
        for body, weight in angle.weights:
            weights[2 + body] = weight
        row = fold(tree.weights, weights)
        rows.append(row)
        answers.append({k: value for k, value in factors.solve(row).items() if value is not None})
    mobility = [[_sum(rows[i], answers[j]) for j in range(i + 1)] for i in range(len(rows))]
    return Holds(rows, answers, mobility)


def _sum(row: Row, values: Row) -> Scalar:
    terms = [weighted(values[k], weight) for k, weight in row.items() if k in values]
    return sum(terms[1:], terms[0])
