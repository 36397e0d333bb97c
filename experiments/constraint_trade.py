"""What each way to hold the hip costs for its accuracy, and what its constants do.

Error against the minimal formulation over cost, every method × integrator × tolerance; maps of
Baumgarte's a and b and of the penalty's A, ω and ζ; and each method's time beside the standard
one's, for one walk and in a batch.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from _held import (
    COLOURS,
    FLOOR,
    MARKERS,
    Integrator,
    compared,
    relative_costs,
    say_costs,
    truth_of,
)
from _options import Options, parse

import jaxbiped as jb
from jaxbiped.plot.style import dress, new_figure

TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
STEPS = (1e-4, 1e-5, 1e-6)
COSTED = Integrator("rodas4", rtol=1e-6)
DURATION, QUICK_DURATION = 1.0, 0.1


def main() -> None:
    options = parse(__doc__ or "")
    scene, quick = jb.seed_scene(), options.quick
    duration = QUICK_DURATION if quick else DURATION
    methods = ("standard", "index1") if quick else tuple(jb.constraints.CONSTRAINT_METHODS)
    integrators = [
        *([] if quick else [Integrator("rodas4", rtol=rtol) for rtol in TOLERANCES]),
        *[Integrator("euler", dt=dt) for dt in STEPS[: 2 if quick else 3]],
        *([] if quick else [Integrator("runge2", dt=dt) for dt in STEPS]),
    ]
    runs = compared(methods, integrators, duration)
    count = 3 if quick else 9
    maps = {"baumgarte": baumgarte_map(scene, duration, count, quick)}
    if not quick:
        maps["penalty"] = penalty_map(scene, duration, count, quick)
        maps["damping"] = damping_map(scene, duration, count, quick)
    costs = costs_of(scene, methods, quick)
    say(options, runs, maps, costs)
    pictures = [draw_trade(options, runs), draw_maps(options, maps)]
    options.finish(
        {
            "duration_s": duration,
            "runs": runs,
            "maps": maps,
            "costs": costs,
            "pictures": pictures,
        }
    )


def costs_of(scene: jb.Scene, methods: tuple[str, ...], quick: bool) -> dict[str, Any]:
    if quick:
        how, size = Integrator("euler", dt=1e-5), dict(single=2e-3, batch=2e-4, count=8, turns=3)
    else:
        how, size = COSTED, dict(single=2.0, batch=0.4408, count=1024, turns=7)
    return relative_costs(scene, methods, how, **size)  # type: ignore[arg-type]


def finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def mapped(
    scene: jb.Scene, methods: Any, shape: tuple[int, int], duration: float, quick: bool
) -> dict[str, Any]:
    """Violation, error and steps for a batch of methods of one kind, each entry a list of rows."""
    truth = jnp.asarray(truth_of(scene, duration))
    how: dict[str, Any] = dict(solver="euler", dt=1e-5) if quick else dict(rtol=1e-6)

    @eqx.filter_jit
    def every(methods: Any) -> Any:
        def one(method: Any) -> Any:
            held = jb.RedundantScene(scene, method)
            walk = jb.simulate(
                held,
                jb.seed_state(),
                duration=duration,
                save="end",
                watch=(),
                extremes=jb.dynamics.violation,
                max_solver_steps=1 << 16,
                **how,
            )
            end = jb.dynamics.minimal_state(held, jax.tree.map(lambda leaf: leaf[0], walk.state))
            error = jnp.max(jnp.abs(jnp.stack(list(end)) - truth))
            return walk.highest.position, error, walk.attempted, walk.ending

        return jax.vmap(one)(methods)

    position, error, steps, ending = (np.asarray(leaf).reshape(shape) for leaf in every(methods))
    good = (ending == 0) & np.isfinite(error)
    return {
        "max_violation_m": [[finite(v) for v in row] for row in np.where(good, position, np.nan)],
        "state_error": [[finite(v) for v in row] for row in np.where(good, error, np.nan)],
        "steps": steps.tolist(),
        "failed": (~good).tolist(),
    }


def baumgarte_map(scene: jb.Scene, duration: float, count: int, quick: bool) -> dict[str, Any]:
    values = np.logspace(-1.0, 5.0, count)
    a, b = (jnp.asarray(x.ravel()) for x in np.meshgrid(values, values, indexing="ij"))
    methods = jax.vmap(lambda a, b: jb.constraints.Baumgarte(a=a, b=b))(a, b)
    found = mapped(scene, methods, (count, count), duration, quick)
    return {"rows": "a (1/s)", "columns": "b (1/s)", "row": values.tolist()} | {
        "column": values.tolist(),
        **found,
    }


def penalty_map(scene: jb.Scene, duration: float, count: int, quick: bool) -> dict[str, Any]:
    penalties, rates = np.logspace(1.0, 11.0, count), np.logspace(-1.0, 4.0, count)
    A, omega = (jnp.asarray(x.ravel()) for x in np.meshgrid(penalties, rates, indexing="ij"))
    methods = jax.vmap(lambda A, omega: jb.constraints.Penalty(A=A, omega=omega))(A, omega)
    found = mapped(scene, methods, (count, count), duration, quick)
    return {"rows": "A (kg)", "columns": "ω (1/s)", "row": penalties.tolist()} | {
        "column": rates.tolist(),
        **found,
    }


def damping_map(scene: jb.Scene, duration: float, count: int, quick: bool) -> dict[str, Any]:
    dampings, rates = np.logspace(-2.0, 2.0, count), np.logspace(-1.0, 4.0, count)
    zeta, omega = (jnp.asarray(x.ravel()) for x in np.meshgrid(dampings, rates, indexing="ij"))
    methods = jax.vmap(lambda zeta, omega: jb.constraints.Penalty(omega=omega, zeta=zeta))(
        zeta, omega
    )
    found = mapped(scene, methods, (count, count), duration, quick)
    return {"rows": "ζ", "columns": "ω (1/s)", "row": dampings.tolist()} | {
        "column": rates.tolist(),
        **found,
    }


def say(
    options: Options, runs: list[dict[str, Any]], maps: dict[str, Any], costs: dict[str, Any]
) -> None:
    options.table(
        runs, method="", integrator="", rtol_or_dt=".0e", ending="", max_violation_m=".1e",
        state_error=".1e", steps="d", wall_s_run=".3f",
    )  # fmt: skip
    for name, found in maps.items():
        error = np.array(found["state_error"], dtype=float)
        if np.isfinite(error).any():
            i, j = np.unravel_index(np.nanargmin(error), error.shape)
            options.say(
                f"{name}: least error {error[i, j]:.1e} at {found['rows']} = "
                f"{found['row'][i]:.3g}, {found['columns']} = {found['column'][j]:.3g}; "
                f"{int(np.sum(found['failed']))} of {error.size} failed"
            )
    say_costs(options, costs)


def draw_trade(options: Options, runs: list[dict[str, Any]]) -> str:
    integrators = list(dict.fromkeys(run["integrator"] for run in runs))
    figure = new_figure(3.6 * max(len(integrators), 2), 3.8)
    axes = figure.subplots(1, len(integrators), sharey=True, squeeze=False)[0]
    names = list(jb.constraints.CONSTRAINT_METHODS)
    for ax, integrator in zip(axes, integrators, strict=True):
        for method in dict.fromkeys(run["method"] for run in runs):
            mine = [r for r in runs if (r["method"], r["integrator"]) == (method, integrator)]
            mine = [r for r in mine if r["state_error"] is not None]
            k = names.index(method)
            ax.plot(
                [r["wall_s_run"] for r in mine],
                [r["state_error"] for r in mine],
                marker=MARKERS[k],
                color=COLOURS[k],
                label=method,
                linewidth=0.9,
                markersize=5,
            )
        ax.set_xscale("log")
        ax.set_yscale("log")
        dress(ax, integrator, "time of a run (s)", "")
    axes[0].set_ylabel("error of the state (SI)")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    return options.save(figure, "trade.png")


def edges_of(values: list[float]) -> np.ndarray:
    """Edges half way between values, on a logarithmic axis."""
    logs = np.log10(values)
    half = 0.5 * (logs[1] - logs[0])
    return np.asarray(10.0 ** np.append(logs - half, logs[-1] + half))


def draw_maps(options: Options, maps: dict[str, Any]) -> str:
    shown = {"max_violation_m": "largest violation (m)", "state_error": "error of the state (SI)"}
    figure = new_figure(3.9 * len(maps), 6.4)
    axes = figure.subplots(2, len(maps), squeeze=False)
    for column, (name, found) in enumerate(maps.items()):
        for row, (key, title) in enumerate(shown.items()):
            ax = axes[row, column]
            values = np.log10(np.maximum(np.array(found[key], dtype=float), FLOOR))
            edges = (edges_of(found["column"]), edges_of(found["row"]))
            image = ax.pcolormesh(*edges, values, cmap="viridis")
            ax.set_facecolor("#BBBBBB")  # where a run failed
            ax.set_xscale("log")
            ax.set_yscale("log")
            ax.set_xlabel(found["columns"])
            ax.set_ylabel(found["rows"])
            ax.set_title(name, loc="left", fontsize="medium")
            figure.colorbar(image, ax=ax, label=f"log10, {title}")
    return options.save(figure, "constants.png")


if __name__ == "__main__":
    main()
