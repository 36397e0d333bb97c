"""Cases of a trade study: the state after two seconds by every way, of one walk and of many."""

import functools
from collections.abc import Callable, Iterator

import jax
import jax.numpy as jnp
import numpy as np
from _scenes import SMOOTH, seed_with
from _trade_store import Case, Store, not_installed
from _walks import perturbed, walk_from
from reference.numbalsoda_solves import lsoda, lsoda_address, lsoda_batch
from reference.scipy_solves import final_of, solution
from reference.walks import walk as independent_walk

import jaxbiped as jb
from jaxbiped.trade import Row, Truth, WalkTrade, Way, row_of, work_of

DURATION, QUICK_DURATION = 2.0, 0.45
FINEST = 1e-12
LANES = ("rodas4p", "rodas5p", "rodas4", "rodas3p")
THROUGH_XLA = ("rodas4p", "rodas4", "rodas5p", "kvaerno3", "kvaerno5", "tsit5", "dopri8")
PEERS = ("Radau", "BDF", "LSODA")
METHODS = ("index1", "baumgarte", "penalty")
BATCH, QUICK_BATCH = 4096, 64
CHECKED, QUICK_CHECKED = 8, 2
"""Walks of the batch whose errors are looked at."""
BATCHED = (("rodas4p", "lanes"), ("rodas5p", "lanes"), ("rodas4", "lanes"), ("rodas4p", "xla"))
FIXED_STEPS = (1e-4, 1e-5, 1e-6)
EXPLICIT = ("tsit5", "dopri8")
Known = Callable[[], Truth]


def walk_of(scene: jb.Scene, quick: bool) -> WalkTrade:
    """The walk whose errors are measured, which a quick study cuts short."""
    duration, repeats = (QUICK_DURATION, 1) if quick else (DURATION, 5)
    return WalkTrade(scene, jb.seed_state(), duration, repeats=repeats)


def tolerances(quick: bool, first: int = -3, last: int = -10) -> list[float]:
    """Powers of ten, both ends included."""
    exponents = (-4, -6) if quick else range(first, last - 1, -1)
    return [float(f"1e{exponent}") for exponent in exponents]


def seed_truth(store: Store, quick: bool) -> Truth:
    """Ours at the finest tolerance; the floor by Radau and the independent equations."""
    walk = walk_of(jb.seed_scene(), quick)

    def references():
        other = independent_walk(walk.duration, FINEST)
        return walk.truth().values, {"state": other.state / walk.units()} | _books(walk, other)

    return store.truth("walk", references)


def _books(walk, found):
    energy = np.array(list(found.ledger.values()))
    return {"step_time": found.strikes / walk.time_unit(), "energy": energy}


def cases(store: Store, quick: bool) -> Iterator[Case]:
    """Of the seed's scene, its laws replaced, and its formulation."""
    walk = walk_of(jb.seed_scene(), quick)
    truth = functools.partial(seed_truth, store, quick)
    for solver in LANES[: 2 if quick else None]:
        yield from _ours(walk, "walk", solver, "lanes", tolerances(quick), truth)
    for name, accuracy in jb.ACCURACIES.items():
        way = Way("rodas4p", "lanes", name, accuracy.walk)
        yield Case("named walk", way.name, name, lambda way=way: walk.row(way, truth()))
    others = [(f"SciPy {name}", _peer(name)) for name in (PEERS[:1] if quick else PEERS)]
    if lsoda_address() is None:
        yield not_installed("walk", "numbalsoda")
    else:
        others.append(("numbalsoda", _numbalsoda))
    for name, solve in others:
        for rtol in tolerances(quick, last=-9):
            yield _case(walk, name, f"rtol={rtol:g}", solve, rtol, truth)
    for dt in FIXED_STEPS[:1] if quick else FIXED_STEPS:
        yield _case(walk, "semi-implicit Euler", f"dt={dt:g}", _semi_implicit, dt, truth)
    if not quick:
        yield from _laws(store)


def cases_through_xla(store: Store, quick: bool) -> Iterator[Case]:
    """Of diffrax's solvers, of ours through XLA, and of redundant coordinates: slow to compile."""
    if quick:
        return
    walk = walk_of(jb.seed_scene(), quick)
    truth = functools.partial(seed_truth, store, quick)
    for solver in THROUGH_XLA:
        last = -9 if solver.startswith("rodas") else (-6 if solver in EXPLICIT else -7)
        yield from _ours(walk, "walk", solver, "xla", tolerances(quick, last=last), truth)
    name = "rodas4p in float32"
    # In 32 bits, which lanes do not have.
    narrow = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float32), walk.start)
    for rtol in tolerances(quick, last=-6):
        way = Way("rodas4p", "xla", f"rtol={rtol:g}", rtol)

        def single(way: Way = way) -> Row:
            return walk._replace(start=narrow).row(way, truth())._replace(way=name)

        yield Case("walk", name, way.setting, single)
    for method in METHODS:
        for rtol in (1e-4, 1e-6, 1e-8):
            solve = _redundant(method)
            yield _case(walk, f"{method}, redundant", f"rtol={rtol:g}", solve, rtol, truth)


def _case(walk: WalkTrade, way: str, setting: str, solve: Callable, size: float, truth: Known):
    """A case whose `solve(walk, size)` gives a state, more values, work, and counts of the row."""

    def measure() -> Row:
        state, more, work, counts = solve(walk, size)
        values = {"state": np.array([float(x) for x in state]) / walk.units()} | more
        outcome = counts.pop("outcome", "ok")
        return row_of(way, setting, outcome, truth(), values, work, **counts)

    return Case("walk", way, setting, measure)


def _ours(walk, group, solver, engine, levels, truth) -> Iterator[Case]:
    for rtol in levels:
        way = Way(solver, engine, f"rtol={rtol:g}", rtol)
        yield Case(group, way.name, way.setting, lambda way=way: walk.row(way, truth()))


def _laws(store: Store) -> Iterator[Case]:
    """Other laws, each against its own truth: what they cost, not how far they are off."""
    scenes = {"smoothed laws": seed_with(**SMOOTH), "v0 ten times wider": jb.seed_scene(v0=1e-3)}
    for name, scene in scenes.items():
        walk = walk_of(scene, quick=False)

        def references(walk: WalkTrade = walk):
            pair = (Way(s, "lanes", "", FINEST) for s in ("rodas5p", "rodas4p"))
            return tuple(walk.values(way, books=True) for way in pair)

        truth = functools.partial(store.truth, name, references)
        yield from _ours(walk, name, "rodas4p", "lanes", tolerances(False), truth)


def _peer(name: str) -> Callable:
    """By SciPy, the equations compiled with numba; rejected steps are not known.

    Heel strikes and energies are of a second solve with the powers beside the state.
    """

    def solve(walk: WalkTrade, rtol: float):
        found, work = work_of(lambda: solution(walk.duration, rtol, method=name), walk.repeats)
        if not found.success:
            return found.y[:, -1], {}, work, {"outcome": "failed"}
        return found.y[:, -1], _books(walk, independent_walk(walk.duration, rtol, name)), work, {}

    return solve


def _numbalsoda(walk: WalkTrade, rtol: float):
    found, work = work_of(lambda: lsoda(walk.duration, rtol, 1e-2 * rtol), walk.repeats)
    return found, {}, work, {}


def _semi_implicit(walk: WalkTrade, dt: float):
    """Velocities by the accelerations, then positions by the new velocities, in equal steps."""
    steps, half = round(walk.duration / dt), len(jb.State._fields) // 2

    def once(_: int, y: jb.State) -> jb.State:
        rates = jb.dynamics.vector_field(0.0, y, walk.scene)
        speeds = [v + dt * a for v, a in zip(y[half:], rates[half:], strict=True)]
        places = [q + dt * v for q, v in zip(y[:half], speeds, strict=True)]
        return jb.State(*places, *speeds)

    program = jax.jit(functools.partial(jax.lax.fori_loop, 0, steps, once))
    found, work = work_of(lambda: program(walk.start), walk.repeats)
    return found, {}, work, {"attempted": steps}


def _redundant(method: str) -> Callable:
    """In redundant coordinates, the hip held by a method."""

    def solve(walk: WalkTrade, rtol: float):
        scene = jb.RedundantScene(walk.scene, jb.constraints.CONSTRAINT_METHODS[method]())
        how = dict(duration=walk.duration, rtol=rtol, save="end", engine="xla")
        found, work = work_of(jb.Simulation.prepare(scene, walk.start, **how), walk.repeats)
        counts = {"attempted": int(found.attempted), "rejected": int(found.rejected)}
        ending = str(found.outcome)
        counts["outcome"] = "ok" if ending == "walking" else ending
        return jb.dynamics.minimal_state(scene, found.final), {}, work, counts

    return solve


def batch_cases(store: Store, quick: bool) -> Iterator[Case]:
    """By lanes and through XLA; errors are the largest of the walks that are looked at."""
    count, checked = (QUICK_BATCH, QUICK_CHECKED) if quick else (BATCH, CHECKED)
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

    for solver, engine in BATCHED[: 1 if quick else None]:
        for rtol in tolerances(quick, -3, -8) if engine == "lanes" else (1e-4, 1e-6):
            how = functools.partial(measure, solver, engine, rtol)
            yield Case("batch", f"{solver} ({engine})", f"rtol={rtol:g}", how)
    if lsoda_address() is None:
        yield not_installed("batch", "numbalsoda")
        return
    for rtol in tolerances(quick, -3, -8):
        how = functools.partial(measure_peer, rtol)
        yield Case("batch", "numbalsoda", f"rtol={rtol:g}", how)
