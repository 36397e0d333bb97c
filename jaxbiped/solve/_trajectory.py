"""Trajectory: the result of a simulation."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt
from jaxtyping import Array, Float, Int, PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped._summary import summary
from jaxbiped.dynamics._state import State
from jaxbiped.solve._dense_output import evaluate_dense
from jaxbiped.solve._ending import Ending


class Trajectory(eqx.Module):
    """A simulated motion and how it ended. Under `vmap` every leaf gains the batch's axes.

    Attributes:
        t: times that were saved [s], shape (n,).
        state: states at those times, leaves of shape (n,).
        ending: code of an `Ending`; `Ending(int(code))` names it.
        accepted, rejected: numbers of the solver's steps.
        dense: the continuous solution, where all steps were saved.
        arrivals: how many arrivals at a section there were, where these were saved; those beyond
            the room for them are lost. The times of missing ones are infinite.
        lowest, highest: extremes over the ends of the steps, where they were asked for.
        correction: how a redundant start was put on its constraints, a `Consistent`.
        engine: what computed it, "xla" or "lanes".
    """

    t: Float[Array, "..."]
    state: State
    ending: Int[Array, "..."]
    accepted: Int[Array, "..."]
    rejected: Int[Array, "..."]
    dense: diffrax.DenseInterpolation | None
    arrivals: Int[Array, "..."] | None = None
    lowest: PyTree = None
    highest: PyTree = None
    correction: PyTree = None
    engine: str = eqx.field(static=True, default="xla")

    def __repr__(self) -> str:
        return summary(self, like=self.t, code=self.ending, names=Ending, engine=self.engine)

    @property
    def final(self) -> State:
        """The last state saved."""
        return jtu.tree_map(lambda leaf: leaf[..., -1], self.state)

    @property
    def outcome(self) -> Ending:
        """How it ended, by name; for one simulation, not a batch."""
        return Ending(int(self.ending))

    def at(self, t: npt.ArrayLike) -> State:
        """States at times `t` [s] of any shape, to the order of the solver's dense output.

        Under `jit`, `vmap` or derivatives, where it cannot raise, they are NaN outside of the
        trajectory.

        Raises:
            ValueError: a time outside of the trajectory; or only the final state or given times
                were saved, or this is a batch.
        """
        dense = self.require_dense()
        flat = jnp.ravel(jnp.asarray(t, dtype=self.t.dtype))
        traced = any(isinstance(x, jax.core.Tracer) for x in jtu.tree_leaves((dense, flat)))
        if not traced:
            _check_inside(dense, np.asarray(flat))
        if traced or int(dense.ts_size) == 1:
            states = jax.vmap(dense.evaluate)(flat)
        else:
            states = evaluate_dense(dense, np.asarray(flat))
        return jtu.tree_map(lambda leaf: jnp.reshape(leaf, np.shape(t)), states)

    def require_dense(self) -> diffrax.DenseInterpolation:
        """The continuous solution of a single trajectory.

        Raises:
            ValueError: it was not saved, or this is a batch.
        """
        if self.dense is None:
            raise ValueError(
                'Nothing is known between the saved times: simulate with save="steps".'
            )
        if jnp.ndim(self.t) != 1:
            raise ValueError("This is a batch of trajectories: look at one of them at a time.")
        return self.dense


def _check_inside(dense: diffrax.DenseInterpolation, times: np.ndarray) -> None:
    first, last = float(dense.t0), float(dense.t1)
    outside = ~((times >= first) & (times <= last))
    if outside.any():
        raise ArgumentError(
            f"t = {float(times[outside][0])!r} is not allowed: this trajectory lasts from "
            f"{first!r} to {last!r} s."
        )
