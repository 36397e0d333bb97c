"""Cases of a trade study: period, largest multiplier and the period's gradient."""

from collections.abc import Callable, Iterator
from typing import Any

import gradient_accuracy
import numpy as np
from _trade_store import Case, Store
from _trade_walks import tolerances
from reference.compliant import numbers
from reference.gait import gait

import jaxbiped as jb
from jaxbiped.trade import GaitTrade, Row, Truth, Way, row_of, truth_of, work_of

FINEST = 1e-11
SOLVERS = ("rodas4", "rodas5p")
QUICK_REFERENCES = (1e-9, 1e-8)
STEPPINGS = ("plain", "landing", "norm", "both")


def seed_truth(store: Store, quick: bool) -> Truth:
    """Ours at the finest tolerance; the floor by independent equations and collocation.

    The quick one's floor is by the same method, so that nothing more is compiled.
    """
    trade = GaitTrade(jb.seed_scene())

    def references() -> tuple[Any, Any]:
        if quick:
            ways = (Way("rodas4", "lanes", "", rtol) for rtol in QUICK_REFERENCES)
            first, second = (trade.values(way) for way in ways)
            return first, second
        way = Way("rodas5p", "lanes", "", FINEST)
        state = np.array([float(x) for x in trade.find(way).measures.state])
        found = gait(state[1:], numbers(), ("K", "c", "xi"))
        other = dict(
            period=found.measures[:1],
            multiplier=np.array([found.radius]),
            gradient=found.elasticities,
        )
        return trade.values(way), other

    return store.truth("gait", references)


def cases(store: Store, quick: bool) -> Iterator[Case]:
    """Of the seed's gait, and of the rigid walker's against a truth of its own."""
    trade = GaitTrade(jb.seed_scene(), repeats=1 if quick else 5)
    for solver in SOLVERS[: 1 if quick else None]:
        for rtol in tolerances(quick, -3, -9):
            way = Way(solver, "lanes", f"rtol={rtol:g}", rtol)
            yield Case("gait", way.name, way.setting, _measuring(trade, way, store, quick))
    if quick:
        return
    for name, accuracy in jb.ACCURACIES.items():
        way = Way("rodas4", "lanes", name, accuracy.gait.rtol)
        yield Case("named gait", way.name, name, _measuring(trade, way, store, quick))
    seed = jb.seed_scene()
    rigid = GaitTrade(jb.RigidScene(walker=seed.walker, ground=seed.ground), repeats=5)

    def truth() -> Truth:
        def references() -> tuple[Any, Any]:
            ways = (Way(solver, "lanes", "", 1e-13) for solver in ("rodas5p", "rodas4p"))
            first, second = (rigid.values(way) for way in ways)
            return first, second

        return store.truth("rigid gait", references)

    for rtol in tolerances(False, -3, -10):
        way = Way("rodas5p", "lanes", f"rtol={rtol:g}", rtol)
        yield Case("rigid gait", way.name, way.setting, lambda way=way: rigid.row(way, truth()))


def cases_through_xla(store: Store, quick: bool) -> Iterator[Case]:
    """The same gait through XLA."""
    if quick:
        return
    trade = GaitTrade(jb.seed_scene(), repeats=3)
    for rtol in (1e-4, 1e-6, 1e-8):
        way = Way("rodas4", "xla", f"rtol={rtol:g}", rtol)
        yield Case("gait", way.name, way.setting, _measuring(trade, way, store, quick))


def _measuring(trade: GaitTrade, way: Way, store: Store, quick: bool) -> Callable[[], Row]:
    return lambda: trade.row(way, seed_truth(store, quick))


def stepping_cases(store: Store, quick: bool) -> Iterator[Case]:
    """A footstep from the gait's state with its derivatives, by each way of choosing steps."""
    if quick:
        return
    scene, start = jb.seed_scene(), {}

    def measure(stepping: str, rtol: float) -> Row:
        whole = seed_truth(store, quick)
        exact = {axis: whole.values[axis][:1] for axis in ("period", "gradient")}
        truth = truth_of(exact, {})
        if not start:
            start["exact"] = gradient_accuracy.exact_gait(scene, 1e-10)
        lands, heard = gradient_accuracy.STEPPINGS[stepping]
        tangents = 10.0 * rtol if heard else gradient_accuracy.UNHEARD
        found, work = work_of(
            lambda: gradient_accuracy.footstep(scene, start["exact"].start, lands, rtol, tangents),
            3,
        )
        slope = float(jb.gait.slopes_of(found).period[0]) / float(found.period)
        values = {"period": np.atleast_1d(found.period), "gradient": np.atleast_1d(slope)}
        steps = int(found.attempted)
        return row_of(stepping, f"rtol={rtol:g}", "ok", truth, values, work, attempted=steps)

    for stepping in STEPPINGS:
        for rtol in tolerances(False, -4, -8):
            how = lambda s=stepping, r=rtol: measure(s, r)  # noqa: E731
            yield Case("stepping", stepping, f"rtol={rtol:g}", how)
