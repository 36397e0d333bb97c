"""Derivatives of a law with respect to its arguments and each of its parameters, two ways."""

import jax
import jax.numpy as jnp
import numpy as np

STEP = 1e-6


class Force:
    """A law's force as a function of one array: its parameters, then its two arguments."""

    def __init__(self, law):
        leaves, structure = jax.tree.flatten(law)
        self.parameters = np.array([float(leaf) for leaf in leaves])

        def force(variables):
            parts = list(variables)
            at = jax.tree.unflatten(structure, parts[: len(leaves)])
            return at.force(*parts[len(leaves) :])

        self.force = jax.jit(jax.vmap(force))
        self.gradient = jax.jit(jax.vmap(jax.grad(force)))

    def at(self, first, second):
        """Variables at many points, shape (points, variables)."""
        first, second = np.broadcast_arrays(np.atleast_1d(first), np.atleast_1d(second))
        parameters = np.broadcast_to(self.parameters, (first.size, self.parameters.size))
        return np.column_stack([parameters, first, second])

    def exact(self, x, scales):
        """Derivatives times the variables' scales."""
        return np.asarray(self.gradient(jnp.asarray(x))) * scales

    def difference(self, x, scales, *, side=0):
        """The same by central differences, or by those from above (1) or below (−1)."""
        found = []
        for i in range(x.shape[1]):
            step = STEP * np.eye(x.shape[1])[i] * scales
            at = lambda k, step=step: np.asarray(self.force(jnp.asarray(x + k * step)))
            if side:
                found.append((4 * at(side) - 3 * at(0) - at(2 * side)) / (2 * side * STEP))
            else:
                found.append((at(1) - at(-1)) / (2 * STEP))
        return np.column_stack(found)

    def beside(self, x, scales):
        """Beside a switch: exact derivatives, and differences to the side that agrees better."""
        exact = self.exact(x, scales)
        above, below = (self.difference(x, scales, side=side) for side in (1, -1))
        return exact, np.where(abs(above - exact) < abs(below - exact), above, below)

    def within_sides(self, x, scales):
        """On a switch: exact derivatives, and the lesser and greater of those from the sides."""
        sides = [self.difference(x, scales, side=side) for side in (1, -1)]
        return self.exact(x, scales), np.minimum(*sides), np.maximum(*sides)
