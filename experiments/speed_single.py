"""One simulation of two seconds on one core: time against error, beside other solvers.

Writes speed_single.png. Every method is compared at equal error, never at equal tolerance.
"""

# ruff: noqa: E402 (the core and the flags are settled before JAX is imported)
import os

CORES = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
if CORES:
    os.sched_setaffinity(0, CORES[-1:])
FLAGS = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {FLAGS}".strip()

import functools
import importlib.util
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from _options import Options, parse
from _timing import seconds_of
from reference.numbalsoda_solves import lsoda, lsoda_address
from reference.scipy_solves import FINEST, final_of

import jaxbiped as jb

DURATION = 2.0
ERRORS = (1e-3, 1e-4, 1e-5, 1e-6)
OURS = ("rodas4", "rodas5p", "rodas4p", "rodas3p")
BEST = "rodas4"
NOT_INSTALLED = "not installed"


class Method(NamedTuple):
    """A solver made ready: `run(rtol)` gives a final state as 8 numbers, and attempted steps."""

    run: Callable[[float], tuple[Any, Any]]
    compile_seconds: float | None


class Point(NamedTuple):
    """What was measured at one tolerance."""

    rtol: float
    seconds: float
    error: float
    steps: int | None


def tolerances(coarsest: float, finest: float, step: float = 0.5) -> list[float]:
    """From one exponent of ten to another, both included."""
    return [float(10.0**e) for e in np.arange(coarsest, finest - 0.5 * step, -step)]


def in_jax(solve: Callable[..., tuple[Any, Any]]) -> Method:
    """Compiles `solve(scene, state, rtol)`, apart from its runs."""
    arguments = jb.seed_scene(), jb.seed_state()
    began = time.perf_counter()
    program = jax.jit(solve).lower(*arguments, 1e-6).compile()
    compile_seconds = time.perf_counter() - began

    def run(rtol: float) -> tuple[Any, Any]:
        return jax.block_until_ready(program(*arguments, jnp.asarray(rtol)))

    return Method(run, compile_seconds)


def ours(name: str) -> Method:
    def solve(scene: jb.Scene, state: jb.State, rtol: Any) -> tuple[Any, Any]:
        options: dict[str, Any] = dict(solver=name, rtol=rtol, atol=1e-2 * rtol, save="end")
        end = jb.simulate(scene, state, duration=DURATION, **options)
        return jnp.stack(end.final), end.attempted

    return in_jax(solve)


def diffrax_plain(solver: diffrax.AbstractSolver) -> Method:
    """diffrax by itself: the state one vector, which suits its implicit solvers best."""

    def field(t: Any, y: Any, scene: jb.Scene) -> Any:
        return jnp.stack(jb.dynamics.vector_field(t, jb.State(*y), scene))

    def solve(scene: jb.Scene, state: jb.State, rtol: Any) -> tuple[Any, Any]:
        control = diffrax.PIDController(rtol=rtol, atol=1e-2 * rtol, dtmin=1e-12, force_dtmin=True)
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field),
            solver,
            t0=0.0,
            t1=DURATION,
            dt0=1e-5,
            y0=jnp.stack(state),
            args=scene,
            stepsize_controller=control,
            max_steps=65536,
            throw=False,
        )
        return solution.ys[-1], solution.stats["num_steps"]

    return in_jax(solve)


def methods(quick: bool) -> dict[str, tuple[Method | None, list[float]]]:
    """Every method by name, with the tolerances that suit it; None where it is not installed."""
    chord = jb.solvers.SOLVERS["kvaerno3"]().root_finder
    fine, coarse = (-4, -9), (-3, -7)
    if quick:
        return {
            BEST: (ours(BEST), tolerances(*fine, step=1.0)),
            "Kvaerno3": (diffrax_plain(diffrax.Kvaerno3()), tolerances(-3, -5, step=1.0)),
            "SciPy LSODA": (scipy_lsoda(), tolerances(*fine, step=1.0)),
            "numbalsoda": (compiled_lsoda(), tolerances(*fine, step=1.0)),
        }
    found: dict[str, tuple[Method | None, list[float]]] = {}
    for name in OURS:
        found[name] = ours(name), tolerances(*fine)
    found |= {
        "Kvaerno3": (diffrax_plain(diffrax.Kvaerno3()), tolerances(-3, -8)),
        "Kvaerno5": (diffrax_plain(diffrax.Kvaerno5()), tolerances(*coarse)),
        "Kvaerno3, Chord": (
            diffrax_plain(diffrax.Kvaerno3(root_finder=chord)),
            tolerances(*coarse),
        ),
        "Kvaerno5, Chord": (
            diffrax_plain(diffrax.Kvaerno5(root_finder=chord)),
            tolerances(*coarse),
        ),
    }
    found["SciPy LSODA"] = scipy_lsoda(), tolerances(*fine)
    found["numbalsoda"] = compiled_lsoda(), tolerances(*fine)
    return found


def scipy_lsoda() -> Method | None:
    if importlib.util.find_spec("numba") is None:
        return None
    return Method(lambda rtol: (final_of(DURATION, rtol, method="LSODA"), None), None)


def compiled_lsoda() -> Method | None:
    if lsoda_address() is None:
        return None
    return Method(lambda rtol: (lsoda(DURATION, rtol, 1e-2 * rtol), None), None)


def measured(
    found: dict[str, tuple[Method | None, list[float]]], exact: np.ndarray, rounds: int
) -> dict[str, list[Point]]:
    """Median times of runs that take turns, after one run each that does not count."""
    cases = [(name, m, rtol) for name, (m, levels) in found.items() if m for rtol in levels]
    ends = [method.run(rtol) for _, method, rtol in cases]
    runs = {i: functools.partial(method.run, rtol) for i, (_, method, rtol) in enumerate(cases)}
    times = seconds_of(runs, rounds, warm=False)
    points: dict[str, list[Point]] = {name: [] for name in found}
    for (name, _, rtol), (state, steps), seconds in zip(cases, ends, times.values(), strict=True):
        error = float(np.max(np.abs(np.asarray(state) - exact)))
        count = None if steps is None else int(steps)
        points[name].append(Point(rtol, float(seconds), error, count))
    return points


def time_at(points: list[Point], error: float) -> float | None:
    """Time that buys an error, interpolated between logarithms; None outside what was measured.

    Between the points that no other point beats in both time and error.
    """
    front: list[Point] = []
    for point in sorted(points, key=lambda p: p.seconds):
        if not front or point.error < front[-1].error:
            front.append(point)
    if not front or not front[-1].error <= error <= front[0].error:
        return None
    front.reverse()
    log_errors, log_times = np.log([p.error for p in front]), np.log([p.seconds for p in front])
    return float(np.exp(np.interp(np.log(error), log_errors, log_times)))


def picture(options: Options, points: dict[str, list[Point]]) -> None:
    figure, axes = plt.subplots(figsize=(7.5, 5.5), layout="constrained")
    for name, row in points.items():
        if row:
            style = "o-" if name in OURS else "s--" if "Kvaerno" in name else "^:"
            axes.loglog(
                [p.error for p in row], [1e3 * p.seconds for p in row], style, ms=4, label=name
            )
    axes.invert_xaxis()
    axes.set_xlabel("largest error of the final state (SI units)")
    axes.set_ylabel("time of one simulation [ms]")
    axes.set_title(f"{DURATION:g} simulated seconds of the seed's walker on one core")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    options.save(figure, "speed_single.png")


def cell(value: float | None, form: str) -> str:
    return "–" if value is None else format(value, form)


def report(options: Options, points: dict[str, list[Point]], at: dict[str, Any]) -> None:
    rows = [{"method": name} | p._asdict() for name, row in points.items() for p in row]
    options.table(rows, method="", rtol=".1e", error=".1e", seconds=".2e", steps="d")
    for name in (name for name, row in points.items() if not row):
        options.say(f"{name}: {NOT_INSTALLED}")
    options.say(f"\nTime at equal error [ms] (and how many times that of {BEST})")
    options.say(f"{'method':17}" + "".join(f"{error:>18.0e}" for error in ERRORS))
    for name, row in at.items():
        texts = [
            "–" if ms is None else f"{ms:.2f} ({cell(ratio, '.2f')})"
            for ms, ratio in zip(row["milliseconds"], row["ratio"], strict=True)
        ]
        options.say(f"{name:17}" + "".join(f"{text:>18}" for text in texts))


def at_equal_error(points: dict[str, list[Point]]) -> dict[str, Any]:
    best = [time_at(points[BEST], error) for error in ERRORS]
    table = {}
    for name, row in points.items():
        times = [time_at(row, error) for error in ERRORS]
        table[name] = {
            "milliseconds": [None if t is None else 1e3 * t for t in times],
            "ratio": [
                None if t is None or b is None else t / b for t, b in zip(times, best, strict=True)
            ],
        }
    return table


def first_compile() -> float:
    """Seconds that a first simulation takes to trace and to compile."""
    began = time.perf_counter()
    request = jb.Simulation.prepare(
        jb.seed_scene(), jb.seed_state(), duration=DURATION, save="end", engine="xla"
    )
    request.compile()
    return time.perf_counter() - began


def main() -> None:
    options = parse(__doc__ or "")
    first = None if options.quick else first_compile()
    found = methods(options.quick)
    # A quick version compiles one program of ours, for everything.
    witness = BEST if options.quick else "rodas5p"
    checked = found[BEST][0] if options.quick else ours(witness)
    first = checked.compile_seconds if first is None else first
    options.say(f"Compiling a first simulation (tracing and XLA): {first:.2f} s\n")
    exact = final_of(DURATION, *FINEST)
    check = np.max(np.abs(np.asarray(checked.run(1e-11)[0]) - exact))
    points = measured(found, exact, 1 if options.quick else 7)
    at = at_equal_error(points)
    report(options, points, at)
    options.say(f"\nThe reference and {witness} at a tolerance of 1e-11 differ by {check:.1e}")
    picture(options, points)
    options.finish(
        {
            "first_compile_s": first,
            "compile_s": {name: m.compile_seconds for name, (m, _) in found.items() if m},
            "reference_difference": float(check),
            "errors": list(ERRORS),
            "at_equal_error": at,
            "not_installed": [name for name, (m, _) in found.items() if m is None],
            "points": {name: [p._asdict() for p in row] for name, row in points.items()},
        }
    )


if __name__ == "__main__":
    main()
