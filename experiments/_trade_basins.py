"""Cases of a trade study: labels of a fixed draw of starts, and the share of them that walk."""

import functools
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import _batches
import numpy as np
from _trade_store import Case, Store
from _trade_walks import tolerances
from reference import labels
from reference.numbalsoda_solves import lsoda_address

import jaxbiped as jb
from jaxbiped.trade import Row, Truth, failed_row, row_of, work_of

STARTS, QUICK_STARTS = 4096, 128
FINEST, QUICK_FINEST = 1e-10, 1e-7
QUICK_TOLERANCES = (1e-3, 1e-6)
"""Of a draw so small that none finer than the first labels a start wrongly."""
MOST_STEPS = 1 << 19
SOLVERS = ("rodas4p", "rodas5p", "rodas4")
WALKING = int(jb.basins.Label.WALKING)
OUT_OF_STEPS = int(jb.basins.Label.OUT_OF_STEPS)


def cases(store: Store, quick: bool) -> Iterator[Case]:
    """By lanes, the named accuracies, and by numbalsoda, which a second labelling judges.

    Errors are shares of the starts: labels that are wrong, starts that are wrong about walking
    or not, and how far the share that walks is off. None wrong counts as half a start. Labels of
    numbalsoda have names of their own for what falls; they are told for walking or not alone.
    """
    count = QUICK_STARTS if quick else STARTS
    finest, repeats = (QUICK_FINEST, 1) if quick else (FINEST, 3)

    @functools.cache
    def exact() -> np.ndarray:
        return swept(count, solver="rodas5p", rtol=finest)[0]

    def truth() -> Truth:
        def references() -> tuple[Any, Any]:
            other = swept(count, solver="rodas4", rtol=finest)[0]
            exactly = {name: np.zeros(1) for name in ("labels", "walking", "fraction")}
            return exactly, shares_off(other, exact())

        return store.truth("basin", references)

    def ours(way: str, setting: str, **how: Any) -> Row:
        known = truth()
        (codes, steps), work = work_of(lambda: swept(count, **how), repeats)
        values = shares_off(codes, exact())
        return row_of(way, setting, "ok", known, values, work, attempted=steps)

    for solver in SOLVERS[: 1 if quick else None]:
        for rtol in QUICK_TOLERANCES if quick else tolerances(quick, -3, -8):
            way, setting = f"{solver} by lanes", f"rtol={rtol:g}"
            how = functools.partial(ours, way, setting, solver=solver, rtol=rtol)
            yield Case("basin", way, setting, how)
    for name in () if quick else jb.ACCURACIES:
        how = functools.partial(ours, "rodas4p by lanes", name, accuracy=name)
        yield Case("named basin", "rodas4p by lanes", name, how)
    if lsoda_address() is None:
        missing = functools.partial(failed_row, "numbalsoda", "rtol=1e-6", "not installed")
        yield Case("basin", "numbalsoda", "rtol=1e-6", missing)
        return
    for rtol in tolerances(quick, -3, -7):  # finer ones need more steps than its pieces may take
        how = functools.partial(peer, count, rtol, repeats, truth, exact)
        yield Case("basin", "numbalsoda", f"rtol={rtol:g}", how)


def swept(count: int, **how: Any) -> tuple[np.ndarray, int]:
    """Codes of the labels of a fixed draw, and the steps that all of them took."""
    labelling = labelling_of(tuple(how.items()))
    starts = _batches.starts_of(labelling.scene, count)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of starts that ran out of steps
        found = jb.sweep(labelling, starts, look_for_gaits=False)
    return found["label"].values, int(found["attempted"].sum())


@functools.cache  # its gait is found once
def labelling_of(how: tuple[tuple[str, Any], ...]) -> jb.Labelling:
    """A labelling of the seed's walker."""
    return _batches.labelling_of("compliant", max_solver_steps=MOST_STEPS, **dict(how))


def shares_off(codes: np.ndarray, exact: np.ndarray) -> dict[str, np.ndarray]:
    """Shares (1,) of wrong labels, of wrong walking or not, and the error of what walks."""
    known = exact != OUT_OF_STEPS
    codes, exact = codes[known], exact[known]
    walks, walked = codes == WALKING, exact == WALKING
    wrong = {
        "labels": np.sum(codes != exact),
        "walking": np.sum(walks != walked),
        "fraction": abs(int(walks.sum()) - int(walked.sum())),
    }
    return {name: np.array([max(n, 0.5) / len(exact)]) for name, n in wrong.items()}


def peer(
    count: int,
    rtol: float,
    repeats: int,
    truth: Callable[[], Truth],
    exact: Callable[[], np.ndarray],
) -> Row:
    """numbalsoda on all of numba's threads, its pieces judged by plain rules of their own."""
    labelling = labelling_of((("rtol", 1e-6),))
    batch = _batches.starts_of(labelling.scene, count).batch(labelling, 0, count)
    states = np.stack(list(map(np.asarray, batch.states)), axis=1)
    attractor = labelling.family.rows[0][0]
    known = truth()
    labels.by_numbalsoda(states[:2], attractor, rtol)  # numba compiles apart
    codes, work = work_of(lambda: labels.by_numbalsoda(states, attractor, rtol), repeats)
    values = shares_off(codes, exact())
    del values["labels"]
    return row_of("numbalsoda", f"rtol={rtol:g}", "ok", known, values, work)
