"""Cases of a trade study: labels of a fixed draw of starts, and the share of them that walk."""

import functools
from collections.abc import Iterator
from typing import Any

import _batches
import numpy as np
from _batches import WALKING
from _trade_store import Case, Store, not_installed
from _trade_walks import tolerances
from reference import labels
from reference.numbalsoda_solves import lsoda_address

import jaxbiped as jb
from jaxbiped.trade import Row, Truth, row_of, work_of

STARTS, QUICK_STARTS = 4096, 128
FINEST, QUICK_FINEST = 1e-10, 1e-7
QUICK_TOLERANCES = (1e-3, 1e-6)
"""Of a draw so small that none finer than the first labels a start wrongly."""
MOST_STEPS = 1 << 19
SOLVERS = ("rodas4p", "rodas5p", "rodas4")
OUT_OF_STEPS = int(jb.basins.Label.OUT_OF_STEPS)


def cases(store: Store, quick: bool) -> Iterator[Case]:
    """By lanes, the named accuracies, and by numbalsoda, which a second labelling judges.

    Errors are shares of the starts: labels that are wrong, starts that are wrong about walking
    or not, and how far the share that walks is off. None wrong counts as half a start. Labels of
    numbalsoda have names of their own for what falls; they are told for walking or not alone.
    """
    count, finest, repeats = (QUICK_STARTS, QUICK_FINEST, 1) if quick else (STARTS, FINEST, 3)

    @functools.cache
    def exact() -> np.ndarray:
        return swept(count, solver="rodas5p", rtol=finest)[0]

    def truth() -> Truth:
        def references():
            other = swept(count, solver="rodas4", rtol=finest)[0]
            exactly = {name: np.zeros(1) for name in ("labels", "walking", "fraction")}
            return exactly, shares_off(other, exact())

        return store.truth("basin", references)

    def ours(setting: str, **how: Any) -> Row:
        known = truth()
        (codes, steps), work = work_of(lambda: swept(count, **how), repeats)
        way = f"{how.get('solver', SOLVERS[0])} (lanes)"
        values = shares_off(codes, exact())
        return row_of(way, setting, "ok", known, values, work, attempted=steps)

    def peer(rtol: float) -> Row:
        """On all of numba's threads, its pieces judged by plain rules of their own."""
        known, labelling = truth(), _batches.labelling_of("compliant", rtol=1e-6)
        batch = _batches.starts_of(labelling.scene, count).batch(labelling, 0, count)
        states = np.stack(list(map(np.asarray, batch.states)), axis=1)
        attractor = labelling.family.rows[0][0]
        labels.by_numbalsoda(states[:2], attractor, rtol)  # numba compiles apart
        codes, work = work_of(lambda: labels.by_numbalsoda(states, attractor, rtol), repeats)
        values = shares_off(codes, exact())
        del values["labels"]
        return row_of("numbalsoda", f"rtol={rtol:g}", "ok", known, values, work)

    for solver in SOLVERS[: 1 if quick else None]:
        for rtol in QUICK_TOLERANCES if quick else tolerances(quick, -3, -8):
            how = functools.partial(ours, f"rtol={rtol:g}", solver=solver, rtol=rtol)
            yield Case("basin", f"{solver} (lanes)", f"rtol={rtol:g}", how)
    for name in () if quick else jb.ACCURACIES:
        how = functools.partial(ours, name, accuracy=name)
        yield Case("named basin", f"{SOLVERS[0]} (lanes)", name, how)
    if lsoda_address() is None:
        yield not_installed("basin", "numbalsoda")
        return
    for rtol in tolerances(quick, -3, -7):  # finer ones need more steps than its pieces may take
        yield Case("basin", "numbalsoda", f"rtol={rtol:g}", functools.partial(peer, rtol))


def swept(count: int, **how: Any) -> tuple[np.ndarray, int]:
    """Codes of the labels of a fixed draw, and the steps that all of them took."""
    starts = _batches.starts_of(jb.seed_scene(), count)
    found = _batches.labelled("compliant", starts, look=False, max_solver_steps=MOST_STEPS, **how)
    return found["label"].values, int(found["attempted"].sum())


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
