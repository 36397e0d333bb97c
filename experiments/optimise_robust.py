"""Designs that hold under scatter of the contact and of the slope, and the trade that they make.

Writes optimise_robust.png. The leg is made as fast as a bound of the spectral radius allows: for
the nominal walker, in the mean over an ensemble, and for its worst member. Stiffness, damping,
Stribeck rate and slope differ from member to member. Then the front of speed against radius. Each
design is tried on an ensemble that it was not made for.
"""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _options import Options, parse

import jaxbiped as jb

LEG = {"d": (0.05, 0.2), "r": (0.04, 0.12), "J": (0.003, 0.02)}
SCATTER = {"K": 0.3, "c": 0.3, "xi": 0.3, "slope": 0.1}
RIGID_SCATTER = {"slope": 0.1, "J": 0.05}
BOUND = 0.4
TRIED = 64
BOUNDS, QUICK_BOUNDS = np.linspace(0.2, 0.5, 7), np.array([0.35, 0.5])


def scattered(
    scene: jb.Scene | jb.RigidScene, scatter: dict[str, float], count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Speeds and radii of gaits whose parameters are drawn, NaN where there is none."""
    generator = np.random.default_rng(7)
    own = {name: float(value) for name, value in jb.parameter_values(scene).items()}
    guess = jb.find_gait(scene, parameters=(), radius_sensitivities=False).measures.state
    rows = []
    for _ in range(count):
        drawn = {n: own[n] * (1.0 + s * generator.uniform(-1.0, 1.0)) for n, s in scatter.items()}
        gait = jb.find_gait(
            jb.with_parameters(scene, drawn), guess, parameters=(), radius_sensitivities=False
        )
        found = gait.outcome is jb.gait.Search.FOUND and bool(gait.sound)
        measures = gait.measures
        pair = (float(measures.speed), float(measures.spectral_radius))
        rows.append(pair if found else (np.nan, np.nan))
    speeds, radii = np.asarray(rows).T
    return speeds, radii


def designs(
    options: Options, scene: jb.Scene | jb.RigidScene, scatter: dict[str, float]
) -> dict[str, Any]:
    found: dict[str, Any] = {}
    kinds: dict[str, dict[str, Any]] = {
        "nominal": {},
        "mean": {"scatter": scatter, "criterion": "mean"},
        "worst": {"scatter": scatter, "criterion": "worst"},
    }
    for name, how in kinds.items():
        best = jb.optimise_gait(
            scene,
            vary=LEG,
            maximise="speed",
            subject_to=f"spectral_radius<{BOUND}",
            iterations=15 if options.quick else 100,
            **how,
        )
        speeds, radii = scattered(best.scene, scatter, 8 if options.quick else TRIED)
        broken = float(np.mean(radii > BOUND))
        found[name] = {
            "outcome": str(best.outcome),
            "variables": best.variables,
            "objective": best.objective,
            "tried": {"speed": speeds.tolist(), "spectral_radius": radii.tolist()},
            "share_beyond_bound": broken,
            "iterations": len(best.history),
        }
        options.say(
            f"{name:>8}: {best.objective:.5f} m/s, {best.outcome}; tried: mean speed "
            f"{np.nanmean(speeds):.5f} m/s, radius up to {np.nanmax(radii):.4f}, beyond the bound "
            f"in {100.0 * broken:.0f} % of {len(radii)}, without a gait {np.isnan(radii).sum()}"
        )
    return found


def picture(
    options: Options, found: dict[str, Any], bounds: np.ndarray, speeds: np.ndarray
) -> None:
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 4.0), layout="constrained")
    left.plot(bounds, speeds, "o-", ms=4.0)
    left.set_xlabel("bound of the spectral radius")
    left.set_ylabel("largest speed (m/s)")
    for name, form in (("nominal", "o"), ("mean", "s"), ("worst", "^")):
        tried = found[name]["tried"]
        right.plot(tried["spectral_radius"], tried["speed"], form, ms=4.0, mfc="none", label=name)
    right.axvline(BOUND, color="#595959", ls=":", lw=0.8)
    right.set_xlabel("spectral radius under scatter")
    right.set_ylabel("speed (m/s)")
    right.legend(frameon=False)
    options.save(figure, "optimise_robust.png")


def main() -> None:
    options = parse(__doc__ or "")
    scene = jb.ladder()["rigid"] if options.quick else jb.seed_scene()
    scatter = RIGID_SCATTER if options.quick else SCATTER
    found = designs(options, scene, scatter)
    front = jb.optimise.pareto_front(
        scene,
        vary=LEG,
        maximise="speed",
        against="spectral_radius",
        bounds=(QUICK_BOUNDS if options.quick else BOUNDS)[::-1],
        iterations=15 if options.quick else 60,
    )
    for bound, best in zip(front.bounds, front.optima, strict=True):
        options.say(f"radius ≤ {bound:.3f}: {best.objective:.5f} m/s, {best.outcome}")
    picture(options, found, front.bounds, front.values("speed"))
    options.finish(
        {
            "bound": BOUND,
            "scatter": scatter,
            "designs": found,
            "front": {
                "bounds": front.bounds.tolist(),
                "speed_m_s": front.values("speed").tolist(),
                "spectral_radius": front.values("spectral_radius").tolist(),
                "outcomes": [str(best.outcome) for best in front.optima],
                "variables": [best.variables for best in front.optima],
            },
        }
    )


if __name__ == "__main__":
    main()
