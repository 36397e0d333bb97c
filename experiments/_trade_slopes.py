"""Cases of a trade study: derivatives of the final state by log K, log c and log ξ, with peers."""

import functools
import math
from collections.abc import Callable, Iterator

import _casadi
import numpy as np
from _trade_store import Case, Store, not_installed
from _trade_walks import tolerances, walk_of
from _walks import slopes_and_end
from reference.compliant import SEED, numbers
from reference.scipy_solves import final_of

import jaxbiped as jb
from jaxbiped.trade import Row, Truth, row_of, work_of

FINEST, INDEPENDENT = 1e-11, 1e-12
STEP, REFERENCE_STEP = 1e-4, 3e-3
"""Of central differences, by the logarithm of a parameter."""
WAYS = (
    *(("rodas4p", "lanes"), ("rodas5p", "lanes"), ("rodas4", "lanes")),
    *(("rodas4p", "xla"), ("kvaerno5", "xla")),
)


def cases(store: Store, quick: bool) -> Iterator[Case]:
    """Ours with and without tangents in the error norm, diffrax, differences, CasADi's CVODES."""
    walk = walk_of(jb.seed_scene(), quick)
    duration, units = walk.duration, walk.units()[:, None]

    def truth() -> Truth:
        def references():
            ours = by_jacobian("rodas5p", "lanes", duration, FINEST)() / units
            return {"slopes": ours}, {"slopes": independent_slopes(duration) / units}

        return store.truth("slopes", references)

    def case(way: str, rtol: float, prepare: Callable[[], Callable[[], np.ndarray]]) -> Case:
        def measure() -> Row:
            found, work = work_of(prepare(), walk.repeats)
            return row_of(way, f"rtol={rtol:g}", "ok", truth(), {"slopes": found / units}, work)

        return Case("slopes", way, f"rtol={rtol:g}", measure)

    for solver, engine in WAYS[: 1 if quick else None]:
        name = f"{solver} ({engine})" + (", steps for the state alone" if engine == "xla" else "")
        for rtol in tolerances(quick, -3, -8):
            yield case(name, rtol, functools.partial(by_jacobian, solver, engine, duration, rtol))
    for rtol in tolerances(quick, -5, -10):
        yield case("SciPy LSODA, differences", rtol, functools.partial(differences, duration, rtol))
    if not _casadi.is_installed():
        yield not_installed("slopes", "CasADi CVODES")
        return
    for rtol in tolerances(quick, -3, -9):
        yield case("CasADi CVODES", rtol, functools.partial(by_casadi, duration, rtol))


def by_jacobian(solver, engine, duration, rtol):
    """Forward derivatives (8, 3) of a walk: by lanes with steps that heed them."""
    run = slopes_and_end(duration, solver=solver, engine=engine, atol=None)
    return lambda: run(rtol)[0]


def by_casadi(duration, rtol):
    run = _casadi.sensitivities(duration, rtol)
    return lambda: run()[1]


def differences(duration, rtol):
    """Central differences of second order."""
    at = functools.partial(_moved, "LSODA", duration, rtol)
    return lambda: np.stack([(at(k, STEP) - at(k, -STEP)) / (2 * STEP) for k in range(3)], axis=1)


def independent_slopes(duration):
    """Central differences of fourth order of Radau's walks at 1e-12."""
    columns, h = [], REFERENCE_STEP
    for k in range(3):
        at = functools.partial(_moved, "Radau", duration, INDEPENDENT, k)
        columns.append((8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h))
    return np.stack(columns, axis=1)


def _moved(method, duration, rtol, k, step):
    """The final state with one of K, c and ξ moved by a step of its logarithm."""
    name = ("K", "c", "xi")[k]
    moved = numbers(**{name: SEED[name] * math.exp(step)})
    return final_of(duration, rtol, method=method, p=moved)
