"""Comparison of force models: the seed's walk under every law of contact.

The paper sets out to compare several models of the normal force and of friction, and shows one of
each. Here each normal law (with the seed's friction) and each law of friction (with the seed's
normal law), matched to the seed's parameters, walks, is timed, searched for its gait and judged:
force_models_normal.png, force_models_friction.png, force_models_measures.png. Its figures 9 and 10,
leg angle and contact force on several slopes: figure_9_leg_angle.png, figure_10_contact_force.png.
"""

import time
from typing import Any, NamedTuple

from _force_laws import (
    CRITERIA,
    SEED,
    SLOPE,
    Findings,
    deviations,
    findings,
    scene_with,
    verdict,
)
from _force_pictures import friction_picture, measures_picture, normal_picture
from _force_samples import Stance, first_stance, motion
from _force_slopes import Descent, descents
from _options import Options, parse

import jaxbiped as jb

LAWS = {"normal": tuple(jb.laws.NORMAL_LAWS), "friction": tuple(jb.laws.FRICTION_LAWS)}
QUICK_LAWS = {
    "normal": ("ristow-schafer", "hunt-crossley"),
    "friction": ("bengisu-akay", "coulomb"),
}
REPEATS, QUICK_REPEATS = 15, 3
DRAWN = 1.0
"""Time from the seed's start in which one step is drawn [s]."""


class Model(NamedTuple):
    """What is known of one law: its findings, and its first step where it makes one."""

    findings: Findings
    stance: Stance | None


def model(repeats: int, laws: dict[str, str]) -> Model:
    scene = scene_with(laws)
    return Model(findings(scene, repeats), first_stance(motion(scene, DRAWN)))


def compared(options: Options) -> dict[str, dict[str, Model]]:
    """Every law of each kind; the seed's own scene is measured once."""
    repeats = QUICK_REPEATS if options.quick else REPEATS
    seed = model(repeats, {})
    laws = QUICK_LAWS if options.quick else LAWS
    return {
        kind: {name: seed if name == SEED[kind] else model(repeats, {kind: name}) for name in names}
        for kind, names in laws.items()
    }


def numbers(kind: str, found: dict[str, Findings]) -> dict[str, Any]:
    """What the JSON has of each law."""
    seed = found[SEED[kind]]
    mu_static = float(jb.seed_scene().friction.mu_static)
    return {
        name: each._asdict()
        | {
            "deviations_from_seed": deviations(each, seed),
            "verdict": verdict(each, seed, mu_static),
        }
        for name, each in found.items()
    }


COLUMNS = dict(
    attempted_steps="d", wall_ms=".2f", period_s=".5f", step_length_m=".5f", speed_m_s=".5f",
    peak_normal_N=".2f", spectral_radius=".4f", unit_multiplier_error=".1e",
    largest_penetration_m=".2e", most_normal_N=".2f", most_friction_over_load=".4f",
)  # fmt: skip


def report(options: Options, table: dict[str, dict[str, Any]]) -> None:
    """Prints a table of numbers and one of verdicts for each kind."""
    for kind, laws in table.items():
        options.say()
        rows = ({kind: name} | row | (row["measures"] or {}) for name, row in laws.items())
        options.table(rows, **{kind: ""}, **COLUMNS)
        options.say()
        for name, row in laws.items():
            options.say(f"{name:<23}{row['verdict']}")


def report_slopes(options: Options, found: list[Descent]) -> None:
    """Prints the first and the last value on each slope, and what grew at every strike."""
    heads = f"{'largest angle rad':>20}{'peak force N':>20}{'kinetic energy J':>20}"
    options.say(f"\n{'slope':>6}{'strikes':>9}{heads}  outcome; what grows at every strike")
    for each in found:
        rows = {
            "angle": (each.angles_behind_rad, ".4f", each.angle_grows_every_step),
            "force": (each.peaks_N, ".2f", each.force_grows_every_step),
            "energy": (each.kinetic_J, ".4f", each.kinetic_grows_every_step),
        }
        ends = [f"{row[0]:{form}} … {row[-1]:{form}}" for row, form, _ in rows.values()]
        grows = [what for what, (_, _, grows) in rows.items() if grows]
        options.say(
            f"{each.slope_rad:6.3f}{len(each.peaks_N):9d}"
            + "".join(f"{text:>20}" for text in ends)
            + f"  {each.outcome}; {', '.join(grows) or 'nothing'}"
        )


def main() -> None:
    options = parse(__doc__ or "")
    began = time.perf_counter()
    models = compared(options)
    found = {
        kind: {name: each.findings for name, each in laws.items()} for kind, laws in models.items()
    }
    stances = {
        kind: {name: each.stance for name, each in laws.items()} for kind, laws in models.items()
    }
    table = {kind: numbers(kind, laws) for kind, laws in found.items()}
    report(options, table)
    normal_picture(options, stances["normal"])
    friction_picture(options, stances["friction"])
    measures_picture(options, found)
    slopes = descents(options)
    report_slopes(options, slopes)
    options.say(f"\n{time.perf_counter() - began:.0f} s")
    options.finish(
        {
            "slope_rad": SLOPE,
            "criteria": CRITERIA,
            **table,
            "slopes": [each._asdict() for each in slopes],
        }
    )


if __name__ == "__main__":
    main()
