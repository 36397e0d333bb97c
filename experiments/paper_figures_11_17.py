"""The paper's figures 11 to 17: the hip's violation and its cost, by method and integrator.

Beside each figure the paper's sentence about it, and what our numbers say to it.
"""

from typing import Any

import numpy as np
from _held import (
    FLOOR,
    PROJECTING,
    Curve,
    Integrator,
    curve_of,
    relative_costs,
    say_costs,
    truth_of,
)
from _held_pictures import (
    draw_all,
    draw_costs,
    draw_each,
    draw_integrators,
    draw_times,
)
from _options import Options, parse

import jaxbiped as jb

ODE = Integrator("dopri5", rtol=1e-3)
"""What the paper's "ode" is taken for: Dormand and Prince's pair at MATLAB's usual tolerance."""
STIFF = Integrator("rodas4", rtol=1e-6)
FOOTSTEP = 0.4408


def main() -> None:
    options = parse(__doc__ or "")
    scene = jb.seed_scene()
    quick = options.quick
    step = 1e-5 if quick else 1e-6
    duration = 0.3 if quick else 2.0
    methods = (
        ("standard", "augmented", "described")
        if quick
        else tuple(jb.constraints.CONSTRAINT_METHODS)
    )
    euler, runge = Integrator("euler", dt=step), Integrator("runge2", dt=step)
    truth = truth_of(scene, duration)
    by_method = {name: curve_of(scene, name, euler, duration, truth) for name in methods}
    tried = {"euler": euler, "runge2": runge} | ({} if quick else {"ode": ODE, "rodas4": STIFF})
    by_integrator = {
        (method, name): by_method[method]
        if name == "euler"
        else curve_of(scene, method, how, duration, truth)
        for method in ("augmented", "standard")
        for name, how in tried.items()
    }
    long = {} if quick else hundred_footsteps(scene)
    # Two programs for each method: one that projects and one that does not will do.
    costed = ("standard", "described") if quick else methods
    costs = costs_of(scene, costed, euler, quick)
    verdicts = judged(by_method, by_integrator, long)
    say(options, by_method, by_integrator, costs, long, verdicts)
    pictures = [
        draw_each(options, by_method),
        draw_all(options, "fig12_all_methods.png", by_method, "All methods"),
        draw_all(
            options,
            "fig13_without_standard.png",
            {name: c for name, c in by_method.items() if name != "standard"},
            "All but the standard method",
        ),
        draw_costs(options, costs),
        draw_integrators(options, "fig15_augmented.png", "augmented", by_integrator),
        draw_integrators(options, "fig16_standard.png", "standard", by_integrator),
        draw_times(options, by_integrator),
    ]
    if long:
        pictures.append(
            draw_all(options, "hundred_footsteps.png", long, "A hundred footsteps by rodas4")
        )
    options.finish(
        {
            "duration_s": duration,
            "dt_s": step,
            "methods": {name: numbers(c) for name, c in by_method.items()},
            "integrators": {f"{m} {i}": numbers(c) for (m, i), c in by_integrator.items()},
            "costs": costs,
            "hundred_footsteps": {name: numbers(c) for name, c in long.items()},
            "verdicts": verdicts,
            "pictures": pictures,
        }
    )


def hundred_footsteps(scene: jb.Scene) -> dict[str, Curve]:
    duration = 100.0 * FOOTSTEP
    truth = truth_of(scene, duration)
    return {
        name: curve_of(scene, name, STIFF, duration, truth, points=4001)
        for name in jb.constraints.CONSTRAINT_METHODS
    }


def costs_of(
    scene: jb.Scene, methods: tuple[str, ...], euler: Integrator, quick: bool
) -> dict[str, dict[str, float]]:
    """Times beside the standard method's by Euler steps, of one walk and in a batch."""
    count, single, batch = (64, 0.02, 1e-3) if quick else (1024, 0.05, 2e-3)
    return relative_costs(
        scene, methods, euler, single=single, batch=batch, count=count, turns=3 if quick else 7
    )


def numbers(curve: Curve) -> dict[str, Any]:
    return {
        "ending": curve.ending,
        "max_violation_m": curve.at_steps if np.isfinite(curve.at_steps) else None,
        "first_half_m": curve.largest(0.0, 0.5),
        "last_half_m": curve.largest(0.5, 1.0),
        "state_error": curve.error if np.isfinite(curve.error) else None,
        "wall_s_run": curve.seconds,
    }


def judged(
    by_method: dict[str, Curve], by_integrator: dict[tuple[str, str], Curve], long: dict[str, Curve]
) -> list[dict[str, Any]]:
    """The paper's sentences, each with whether our numbers bear it out."""
    curves = long or by_method
    growth = {
        name: c.largest(0.5, 1.0) / max(c.largest(0.0, 0.5), FLOOR) for name, c in curves.items()
    }
    worst = {name: c.at_steps for name, c in by_method.items()}
    held = [name for name in growth if name not in ("standard", *PROJECTING)]
    integrators = sorted({name for _, name in by_integrator})
    augmented = {name: by_integrator["augmented", name] for name in integrators}

    def verdict(figure: str, sentence: str, holds: bool, because: str) -> dict[str, Any]:
        return dict(figure=figure, sentence=sentence, confirmed=bool(holds), numbers=because)

    found = [
        verdict(
            "11",
            "when the standard Lagrange multipliers method is used, the violation of constraints "
            "grows indefinitely with time",
            growth["standard"] > 1.5,
            f"last half over first half {growth['standard']:.2f}",
        ),
        verdict(
            "11",
            "with [baumgarte, augmented, index1, described] the constraints violation does not "
            "growth with time",
            all(growth[name] < 1.5 for name in held),
            ", ".join(f"{name} {growth[name]:.2f}" for name in held),
        ),
        verdict(
            "11",
            "the direct correction approach completely eliminate the violation of constraints",
            worst["described"] < 1e-12,
            f"largest {worst['described']:.1e} m",
        ),
        verdict(
            "13",
            "constrains violation of the augmented lagrangian formulation, the direct correction "
            "approach and the baumgarte stabilization approach have the same order of magnitude",
            worst["described"] > 0.1 * worst["augmented"],
            f"augmented {worst['augmented']:.1e} m, described {worst['described']:.1e} m",
        ),
        verdict(
            "15",
            "the method that most eliminates the constraints violations is the Runge-Kutta",
            min(integrators, key=lambda i: augmented[i].largest(0.0, 1.0)) == "runge2",
            ", ".join(f"{i} {augmented[i].largest(0.0, 1.0):.1e} m" for i in integrators),
        ),
        verdict(
            "17",
            "the Runge-Kutta integrator (with both methods: standard and augmented) is the less "
            "efficient approach",
            all(
                max(integrators, key=lambda i: by_integrator[m, i].seconds) == "runge2"
                for m in ("standard", "augmented")
            ),
            ", ".join(f"{i} {augmented[i].seconds:.2f} s" for i in integrators),
        ),
    ]
    if "ode" in integrators:
        found.append(
            verdict(
                "17",
                "the ode integrator needs much less time than the Runge-kutta integrator and the "
                "Euler integrator",
                augmented["ode"].seconds
                < 0.5 * min(augmented["euler"].seconds, augmented["runge2"].seconds),
                f"ode {augmented['ode'].seconds:.2f} s, euler {augmented['euler'].seconds:.2f} s, "
                f"rodas4 {augmented['rodas4'].seconds:.2f} s",
            )
        )
    return found


def say(
    options: Options,
    by_method: dict[str, Curve],
    by_integrator: dict[tuple[str, str], Curve],
    costs: dict[str, dict[str, float]],
    long: dict[str, Curve],
    verdicts: list[dict[str, Any]],
) -> None:
    for title, curves in (
        ("methods by Euler steps", by_method),
        ("integrators", {f"{m}, {i}": c for (m, i), c in by_integrator.items()}),
        ("a hundred footsteps by rodas4", long),
    ):
        options.say(title)
        options.table(
            ({"run": name} | numbers(curve) for name, curve in curves.items()), run="", ending="",
            first_half_m=".1e", last_half_m=".1e", max_violation_m=".1e", state_error=".1e",
            wall_s_run=".3f",
        )  # fmt: skip
    say_costs(options, costs)
    for each in verdicts:
        word = "confirmed" if each["confirmed"] else "CONTRADICTED"
        options.say(f'figure {each["figure"]}, {word}: "{each["sentence"]}" ({each["numbers"]})')


if __name__ == "__main__":
    main()
