"""Radau IIA collocation about a known step, in the root of the time since the last switch.

After a switch second derivatives of the rates may be as singular as the inverse root of that time
(Hertz's law after touchdown); in the root itself the motion is smooth.

Source: Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.5, order five.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxbiped._types import Scalar

_ROOT = 6.0**0.5
_NODES = np.array([(4 - _ROOT) / 10, (4 + _ROOT) / 10, 1.0])
RADAU = np.array(
    [
        [(88 - 7 * _ROOT) / 360, (296 - 169 * _ROOT) / 1800, (-2 + 3 * _ROOT) / 225],
        [(296 + 169 * _ROOT) / 1800, (88 + 7 * _ROOT) / 360, (-2 - 3 * _ROOT) / 225],
        [(16 - _ROOT) / 36, (16 + _ROOT) / 36, 1 / 9],
    ]
)
"""Weights of the rates at the nodes."""


class KnownStep(NamedTuple):
    """A step of a solved motion.

    Attributes:
        before, after: states where it starts and ends, shape (c,).
        start, span: time of its start and duration [s].
        switched: time of the last switch before it [s].
        fresh: whether it starts on a switch.
        crossed: whether it ends on one.
    """

    before: Scalar
    after: Scalar
    start: Scalar
    span: Scalar
    switched: Scalar
    fresh: Scalar
    crossed: Scalar

    def clock(self) -> tuple[Scalar, Scalar]:
        """Of the collocation points: the part of the step before each, and its share of time, (3,).

        A share is the derivative of time in the step's own variable, which runs evenly in the root
        of the time since the last switch.
        """
        since = self.start - self.switched
        first, last = jnp.sqrt(since), jnp.sqrt(since + self.span)
        width = jnp.where(self.span > 0.0, self.span / (first + last), 0.0)
        root = first + width * _NODES
        elapsed = width * _NODES * (root + first)
        return elapsed / jnp.where(self.span > 0.0, self.span, 1.0), 2.0 * root * width
