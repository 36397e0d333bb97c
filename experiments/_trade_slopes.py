"""Cases of a trade study: derivatives of the final state by log K, log c and log ξ, with peers."""

import functools
import math
from collections.abc import Callable, Iterator
from typing import Any

import _casadi
import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from _trade_store import Case, Store
from _trade_walks import tolerances, walk_of
from reference.compliant import SEED, numbers
from reference.scipy_solves import final_of

import jaxbiped as jb
from jaxbiped.trade import Row, Truth, failed_row, row_of, work_of

FINEST, INDEPENDENT = 1e-11, 1e-12
STEP, REFERENCE_STEP = 1e-4, 3e-3
"""Of central differences, by the logarithm of a parameter."""


def cases(store: Store, quick: bool) -> Iterator[Case]:
    """Ours with and without tangents in the error norm, diffrax, differences, CasADi's CVODES."""
    walk = walk_of(jb.seed_scene(), quick)
    duration, units = walk.duration, walk.units()[:, None]

    def truth() -> Truth:
        def references() -> tuple[Any, Any]:
            ours = by_jacobian("rodas5p", "lanes", duration, FINEST)() / units
            return {"slopes": ours}, {"slopes": independent_slopes(duration) / units}

        return store.truth("slopes", references)

    def case(way: str, rtol: float, prepare: Callable[[], Callable[[], np.ndarray]]) -> Case:
        def measure() -> Row:
            found, work = work_of(prepare(), walk.repeats)
            return row_of(way, f"rtol={rtol:g}", "ok", truth(), {"slopes": found / units}, work)

        return Case("slopes", way, f"rtol={rtol:g}", measure)

    ways = (
        *(("rodas4p", "lanes"), ("rodas5p", "lanes"), ("rodas4", "lanes")),
        *(("rodas4p", "xla"), ("kvaerno5", "xla")),
    )
    for solver, engine in ways[: 1 if quick else None]:
        name = f"{solver} by {engine}" + (", steps for the state alone" if engine == "xla" else "")
        for rtol in tolerances(quick, -3, -8):
            yield case(name, rtol, functools.partial(by_jacobian, solver, engine, duration, rtol))
    for rtol in tolerances(quick, -5, -10):
        yield case("SciPy LSODA, differences", rtol, functools.partial(differences, duration, rtol))
    if not _casadi.is_installed():
        missing = functools.partial(failed_row, "CasADi CVODES", "rtol=1e-6", "not installed")
        yield Case("slopes", "CasADi CVODES", "rtol=1e-6", missing)
        return
    for rtol in tolerances(quick, -3, -9):
        yield case("CasADi CVODES", rtol, functools.partial(by_casadi, duration, rtol))


def by_jacobian(solver: str, engine: str, duration: float, rtol: float) -> Callable[[], np.ndarray]:
    """Forward derivatives (8, 3) of a walk: by lanes with steps that heed them."""
    slopes, zeros = jacobian_of(solver, engine, duration), [jnp.asarray(0.0)] * 3
    return lambda: np.stack(slopes(zeros, jnp.asarray(rtol)), axis=1)


@functools.cache
def jacobian_of(solver: str, engine: str, duration: float) -> Callable[..., Any]:
    """The compiled derivative by the logarithms of K, c and ξ, at any tolerance."""
    scene, state = jb.seed_scene(), jb.seed_state()
    leaves = (scene.normal.K, scene.normal.c, scene.friction.xi)

    def final(logs: Any, rtol: Any) -> Any:
        moved = [leaf * jnp.exp(log) for leaf, log in zip(leaves, logs, strict=True)]
        new = eqx.tree_at(lambda s: (s.normal.K, s.normal.c, s.friction.xi), scene, moved)
        how: dict[str, Any] = dict(solver=solver, rtol=rtol, save="end", engine=engine)
        if engine == "xla":
            how["adjoint"] = diffrax.ForwardMode()
        return jnp.stack(jb.simulate(new, state, duration=duration, **how).final)

    return jax.jit(jax.jacfwd(final))


def by_casadi(duration: float, rtol: float) -> Callable[[], np.ndarray]:
    run = _casadi.sensitivities(duration, rtol)
    return lambda: run()[1]


def differences(duration: float, rtol: float) -> Callable[[], np.ndarray]:
    """Central differences of second order."""

    def run() -> np.ndarray:
        columns = [
            (_moved("LSODA", duration, rtol, k, STEP) - _moved("LSODA", duration, rtol, k, -STEP))
            / (2 * STEP)
            for k in range(3)
        ]
        return np.stack(columns, axis=1)

    return run


def independent_slopes(duration: float) -> np.ndarray:
    """Central differences of fourth order of Radau's walks at 1e-12."""
    columns = []
    for k in range(3):
        at = functools.partial(_moved, "Radau", duration, INDEPENDENT, k)
        h = REFERENCE_STEP
        columns.append((8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h))
    return np.stack(columns, axis=1)


def _moved(method: str, duration: float, rtol: float, k: int, step: float) -> np.ndarray:
    """The final state with one of K, c and ξ moved by a step of its logarithm."""
    name = ("K", "c", "xi")[k]
    moved = numbers(**{name: SEED[name] * math.exp(step)})
    return final_of(duration, rtol, method=method, p=moved)
