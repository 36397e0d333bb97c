"""Cases of a trade study: the state after two seconds, by every way there is."""

import functools
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from _smoothed_laws import smoothed_seed
from _trade_store import Case, Store
from reference.numbalsoda_solves import lsoda, lsoda_address
from reference.scipy_solves import solution
from reference.walks import Walk
from reference.walks import walk as independent_walk

import jaxbiped as jb
from jaxbiped.trade import Row, Truth, WalkTrade, Way, failed_row, row_of, work_of

DURATION, QUICK_DURATION = 2.0, 0.45
FINEST = 1e-12
LANES = ("rodas4p", "rodas5p", "rodas4", "rodas3p")
THROUGH_XLA = ("rodas4p", "rodas4", "rodas5p", "kvaerno3", "kvaerno5", "tsit5", "dopri8")
PEERS = ("Radau", "BDF", "LSODA")
METHODS = ("index1", "baumgarte", "penalty")
FIXED_STEPS = (1e-4, 1e-5, 1e-6)
EXPLICIT = ("tsit5", "dopri8")


def walk_of(scene: jb.Scene, quick: bool) -> WalkTrade:
    return WalkTrade(
        scene, jb.seed_state(), QUICK_DURATION if quick else DURATION, repeats=1 if quick else 5
    )


def tolerances(quick: bool, first: int = -3, last: int = -10) -> list[float]:
    exponents = (-4, -6) if quick else range(first, last - 1, -1)
    return [float(f"1e{exponent}") for exponent in exponents]


def seed_truth(store: Store, quick: bool) -> Truth:
    """Ours at the finest tolerance; the floor by Radau and the independent equations."""
    walk = walk_of(jb.seed_scene(), quick)

    def references() -> tuple[Any, Any]:
        other = independent_walk(walk.duration, FINEST)
        state = {"state": other.state / walk.units()}
        return walk.truth().values, state | _books(walk, other)

    return store.truth("walk", references)


def _books(walk: WalkTrade, found: Walk) -> dict[str, np.ndarray]:
    energy = np.array(list(found.ledger.values()))
    return {"step_time": found.strikes / walk.time_unit(), "energy": energy}


def cases(store: Store, quick: bool) -> Iterator[Case]:
    """Of the seed's scene, its laws replaced, and its formulation."""
    seed = jb.seed_scene()
    truth = functools.partial(seed_truth, store, quick)
    walk = walk_of(seed, quick)
    for solver in LANES[: 2 if quick else None]:
        yield from _ours(walk, "walk", solver, "lanes", tolerances(quick), truth)
    for name, accuracy in jb.ACCURACIES.items():
        way = Way("rodas4p", "lanes", name, accuracy.walk)
        yield Case("named walk", way.name, name, lambda way=way: walk.row(way, truth()))
    for name in PEERS[:1] if quick else PEERS:
        for rtol in tolerances(quick, last=-9):
            how = functools.partial(_peer, walk, name, rtol, truth)
            yield Case("walk", f"SciPy {name}", f"rtol={rtol:g}", how)
    missing = functools.partial(failed_row, "numbalsoda", "rtol=1e-6", "not installed")
    if lsoda_address() is None:
        yield Case("walk", "numbalsoda", "rtol=1e-6", missing)
    else:
        for rtol in tolerances(quick, last=-9):
            how = functools.partial(_numbalsoda, walk, rtol, truth)
            yield Case("walk", "numbalsoda", f"rtol={rtol:g}", how)
    for dt in FIXED_STEPS[:1] if quick else FIXED_STEPS:
        how = functools.partial(_semi_implicit, walk, dt, truth)
        yield Case("walk", "semi-implicit Euler", f"dt={dt:g}", how)
    if not quick:
        yield from _laws(store)


def cases_through_xla(store: Store, quick: bool) -> Iterator[Case]:
    """Of diffrax's solvers, of ours through XLA, and of redundant coordinates: slow to compile."""
    if quick:
        return
    seed = jb.seed_scene()
    truth = functools.partial(seed_truth, store, quick)
    walk = walk_of(seed, quick)
    for solver in THROUGH_XLA:
        last = -9 if solver.startswith("rodas") else (-6 if solver in EXPLICIT else -7)
        yield from _ours(walk, "walk", solver, "xla", tolerances(quick, last=last), truth)
    for rtol in tolerances(quick, last=-6):
        how = functools.partial(_single_precision, walk, rtol, truth)
        yield Case("walk", "rodas4p in float32", f"rtol={rtol:g}", how)
    for method in METHODS:
        scene = jb.RedundantScene(seed, jb.constraints.CONSTRAINT_METHODS[method]())
        for rtol in (1e-4, 1e-6, 1e-8):
            how = functools.partial(_redundant, walk, scene, method, rtol, truth)
            yield Case("walk", f"{method}, redundant", f"rtol={rtol:g}", how)


def _ours(
    walk: WalkTrade,
    group: str,
    solver: str,
    engine: str,
    levels: list[float],
    truth: Callable[[], Truth],
) -> Iterator[Case]:
    for rtol in levels:
        way = Way(solver, engine, f"rtol={rtol:g}", rtol)
        yield Case(group, way.name, way.setting, lambda way=way: walk.row(way, truth()))


def _laws(store: Store) -> Iterator[Case]:
    """Other laws, each against its own truth: what they cost, not how far they are off."""
    wider = jb.seed_scene(v0=1e-3)
    for name, scene in (("smoothed laws", smoothed_seed()), ("v0 ten times wider", wider)):
        walk = walk_of(scene, quick=False)

        def truth(name: str = name, walk: WalkTrade = walk) -> Truth:
            def references() -> tuple[Any, Any]:
                pair = (Way(s, "lanes", "", FINEST) for s in ("rodas5p", "rodas4p"))
                first, second = (walk.values(way, books=True) for way in pair)
                return first, second

            return store.truth(name, references)

        yield from _ours(walk, name, "rodas4p", "lanes", tolerances(False), truth)


def _peer(walk: WalkTrade, name: str, rtol: float, truth: Callable[[], Truth]) -> Row:
    """By SciPy, the equations compiled with numba; rejected steps are not known.

    Heel strikes and energies are of a second solve with the powers beside the state.
    """
    run = functools.partial(solution, walk.duration, rtol, method=name)
    run()  # numba compiles apart
    found, work = work_of(run, walk.repeats)
    values = {"state": found.y[:, -1] / walk.units()}
    if found.success:
        values |= _books(walk, independent_walk(walk.duration, rtol, name))
    return row_of(
        f"SciPy {name}",
        f"rtol={rtol:g}",
        "ok" if found.success else "failed",
        truth(),
        values,
        work,
    )


def _numbalsoda(walk: WalkTrade, rtol: float, truth: Callable[[], Truth]) -> Row:
    found, work = work_of(lambda: lsoda(walk.duration, rtol, 1e-2 * rtol), walk.repeats)
    values = {"state": found / walk.units()}
    return row_of("numbalsoda", f"rtol={rtol:g}", "ok", truth(), values, work)


def _single_precision(walk: WalkTrade, rtol: float, truth: Callable[[], Truth]) -> Row:
    """In 32 bits, which lanes do not have."""
    start = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float32), walk.start)
    row = walk._replace(start=start).row(Way("rodas4p", "xla", f"rtol={rtol:g}", rtol), truth())
    return row._replace(way="rodas4p in float32")


def _semi_implicit(walk: WalkTrade, dt: float, truth: Callable[[], Truth]) -> Row:
    """Velocities by the accelerations, then positions by the new velocities, in equal steps."""
    steps = round(walk.duration / dt)
    program = jax.jit(functools.partial(_equal_steps, walk.scene, dt, steps))
    found, work = work_of(lambda: program(walk.start), walk.repeats)
    values = {"state": np.array([float(x) for x in found]) / walk.units()}
    return row_of("semi-implicit Euler", f"dt={dt:g}", "ok", truth(), values, work, attempted=steps)


def _equal_steps(scene: jb.Scene, dt: float, steps: int, start: jb.State) -> jb.State:
    names = jb.State._fields
    half = len(names) // 2

    def once(_: int, y: jb.State) -> jb.State:
        rates = jb.dynamics.vector_field(0.0, y, scene)
        speeds = [v + dt * a for v, a in zip(y[half:], rates[half:], strict=True)]
        places = [q + dt * v for q, v in zip(y[:half], speeds, strict=True)]
        return jb.State(*places, *speeds)

    return jax.lax.fori_loop(0, steps, once, start)


def _redundant(
    walk: WalkTrade,
    scene: jb.RedundantScene,
    method: str,
    rtol: float,
    truth: Callable[[], Truth],
) -> Row:
    request = jb.Simulation.prepare(
        scene, walk.start, duration=walk.duration, rtol=rtol, save="end", engine="xla"
    )
    found, work = work_of(request, walk.repeats)
    ending = str(found.outcome)
    minimal = jb.dynamics.minimal_state(scene, found.final)
    return row_of(
        f"{method}, redundant",
        f"rtol={rtol:g}",
        "ok" if ending == "walking" else ending,
        truth(),
        {"state": np.array([float(x) for x in minimal]) / walk.units()},
        work,
        attempted=int(found.attempted),
        rejected=int(found.rejected),
    )
