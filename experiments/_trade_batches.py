"""Cases of a trade study: 4096 walks of two seconds at once."""

import functools
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from _batches import perturbed
from _trade_store import Case, Store
from _trade_walks import FINEST, tolerances, walk_of
from reference.numbalsoda_solves import lsoda_address, lsoda_batch
from reference.scipy_solves import final_of

import jaxbiped as jb
from jaxbiped.trade import Row, Truth, failed_row, row_of, work_of

LANES, QUICK_LANES = 4096, 64
CHECKED, QUICK_CHECKED = 8, 2
"""Walks of the batch whose errors are looked at."""
WAYS = (("rodas4p", "lanes"), ("rodas5p", "lanes"), ("rodas4", "lanes"), ("rodas4p", "xla"))


def cases(store: Store, quick: bool) -> Iterator[Case]:
    """By lanes and through XLA; errors are the largest of the walks that are looked at."""
    count, checked = (QUICK_LANES, QUICK_CHECKED) if quick else (LANES, CHECKED)
    walk, scene = walk_of(jb.seed_scene(), quick), jb.seed_scene()

    @functools.cache
    def program_of(solver: str, engine: str) -> Callable[..., Any]:
        def one(rtol: Any, *start: Any) -> Any:
            how: dict[str, Any] = dict(solver=solver, rtol=rtol, save="end", engine=engine)
            end = jb.simulate(scene, jb.State(*start), duration=walk.duration, **how)
            return end.final, end.ending, end.accepted, end.rejected

        return jax.jit(jax.vmap(one, in_axes=(None, *[0] * 8)))

    def solver_of(solver: str, engine: str, rtol: float) -> Callable[[np.ndarray], Any]:
        program = program_of(solver, engine)
        return lambda starts: program(jnp.asarray(rtol), *map(jnp.asarray, starts.T))

    def states(found: Any) -> np.ndarray:
        return np.stack(found[0], axis=1)[:checked] / walk.units()

    def truth() -> Truth:
        def references() -> tuple[Any, Any]:
            some = perturbed(count)[:checked]
            other = np.stack([final_of(walk.duration, FINEST, start=start) for start in some])
            ours = states(solver_of("rodas5p", "lanes", FINEST)(some))
            return {"state": ours}, {"state": other / walk.units()}

        return store.truth("batch", references)

    def measure(solver: str, engine: str, rtol: float) -> Row:
        run, starts = solver_of(solver, engine, rtol), perturbed(count)
        found, work = work_of(lambda: run(starts), 1 if quick else 3)
        endings, accepted, rejected = map(np.asarray, found[1:])
        fell = int(np.sum(endings != 0))
        outcome = "ok" if fell == 0 else f"{fell} of {count} did not walk on"
        steps = int(np.sum(accepted) + np.sum(rejected))
        return row_of(
            f"{solver} by {engine}",
            f"rtol={rtol:g}",
            outcome,
            truth(),
            {"state": states(found)},
            work,
            attempted=steps,
            rejected=int(np.sum(rejected)),
        )

    for solver, engine in WAYS[: 1 if quick else None]:
        for rtol in tolerances(quick, -3, -8) if engine == "lanes" else (1e-4, 1e-6):
            how = lambda s=solver, e=engine, r=rtol: measure(s, e, r)  # noqa: E731
            yield Case("batch", f"{solver} by {engine}", f"rtol={rtol:g}", how)
    if lsoda_address() is None:
        missing = lambda: failed_row("numbalsoda", "rtol=1e-6", "not installed")  # noqa: E731
        yield Case("batch", "numbalsoda", "rtol=1e-6", missing)
        return

    def measure_peer(rtol: float) -> Row:
        batch, starts = lsoda_batch(), perturbed(count)
        times = np.array([0.0, walk.duration])
        batch(starts[:2], times, rtol, 1e-2 * rtol)  # numba compiles apart
        repeats = 1 if quick else 3
        found, work = work_of(lambda: batch(starts, times, rtol, 1e-2 * rtol), repeats)
        failed = int(np.sum(~np.isfinite(found).all(axis=1)))
        outcome = "ok" if failed == 0 else f"{failed} of {count} failed"
        values = {"state": found[:checked] / walk.units()}
        return row_of("numbalsoda", f"rtol={rtol:g}", outcome, truth(), values, work)

    for rtol in tolerances(quick, -3, -8):
        yield Case("batch", "numbalsoda", f"rtol={rtol:g}", lambda r=rtol: measure_peer(r))
