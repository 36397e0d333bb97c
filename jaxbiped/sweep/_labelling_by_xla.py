"""Labelling by XLA: a batch of slots, those that are over filled anew between rounds."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped._types import Scalar
from jaxbiped.sweep._labelling_loop import AbstractLabellingLoop, Outcome, Progress, Start

SLOTS = 1024
"""Starts that are followed at once, always as many: every other number compiles anew."""
_ROUND = 128
"""Attempted steps after which slots that are over take the next starts."""


def label_by_xla(
    labelling_loop: AbstractLabellingLoop, starts: Start, *, slots: int = SLOTS
) -> Outcome:
    """Follows n starts until each is certain; arrays (n, …) in, NumPy's out.

    A start that is over waits for the end of its round, not for the longest start of the batch:
    its slot then takes the next one from the queue.
    """
    count = int(np.shape(jtu.tree_leaves(starts)[0])[0])
    owner = np.arange(slots)
    given = _rows(starts, np.minimum(owner, count - 1))
    owner[count:] = -1
    over = jnp.asarray(owner < 0)
    now = _begin(labelling_loop, given)
    waiting = min(slots, count)
    found: list[tuple[np.ndarray, Any]] = []
    while True:
        now, over = _round(labelling_loop, given, now, over)
        done = np.flatnonzero(np.asarray(over) & (owner >= 0))
        if len(done):
            outcome = jtu.tree_map(np.asarray, _finish(labelling_loop, given, now))
            found.append((owner[done], _rows(outcome, done)))
            owner[done] = -1
            fresh = np.arange(waiting, min(waiting + len(done), count))
            waiting += len(fresh)
            if len(fresh):
                places = done[: len(fresh)]
                owner[places] = fresh
                rows, beyond = np.resize(fresh, slots), np.full(slots, slots)
                beyond[: len(places)] = places
                given, now, over = _refill(
                    labelling_loop, given, now, over, jnp.asarray(beyond), _rows(starts, rows)
                )
        if not (owner >= 0).any():
            break
    order = np.argsort(np.concatenate([places for places, _ in found]))
    parts = [part for _, part in found]
    whole: Outcome = jtu.tree_map(lambda *leaves: np.concatenate(leaves)[order], *parts)
    return whole


@eqx.filter_jit
def _begin(labelling_loop: AbstractLabellingLoop, starts: Start) -> Progress:
    return jax.vmap(labelling_loop.begin)(starts)


@eqx.filter_jit
def _finish(labelling_loop: AbstractLabellingLoop, starts: Start, now: Progress) -> Outcome:
    return jax.vmap(labelling_loop.finish)(starts, now)


@eqx.filter_jit
def _round(
    labelling_loop: AbstractLabellingLoop, starts: Start, now: Progress, over: Scalar
) -> tuple[Progress, Scalar]:
    """At most so many attempts further; what is over stays as it is."""
    attempt = jax.vmap(labelling_loop.attempt)

    def going(loop: tuple[Progress, Scalar, Scalar]) -> Scalar:
        _, over, attempts = loop
        return (attempts < _ROUND) & ~jnp.all(over)

    def onward(loop: tuple[Progress, Scalar, Scalar]) -> tuple[Progress, Scalar, Scalar]:
        now, over, attempts = loop
        after, ended = attempt(starts, now)
        kept = jtu.tree_map(lambda old, new: jnp.where(over, old, new), now, after)
        return kept, over | ended, attempts + 1

    now, over, _ = jax.lax.while_loop(going, onward, (now, over, jnp.asarray(0)))
    return now, over


@eqx.filter_jit
def _refill(
    labelling_loop: AbstractLabellingLoop,
    given: Start,
    now: Progress,
    over: Scalar,
    places: Scalar,
    fresh: Start,
) -> tuple[Start, Progress, Scalar]:
    """The starts at these places replaced; a place beyond the slots takes none."""
    begun = jax.vmap(labelling_loop.begin)(fresh)

    def put(old: Any, new: Any) -> Any:
        return old.at[places].set(new, mode="drop")

    given, now = jtu.tree_map(put, given, fresh), jtu.tree_map(put, now, begun)
    return given, now, over.at[places].set(False, mode="drop")


def _rows(tree: Any, rows: np.ndarray) -> Any:
    return jtu.tree_map(lambda leaf: leaf[rows], tree)
