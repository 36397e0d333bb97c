"""One simulation of two seconds on one core through XLA: time against error, beside other solvers.

Writes speed_single.png. Every method is compared at equal error, never at equal tolerance.
"""

# ruff: noqa: E402 (the core and the flags are settled before JAX is imported)
import os

import _cores

_cores.settle(1)
FLAGS = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {FLAGS}".strip()

import functools
import importlib.util
from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from _experiment import Options, experiment
from _pictures import label
from _timing import seconds_of, timed
from _walks import DURATION, walk_from
from reference.numbalsoda_solves import lsoda, lsoda_address
from reference.scipy_solves import FINEST, final_of

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

ERRORS = (1e-3, 1e-4, 1e-5, 1e-6)
OURS = ("rodas4", "rodas5p", "rodas4p", "rodas3p")
BEST = "rodas4"
FINE, COARSE = (-4, -9), (-3, -7)
"""Exponents of ten of the loosest and the tightest tolerance that suit a method."""


class Method(NamedTuple):
    """A solver made ready: `run(rtol)` gives a final state as 8 numbers, and attempted steps."""

    run: Callable[[float], tuple[Any, Any]]
    compile_seconds: float | None = None


@experiment
def main(options: Options):
    first = None if options.quick else first_compile()
    found = methods(options.quick)
    # A quick version compiles one program of ours, for everything.
    checked = found[BEST][0] if options.quick else found["rodas5p"][0]
    exact = final_of(DURATION, *FINEST)
    apart = np.max(np.abs(np.asarray(checked.run(1e-11)[0]) - exact))
    points = measured(found, exact, options.sized(7, 1))
    return {
        "first_compile_s": checked.compile_seconds if first is None else first,
        "compile_s": {name: m.compile_seconds for name, (m, _) in found.items() if m},
        "reference_difference": float(apart),
        "errors": list(ERRORS),
        "at_equal_error": at_equal_error(points),
        "not_installed": [name for name, (method, _) in found.items() if method is None],
        "points": points,
        "picture": draw(options, points),
    }


def in_jax(solve):
    """Compiles `solve(scene, state, rtol)`, apart from its runs."""
    arguments = jb.seed_scene(), jb.seed_state()
    program, seconds, _ = timed(lambda: jax.jit(solve).lower(*arguments, 1e-6).compile())
    return Method(
        lambda rtol: jax.block_until_ready(program(*arguments, jnp.asarray(rtol))), seconds
    )


def ours(name):
    def solve(scene, state, rtol):
        end = walk_from(state, rtol, scene=scene, solver=name, engine="xla")
        return jnp.stack(end.final), end.attempted

    return in_jax(solve)


def diffrax_plain(solver):
    """diffrax by itself: the state one vector, which suits its implicit solvers best."""

    def field(t, y, scene):
        return jnp.stack(jb.dynamics.vector_field(t, jb.State(*y), scene))

    def solve(scene, state, rtol):
        control = diffrax.PIDController(rtol=rtol, atol=1e-2 * rtol, dtmin=1e-12, force_dtmin=True)
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field), solver, t0=0.0, t1=DURATION, dt0=1e-5, y0=jnp.stack(state),
            args=scene, stepsize_controller=control, max_steps=65536, throw=False,
        )  # fmt: skip
        return solution.ys[-1], solution.stats["num_steps"]

    return in_jax(solve)


def scipy_lsoda():
    if importlib.util.find_spec("numba") is None:
        return None
    return Method(lambda rtol: (final_of(DURATION, rtol, method="LSODA"), None))


def compiled_lsoda():
    if lsoda_address() is None:
        return None
    return Method(lambda rtol: (lsoda(DURATION, rtol, 1e-2 * rtol), None))


def methods(quick):
    """Every method by name, with the tolerances that suit it; None where it is not installed."""
    chord = dict(root_finder=jb.solvers.SOLVERS["kvaerno3"]().root_finder)
    made = {name: (functools.partial(ours, name), FINE) for name in OURS}
    for name, solver, ends in (
        ("Kvaerno3", diffrax.Kvaerno3(), (-3, -8)),
        ("Kvaerno5", diffrax.Kvaerno5(), COARSE),
        ("Kvaerno3, Chord", diffrax.Kvaerno3(**chord), COARSE),
        ("Kvaerno5, Chord", diffrax.Kvaerno5(**chord), COARSE),
    ):
        made[name] = functools.partial(diffrax_plain, solver), (-3, -5) if quick else ends
    made |= {"SciPy LSODA": (scipy_lsoda, FINE), "numbalsoda": (compiled_lsoda, FINE)}
    step = 1.0 if quick else 0.5
    names = (BEST, "Kvaerno3", "SciPy LSODA", "numbalsoda") if quick else made
    found = {}
    for name in names:
        make, (first, last) = made[name]
        exponents = np.arange(first, last - 0.5 * step, -step)
        found[name] = make(), [float(10.0**each) for each in exponents]
    return found


def measured(found, exact, rounds):
    """Median times of runs that take turns, after one run each that does not count."""
    runs = {
        (name, rtol): functools.partial(method.run, rtol)
        for name, (method, tolerances) in found.items()
        if method
        for rtol in tolerances
    }
    ends = {name: run() for name, run in runs.items()}
    times = seconds_of(runs, rounds, warm=False)
    points = {name: [] for name in found}
    for (name, rtol), (state, steps) in ends.items():
        error = float(np.max(np.abs(np.asarray(state) - exact)))
        row = dict(rtol=rtol, seconds=times[name, rtol], error=error)
        points[name].append(row | {"steps": None if steps is None else int(steps)})
    return points


def time_at(points, error):
    """Time that buys an error, interpolated between logarithms; None outside what was measured.

    Between the points that no other point beats in both time and error.
    """
    front = []
    for point in sorted(points, key=lambda point: point["seconds"]):
        if not front or point["error"] < front[-1]["error"]:
            front.append(point)
    if not front or not front[-1]["error"] <= error <= front[0]["error"]:
        return None
    logs = (np.log([point[key] for point in front[::-1]]) for key in ("error", "seconds"))
    return float(np.exp(np.interp(np.log(error), *logs)))


def at_equal_error(points):
    """Times at each of the errors, and how many times those of the best."""
    times = {name: [time_at(row, error) for error in ERRORS] for name, row in points.items()}

    def scaled(row, units):
        pairs = zip(row, units, strict=True)
        return [None if t is None or unit is None else t / unit for t, unit in pairs]

    return {
        name: {"milliseconds": scaled(row, [1e-3] * len(ERRORS)), "ratio": scaled(row, times[BEST])}
        for name, row in times.items()
    }


def draw(options, points):
    figure = new_figure(7.5, 5.5)
    axes = figure.subplots()
    for name, row in points.items():
        style = "o-" if name in OURS else "s--" if "Kvaerno" in name else "^:"
        errors = [point["error"] for point in row]
        milliseconds = [1e3 * point["seconds"] for point in row]
        if row:
            axes.plot(errors, milliseconds, style, ms=4, label=name)
    title = f"{DURATION:g} simulated seconds of the seed's walker on one core"
    words = "largest error of the final state (SI units)", "time of one simulation [ms]"
    label(axes, *words, title, log="xy")
    axes.invert_xaxis()
    axes.legend(fontsize=8)
    return options.save(figure, "speed_single.png")


def first_compile():
    """Seconds that a first simulation takes to trace and to compile."""
    how = dict(duration=DURATION, save="end", engine="xla")
    request = jb.Simulation.prepare(jb.seed_scene(), jb.seed_state(), **how)
    return timed(request.compile)[1]


if __name__ == "__main__":
    main()
