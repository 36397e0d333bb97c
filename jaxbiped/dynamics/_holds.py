"""What is held of a mechanism on rigid feet: limits of stops, and a foot that lies flat.

Each is a sum of angles that stays as it is. A reaction that works on it is above zero where it is
pressed: a limit of a stop, which its gap leaves as it grows, or the foot of a leg that is not the
tree's root.
"""

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped._types import Scalar
from jaxbiped.dynamics._force_balance import fold
from jaxbiped.dynamics._stance import Stance, angles_and_rates, stance_on
from jaxbiped.linalg._small_matrices import symmetric_factors
from jaxbiped.linalg._sparse_lu import SparseFactors
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._mechanism_pieces import with_fixed
from jaxbiped.scene._modes import Limit, Modes, rigid_modes, standing_legs
from jaxbiped.scene._scene import RigidScene
from jaxbiped.scene._structure import Angle, weighted

ROUNDING = 1e-13
"""Rate [rad/s], or acceleration, that nothing pulls with."""
_CANCELLED = 1e-12
"""Weight that is none: couplings cancel it."""
_DEPENDENT = 1e-10
"""What is left of a row's mobility where the rows before it move it along."""
Row = dict[int, Any]
"""A sum of a tree's free angles: weights by their rows."""


class Holds(NamedTuple):
    """Rows G that may be held, with M⁻¹ Gᵀ and G M⁻¹ Gᵀ.

    Attributes:
        rows: of the flat foot, where the leg that stands has two feet, then of each limit. A row is
            empty where couplings fix the sum: nothing can move it, and its reaction is zero.
        answers: of each row.
        mobility: lower half of a symmetric matrix.
    """

    rows: list[Row]
    answers: list[Row]
    mobility: list[list[Scalar]]

    def along(self, values: Row) -> list[Scalar]:
        """The sums of values."""
        zero = 0.0 * self.mobility[0][0]
        return [_sum(row, values, zero) for row in self.rows]

    def reactions(self, free: Row, held: Sequence[Scalar]) -> list[Scalar]:
        """What holds the sums at zero against free values; zero where nothing is held.

        Of rows that depend on each other, the last have no reaction.
        """
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
        return symmetric_factors(matrix, least=_DEPENDENT).solve(right)

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
        able = [i for i, row in enumerate(self.rows) if loose[i] is not False and row]
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
    """The rows of a stance; `factors` are those of the mass matrix by the tree's free angles."""
    tree = stance.tree
    angles = [Angle(((tree.body, 1.0),))] if len(stance.feet) > 1 else []
    angles += [limit.gap for limit in modes.limits]
    rows, answers = [], []
    for angle in angles:
        weights: list[Any] = [None] * (2 + len(tree.bodies))
        for body, weight in angle.weights:
            weights[2 + body] = weight
        folded = fold(tree.weights, weights)
        row = {k: value for k, value in folded.items() if abs(value) > _CANCELLED}
        rows.append(row)
        answers.append({k: value for k, value in factors.solve(row).items() if value is not None})
    zero = jnp.zeros_like(stance.pose.motion.x)
    mobility = [[_sum(rows[i], answers[j], zero) for j in range(i + 1)] for i in range(len(rows))]
    return Holds(rows, answers, mobility)


def _sum(row: Row, values: Row, zero: Scalar) -> Scalar:
    terms = [weighted(values[k], weight) for k, weight in row.items() if k in values]
    return sum(terms[1:], terms[0]) if terms else zero


def gap_of(scene: RigidScene, limit: Limit, stance: Stance) -> Scalar:
    """How far a limit is [rad]."""
    return limit.distance(stance.mechanism, stance.pose.motion.angles, scene.ground.slope)


def on_held(scene: RigidScene, state: Any) -> Any:
    """The state with what is held where it belongs and at rest: stops at their limits, flat feet.

    One step of Newton's method; derivatives are those of states that are held there.
    """
    mechanism, modes = scene.mechanism, rigid_modes(scene.mechanism)
    if not modes.any:
        return state
    structure, fixed = mechanism.structure, jax.lax.stop_gradient(state.mode)
    mode, flat = modes.decoded(jnp, fixed), modes.flat(modes.decoded(jnp, fixed))
    soles = [Angle(((structure.feet[structure.feet_of_leg[leg][0]], 1.0),)) for leg in flat]
    angles = [*soles, *(limit.gap for limit in modes.limits)]
    unit = with_fixed(structure, _unit_rows(mechanism))
    off = [_tilt(stance_on(scene, state, leg)) for leg in flat]
    off += [gap_of(scene, limit, stance_on(scene, state, standing_legs(structure)[-1]))
            for limit in modes.limits]  # fmt: skip
    begun, rates = (jnp.stack(part) for part in angles_and_rates(structure, state))
    now, projection = begun, jnp.eye(len(structure.free))
    held = (*flat.values(), *mode.held)
    for angle, value, is_held in zip(angles, off, held, strict=True):
        row = np.asarray(angle.of(unit))
        left = projection @ row
        along = jnp.where(is_held, left / jnp.maximum(left @ left, 1e-12), 0.0)
        now = now - along * (value + row @ (now - begun))
        rates = rates - along * (row @ rates)
        projection = projection - jnp.outer(left, along)
    others = state[1 + 2 * len(structure.free) : -1]
    return type(state)(state[0], *now, *rates, *others, fixed)


def _tilt(stance: Stance) -> Scalar:
    """How far the feet of a leg are from lying flat [rad]."""
    first, second = stance.feet
    apart = stance.foot(first).x - stance.foot(second).x
    return (stance.height(first) - stance.height(second)) / apart


def _unit_rows(mechanism: Mechanism) -> list[np.ndarray]:
    """Of each body its angle's derivatives by the free angles; of those that follow, zeros."""
    free = mechanism.structure.free
    found = [np.zeros(len(free))] * len(mechanism.bodies)
    for j, row in zip(free, np.eye(len(free)), strict=True):
        found[j] = row
    return found
