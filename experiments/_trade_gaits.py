"""Cases of a trade study: period, largest multiplier and the period's gradient."""

import functools
from collections.abc import Iterator

import gradient_accuracy
import numpy as np
from _scenes import rigid_seed
from _trade_store import Case, Store
from _trade_walks import tolerances
from reference.compliant import numbers
from reference.footstep import by_logarithms, gait

import jaxbiped as jb
from jaxbiped.trade import GaitTrade, Row, Truth, Way, row_of, truth_of, work_of

FINEST = 1e-11
SOLVERS = ("rodas4", "rodas5p")
QUICK_REFERENCES = (1e-9, 1e-8)


def seed_truth(store: Store, quick: bool) -> Truth:
    """Ours at the finest tolerance; the floor by independent equations and collocation.

    The quick one's floor is by the same method, so that nothing more is compiled.
    """
    trade = GaitTrade(jb.seed_scene())

    def references():
        if quick:
            return [trade.values(Way("rodas4", "lanes", "", rtol)) for rtol in QUICK_REFERENCES]
        way = Way("rodas5p", "lanes", "", FINEST)
        state = np.array([float(x) for x in trade.find(way).measures.state])
        seed = numbers()
        found = gait(state[1:], seed, by_logarithms(seed, ("K", "c", "xi")))
        measures = {"period": found.measures[:1], "multiplier": np.array([found.radius])}
        return trade.values(way), measures | {"gradient": found.elasticities}

    return store.truth("gait", references)


def rigid_truth(store: Store, trade: GaitTrade) -> Truth:
    """The rigid walker's own, by two methods."""
    ways = (Way(solver, "lanes", "", 1e-13) for solver in ("rodas5p", "rodas4p"))
    return store.truth("rigid gait", lambda: [trade.values(way) for way in ways])


def cases(store: Store, quick: bool) -> Iterator[Case]:
    """Of the seed's gait, and of the rigid walker's against a truth of its own."""
    trade = GaitTrade(jb.seed_scene(), repeats=1 if quick else 5)
    truth = functools.partial(seed_truth, store, quick)
    for solver in SOLVERS[: 1 if quick else None]:
        for rtol in tolerances(quick, -3, -9):
            yield _case("gait", trade, Way(solver, "lanes", f"rtol={rtol:g}", rtol), truth)
    if quick:
        return
    for name, accuracy in jb.ACCURACIES.items():
        yield _case("named gait", trade, Way("rodas4", "lanes", name, accuracy.gait.rtol), truth)
    rigid = GaitTrade(rigid_seed(), repeats=5)
    truth = functools.partial(rigid_truth, store, rigid)
    for rtol in tolerances(False, -3, -10):
        yield _case("rigid gait", rigid, Way("rodas5p", "lanes", f"rtol={rtol:g}", rtol), truth)


def cases_through_xla(store: Store, quick: bool) -> Iterator[Case]:
    """The same gait through XLA."""
    trade = GaitTrade(jb.seed_scene(), repeats=3)
    truth = functools.partial(seed_truth, store, quick)
    for rtol in () if quick else (1e-4, 1e-6, 1e-8):
        yield _case("gait", trade, Way("rodas4", "xla", f"rtol={rtol:g}", rtol), truth)


def _case(group, trade, way, truth) -> Case:
    return Case(group, way.name, way.setting, lambda: trade.row(way, truth()))


def stepping_cases(store: Store, quick: bool) -> Iterator[Case]:
    """A footstep from the gait's state with its derivatives, by each way of choosing steps."""
    scene = jb.seed_scene()

    @functools.cache
    def start() -> jb.State:
        return gradient_accuracy.exact_gait(scene, 1e-10).start

    def measure(stepping: str, rtol: float) -> Row:
        whole = seed_truth(store, quick)
        truth = truth_of({axis: whole.values[axis][:1] for axis in ("period", "gradient")}, {})
        run = functools.partial(gradient_accuracy.footstep_by, stepping, scene, start(), rtol)
        found, work = work_of(run, 3)
        slope = gradient_accuracy.slope_of(found) / float(found.period)
        values = {"period": np.atleast_1d(found.period), "gradient": np.atleast_1d(slope)}
        told = stepping, f"rtol={rtol:g}", "ok", truth, values, work
        return row_of(*told, attempted=int(found.attempted))

    for stepping in () if quick else gradient_accuracy.STEPPINGS:
        for rtol in tolerances(False, -4, -8):
            how = functools.partial(measure, stepping, rtol)
            yield Case("stepping", stepping, f"rtol={rtol:g}", how)
