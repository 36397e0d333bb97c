"""What each way to hold the hip costs for its accuracy, and what its constants do.

Error against the minimal formulation over cost, every method × integrator × tolerance; maps of
Baumgarte's a and b and of the penalty's A, ω and ζ; and each method's time beside the standard
one's, for one walk and in a batch.
"""

import json
import subprocess
import sys

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from _constraint_runs import FLOOR, METHODS, Integrator, relative_costs, truth_of
from _experiment import Options, by, draw_by, experiment, label

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
STEPS = (1e-4, 1e-5, 1e-6)
DURATION, QUICK_DURATION = 1.0, 0.1
COUNT, QUICK_COUNT = 9, 3
"""Values of each constant in a map."""
MAPS = {
    "baumgarte": (("a (1/s)", (-1.0, 5.0)), ("b (1/s)", (-1.0, 5.0)),
                  lambda a, b: jb.constraints.Baumgarte(a=a, b=b)),
    "penalty": (("A (kg)", (1.0, 11.0)), ("ω (1/s)", (-1.0, 4.0)),
                lambda A, omega: jb.constraints.Penalty(A=A, omega=omega)),
    "damping": (("ζ", (-2.0, 2.0)), ("ω (1/s)", (-1.0, 4.0)),
                lambda zeta, omega: jb.constraints.Penalty(omega=omega, zeta=zeta)),
}  # fmt: skip
"""Constants in rows and in columns, with the exponents of ten between which they lie."""
COSTED = Integrator("rodas4", rtol=1e-6), dict(single=2.0, batch=0.4408, count=1024, turns=7)
QUICK_COSTED = Integrator("euler", dt=1e-5), dict(single=2e-3, batch=2e-4, count=8, turns=3)


@experiment
def main(options: Options):
    scene, duration = jb.seed_scene(), options.sized(DURATION, QUICK_DURATION)
    methods = options.sized(METHODS, ("standard", "index1"))
    rosenbrock = [f"rodas4:{rtol!r}" for rtol in TOLERANCES]
    euler, runge = ([f"{name}:dt={dt!r}" for dt in STEPS] for name in ("euler", "runge2"))
    runs = compared(methods, options.sized([*rosenbrock, *euler, *runge], euler[1:]), duration)
    names = options.sized(list(MAPS), ["baumgarte"])
    maps = {name: mapped(options, scene, duration, *MAPS[name]) for name in names}
    how, size = options.sized(COSTED, QUICK_COSTED)
    return {
        "duration_s": duration,
        "runs": runs,
        "maps": maps,
        "least_errors": {name: least_error(found) for name, found in maps.items()},
        "costs": relative_costs(scene, methods, how, **size),
        "pictures": [draw_trade(options, runs), draw_maps(options, maps)],
    }


def compared(methods, integrators, duration):
    """The runs of `jaxbiped constraints`; an error that is no number is None."""
    command = [sys.executable, "-m", "jaxbiped", "constraints", "--json", "-", "--repeats", "1"]
    command += ["--duration", repr(duration), "--methods", *methods, "--integrators", *integrators]
    found = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True)
    return json.loads(found.stdout)["runs"]


def mapped(options, scene, duration, rows, columns, method):
    """Violation, error and steps over two constants of a method, each entry a list of rows."""
    truth = jnp.asarray(truth_of(scene, duration))
    how = options.sized(dict(rtol=1e-6), dict(solver="euler", dt=1e-5))
    how |= dict(save="end", watch=(), extremes=jb.dynamics.violation, max_solver_steps=1 << 16)
    row, column = (
        np.logspace(*ends, options.sized(COUNT, QUICK_COUNT)) for _, ends in (rows, columns)
    )
    pairs = [jnp.asarray(each.ravel()) for each in np.meshgrid(row, column, indexing="ij")]

    @eqx.filter_jit
    @jax.vmap
    def every(method):
        held = jb.RedundantScene(scene, method)
        walk = jb.simulate(held, jb.seed_state(), duration=duration, **how)
        end = jb.dynamics.minimal_state(held, jax.tree.map(lambda leaf: leaf[0], walk.state))
        error = jnp.max(jnp.abs(jnp.stack(list(end)) - truth))
        return walk.highest.position, error, walk.attempted, walk.ending

    shape = (len(row), len(column))
    found = (np.asarray(leaf).reshape(shape) for leaf in every(jax.vmap(method)(*pairs)))
    position, error, steps, ending = found
    good = (ending == 0) & np.isfinite(error)

    def told(values):
        known = good & np.isfinite(values)
        return np.where(known, values.astype(object), None).tolist()

    return {
        "rows": rows[0], "columns": columns[0], "row": row.tolist(), "column": column.tolist(),
        "max_violation_m": told(position), "state_error": told(error), "steps": steps.tolist(),
        "failed": (~good).tolist(),
    }  # fmt: skip


def least_error(found):
    """Where a map has its least error, and how many runs failed."""
    error = np.array(found["state_error"], dtype=float)
    if not np.isfinite(error).any():
        return {"failed": error.size}
    i, j = np.unravel_index(np.nanargmin(error), error.shape)
    at = {found["rows"]: found["row"][i], found["columns"]: found["column"][j]}
    return {"error": float(error[i, j]), "failed": int(np.sum(found["failed"])), **at}


def draw_trade(options, runs):
    """A panel for each integrator, by each method."""
    groups = by("integrator", runs)
    figure = new_figure(3.6 * max(len(groups), 2), 3.8)
    axes = figure.subplots(1, len(groups), sharey=True, squeeze=False)[0]
    for ax, (integrator, own) in zip(axes, groups.items(), strict=True):
        known = [run for run in own if run["state_error"] is not None]
        draw_by(ax, "method", known, "wall_s_run", "state_error")
        label(ax, "time of a run (s)", "error of the state (SI)", integrator, log="xy")
        ax.label_outer()
    named = axes[0].get_legend_handles_labels()
    figure.legend(*named, loc="outside lower center", ncols=4, frameon=False)
    return options.save(figure, "trade.png")


def edges_of(values):
    """Edges half way between values, on a logarithmic axis."""
    logs = np.log10(values)
    half = 0.5 * (logs[1] - logs[0])
    return 10.0 ** np.append(logs - half, logs[-1] + half)


def draw_maps(options, maps):
    shown = {"max_violation_m": "largest violation (m)", "state_error": "error of the state (SI)"}
    figure = new_figure(3.9 * len(maps), 6.4)
    axes = figure.subplots(2, len(maps), squeeze=False)
    for column, (name, found) in zip(axes.T, maps.items(), strict=True):
        for ax, (key, title) in zip(column, shown.items(), strict=True):
            values = np.log10(np.maximum(np.array(found[key], dtype=float), FLOOR))
            edges = edges_of(found["column"]), edges_of(found["row"])
            image = ax.pcolormesh(*edges, values, cmap="viridis")
            ax.set_facecolor("#BBBBBB")  # where a run failed
            label(ax, found["columns"], found["rows"], name, log="xy")
            figure.colorbar(image, ax=ax, label=f"log10, {title}")
    return options.save(figure, "constants.png")


if __name__ == "__main__":
    main()
