"""Cases of a trade study: 4096 walks of two seconds at once."""

import functools
from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
from _trade_store import Case, Store, not_installed
from _trade_walks import FINEST, tolerances, walk_of
from _walks import perturbed, walk_from
from reference.numbalsoda_solves import lsoda_address, lsoda_batch
from reference.scipy_solves import final_of

import jaxbiped as jb
from jaxbiped.trade import Row, Truth, row_of, work_of

LANES, QUICK_LANES = 4096, 64
CHECKED, QUICK_CHECKED = 8, 2
"""Walks of the batch whose errors are looked at."""
WAYS = (("rodas4p", "lanes"), ("rodas5p", "lanes"), ("rodas4", "lanes"), ("rodas4p", "xla"))


def cases(store: Store, quick: bool) -> Iterator[Case]:
    """By lanes and through XLA; errors are the largest of the walks that are looked at."""
    count, checked = (QUICK_LANES, QUICK_CHECKED) if quick else (LANES, CHECKED)
    walk, starts = walk_of(jb.seed_scene(), quick), perturbed(count)
    repeats, units = 1 if quick else 3, walk.units()

    @functools.cache
    def program_of(solver: str, engine: str):
        def one(rtol, *start):
            how = dict(duration=walk.duration, solver=solver, engine=engine, atol=None)
            end = walk_from(start, rtol, **how)
            return end.final, end.ending, end.accepted, end.rejected

        return jax.jit(jax.vmap(one, in_axes=(None, *[0] * 8)))

    def solved(solver: str, engine: str, rtol: float, starts: np.ndarray):
        return program_of(solver, engine)(jnp.asarray(rtol), *map(jnp.asarray, starts.T))

    def values(finals: np.ndarray) -> dict[str, np.ndarray]:
        return {"state": finals[:checked] / units}

    def truth() -> Truth:
        def references():
            some = starts[:checked]
            ours = np.stack(solved("rodas5p", "lanes", FINEST, some)[0], axis=1)
            other = np.stack([final_of(walk.duration, FINEST, start=start) for start in some])
            return values(ours), values(other)

        return store.truth("batch", references)

    def measure(solver: str, engine: str, rtol: float) -> Row:
        found, work = work_of(lambda: solved(solver, engine, rtol, starts), repeats)
        endings, accepted, rejected = map(np.asarray, found[1:])
        fell, lost = int(np.sum(endings != 0)), int(np.sum(rejected))
        outcome = "ok" if fell == 0 else f"{fell} of {count} did not walk on"
        counts = dict(attempted=int(np.sum(accepted)) + lost, rejected=lost)
        told = f"{solver} ({engine})", f"rtol={rtol:g}", outcome, truth()
        return row_of(*told, values(np.stack(found[0], axis=1)), work, **counts)

    def measure_peer(rtol: float) -> Row:
        batch, times = lsoda_batch(), np.array([0.0, walk.duration])
        batch(starts[:2], times, rtol, 1e-2 * rtol)  # numba compiles apart
        found, work = work_of(lambda: batch(starts, times, rtol, 1e-2 * rtol), repeats)
        failed = int(np.sum(~np.isfinite(found).all(axis=1)))
        outcome = "ok" if failed == 0 else f"{failed} of {count} failed"
        return row_of("numbalsoda", f"rtol={rtol:g}", outcome, truth(), values(found), work)

    for solver, engine in WAYS[: 1 if quick else None]:
        for rtol in tolerances(quick, -3, -8) if engine == "lanes" else (1e-4, 1e-6):
            how = functools.partial(measure, solver, engine, rtol)
            yield Case("batch", f"{solver} ({engine})", f"rtol={rtol:g}", how)
    if lsoda_address() is None:
        yield not_installed("batch", "numbalsoda")
        return
    for rtol in tolerances(quick, -3, -8):
        how = functools.partial(measure_peer, rtol)
        yield Case("batch", "numbalsoda", f"rtol={rtol:g}", how)
