"""Steps as they are saved: states on both sides of each reset, and the motion between."""

from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import Array, PyTree

from jaxbiped._types import Numbers, Scalar, by_numpy, is_traced
from jaxbiped.hybrid._landing_system import LandingMotion
from jaxbiped.solve._explicit_step import state_after
from jaxbiped.solve._recorders import NO_RESET, STRIKE
from jaxbiped.solve._stepper import Stepper


class LandingStep(diffrax.AbstractLocalInterpolation):
    """States within a step, each by a step of its own: as accurate as the step's end.

    Attributes:
        t0, t1: its ends [s].
        motion: what moves.
        y0: the state where it began.
        accelerations: of the positions there.
    """

    t0: Scalar  # type: ignore[misc]
    t1: Scalar  # type: ignore[misc]
    motion: LandingMotion
    y0: Any
    accelerations: tuple[Scalar, ...]

    def evaluate(self, t0: Any, t1: Any = None, left: bool = True) -> Any:
        del t1, left
        start = self.motion.system.carried(self.motion.args, self.y0)
        return state_after(self.motion, start, self.accelerations, jnp.asarray(t0 - self.t0))


class LandingRecord(NamedTuple):
    """The saved steps of a landing solve, infinite beyond the last.

    Attributes:
        t: their ends [s], shape (n + 1,), those in a reset twice.
        state: the states there, the one before a reset first.
        dense: the continuous solution.
        strikes: a time and the state behind it of each arrival, shape (r, 1 + numbers).
        resets: the same of each arrival and each change of mode, and how many there were.
    """

    t: Array
    state: Any
    dense: diffrax.DenseInterpolation
    strikes: Numbers
    resets: tuple[Numbers, Scalar]


def landing_record(
    motion: LandingMotion, start: Any, rows: Numbers, total: Scalar
) -> LandingRecord:
    """The steps that a `StepRecorder` saved as rows, `total` in all, from a start."""
    size, kind = len(start), type(start)

    def steps_of(numpy: Any, rows: Any, total: Any, *start: Any) -> tuple[Any, ...]:
        known = numpy.arange(len(rows)) < total
        places = [1, 2, 2 + size, 2 + 2 * size]
        t, code, before, after, accelerations = numpy.split(rows, places, axis=1)
        begin = numpy.concatenate([numpy.stack(start)[None], after])[:-1]
        reset, struck = known & (code[:, 0] != NO_RESET), known & (code[:, 0] == STRIKE)

        def first(rows: Any, chosen: Any) -> Any:
            """The chosen rows before all others, which are infinite."""
            order = numpy.argsort(~chosen, stable=True)
            return numpy.where(chosen[order][:, None], rows[order], numpy.inf)

        # In a reset a step of no length leads from one side to the other.
        sides = [numpy.hstack([t, end, begin, accelerations]) for end in (before, after)]
        both = numpy.stack(sides, axis=1).reshape(2 * len(rows), -1)
        steps = first(both, numpy.stack([known, reset], axis=1).reshape(-1))
        behind = numpy.hstack([t, after])
        passed, hits = numpy.sum(reset), numpy.sum(struck)
        counts = numpy.sum(known) + passed, hits, passed
        return (steps, first(behind, struck), first(behind, reset)), counts

    tables, counts = by_numpy(steps_of, rows, total, *start)
    if not is_traced(counts):
        tables = tuple(table[: int(n)] for table, n in zip(tables, counts, strict=True))
    (steps, strikes, resets), (count, _, passed) = tables, counts

    def columns(numpy: Any, steps: Any, *start: Any) -> tuple[Any, Any]:
        # One step more than there are: where there are none, diffrax looks into one all the same.
        rest = numpy.full((1, steps.shape[1]), numpy.inf, steps.dtype)
        begin = numpy.concatenate([numpy.zeros(1, steps.dtype), numpy.stack(start)])
        ends = numpy.concatenate([begin[None], steps[:, : 1 + size], rest[:, : 1 + size]])
        return ends.T, numpy.concatenate([steps[:, 1 + size :], rest[:, 1 + size :]]).T

    (ends, *states), insides = by_numpy(columns, steps, *start)
    dense = diffrax.DenseInterpolation(
        ts=ends,
        ts_size=1 + count.astype(np.int32),  # diffrax's own width
        infos=dict(
            motion=jtu.tree_map(lambda leaf: _repeated(leaf, len(insides[0])), motion),
            y0=kind(*insides[:size]),
            accelerations=tuple(insides[size:]),
        ),
        interpolation_cls=LandingStep,
        direction=1,
        t0_if_trivial=0.0,
        y0_if_trivial=start,
    )
    state = kind(*(leaf[:-1] for leaf in states))
    return LandingRecord(ends[:-1], state, dense, strikes, (resets, passed))


def _repeated(leaf: Numbers, times: int) -> Array:
    """A number of the scene as each step has it."""
    repeated: Array = by_numpy(
        lambda numpy, leaf: numpy.broadcast_to(leaf, (times, *leaf.shape)), jnp.asarray(leaf)
    )
    return repeated


def recorded_steps(
    start: PyTree, rows: np.ndarray, stepper: Stepper, *, resets: bool
) -> tuple[Array, PyTree, diffrax.DenseInterpolation]:
    """The times [s] of a start and of n steps' ends, (n + 1,), the states there, and the rest.

    From the rows of `StepRecorder`, shape (n, numbers), as diffrax would have them. With `resets`,
    each row ends with the state before the reset; where there is one, its time comes twice.
    """
    leaves, kind = jtu.tree_flatten(start)
    size = len(leaves)
    first = np.array([0.0, *map(float, leaves)])
    begins = np.vstack([first[1:], rows[:, 1 : 1 + size]])[:-1]
    if resets:
        rows, begins = _with_both_sides(rows, begins)
    ends = np.vstack([first, rows[:, : 1 + size]]).T.copy()
    # One step more than there are: where there are none, diffrax looks into one all the same.
    times = np.append(ends[0], np.inf)
    infos = np.vstack([begins.T, rows[:, 1:].T])
    infos = np.pad(infos, ((0, 0), (0, 1)), constant_values=np.inf)
    groups = [jtu.tree_unflatten(kind, infos[k : k + size]) for k in range(0, len(infos), size)]
    # One transfer for all of them: each costs as much as several steps.
    counts = len(rows) + 1, 1  # of a weak type, as a number in diffrax's own would be
    parts = times, groups, ends[0], jtu.tree_unflatten(kind, ends[1:]), np.float64(0.0), counts
    times, groups, t, states, zero, (count, one) = jax.device_put(parts)
    dense = diffrax.DenseInterpolation(
        ts=times,
        ts_size=count,
        infos=dict(y0=groups[0], y1=groups[1], coefficients=tuple(groups[2:])),
        interpolation_cls=stepper.interpolation_cls,
        direction=one,
        t0_if_trivial=zero,
        y0_if_trivial=start,
    )
    return t, states, dense


def _with_both_sides(rows: np.ndarray, begins: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of steps to the states before resets, each followed by one of no length behind it."""
    size = begins.shape[1]
    behind, before = rows[:, 1 : 1 + size], rows[:, -size:]
    to_reset, in_reset = rows[:, :-size].copy(), rows[:, :-size].copy()
    to_reset[:, 1 : 1 + size] = before
    in_reset[:, 1 + size :] = 0.0
    kept = np.stack([np.ones(len(rows), bool), np.any(before != behind, axis=1)], axis=1)
    both = (np.stack([to_reset, in_reset], axis=1), np.stack([begins, behind], axis=1))
    steps, starts = (each[kept] for each in both)
    return steps, starts
