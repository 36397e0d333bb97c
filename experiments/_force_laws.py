"""A law of contact in the seed's walk: its cost, its gait, and whether it suits."""

import numpy as np
from _timing import seconds_of

import jaxbiped as jb

SEED = {"normal": "ristow-schafer", "friction": "bengisu-akay"}
DURATION = 2.0
"""What a walk is judged and timed by [s]."""
SETTLING = 12.0
"""After so long a walk that has a stable gait is on it [s]."""
SETTLED = 1e-4
"""Two footsteps of a settled walk differ by less than this share."""
TRUSTED = 1e-4
"""Error of the multiplier that must be 1, up to which multipliers are trusted."""
COSTLY = 2.0
"""Attempted steps, as a multiple of those by the seed's laws, from which a law counts as costly."""
GRIP = 1.001
"""Friction over load, as a multiple of the static coefficient, from which it is beyond it."""
CRITERIA = {
    "walks": f"it walks for {DURATION:g} s from the seed's start; else it does not suit",
    "pushes": "no normal force is ever below zero; else it does not suit",
    "gait": f"walking on for {SETTLING:g} s it settles on a gait, or a search finds one; else it "
    "does not suit",
    "continuous": "the normal force does not jump at touchdown; else with care",
    "found": "find_gait, which needs derivatives, finds the gait; else with care",
    "multipliers": f"the multiplier that must be 1 is in error by less than {TRUSTED:g}; else "
    "with care",
    "grip": "friction is never beyond the static coefficient times the load; else with care",
    "cost": f"attempted steps are at most {COSTLY:g} times those of the seed's laws; else with "
    "care",
}
"""What a verdict is derived from, in this order."""
MEASURES = {
    "period_s": "period",
    "step_length_m": "step_length",
    "speed_m_s": "speed",
    "peak_normal_N": "peak_normal",
    "spectral_radius": "spectral_radius",
}
"""Measures of a gait by their names here and in `jb.gait.Measures`."""


def walk_of(scene, duration, **how):
    """A walk from the seed's start by lanes, and its dataset."""
    options = dict(duration=duration, engine="lanes", max_solver_steps=1 << 17) | how
    walk = jb.simulate(scene, jb.seed_state(), **options)
    return walk, jb.measure.trajectory_dataset(scene, walk)


def findings(scene, repeats):
    """What is measured of one law; SI units.

    `measures`: of the gait, by `found_by` a search, or a settled walk where that found none; None
    where there is no gait. `walked_period_difference`: of the two ways, as a share. Extremes are
    over the ends of the solver's steps of the walk from the seed's start: `least_total_N` of both
    feet together is above zero unless the walker leaves the ground.
    """
    walk, rows = walk_of(scene, DURATION)
    how = dict(duration=DURATION, save="end", engine="lanes")
    run = jb.Simulation.prepare(scene, jb.seed_state(), **how).compile()
    walked = settled(scene) if walk.outcome is jb.Ending.WALKING else None
    gait = jb.find_gait(scene, parameters=(), radius_sensitivities=False)
    found = gait.outcome is jb.gait.Search.FOUND
    searched = {name: float(getattr(gait.measures, key)) for name, key in MEASURES.items()}
    both = found and walked
    load = rows.normal_force
    pull = abs(rows.get("tangential_force", 0.0 * load))
    return {
        "outcome": str(walk.outcome),
        "end_s": float(walk.t[-1]),
        "attempted_steps": int(walk.attempted),
        "wall_ms": 1e3 * seconds_of({0: run}, repeats)[0],
        "search": str(gait.outcome) + ("" if found else f", last walk: {gait.walk_outcome}"),
        "found_by": "search" if found else ("walk" if walked else None),
        "measures": searched if found else walked,
        "unit_multiplier_error": float(gait.unit_multiplier_error) if found else None,
        "walked_period_difference": walked["period_s"] / searched["period_s"] - 1 if both else None,
        "force_jumps_at_touchdown": scene.normal.jumps_at_touchdown,
        "largest_penetration_m": float(rows.penetration.where(rows.touches).max()),
        "least_normal_N": float(load.min()),
        "most_normal_N": float(load.max()),
        "least_total_N": float(load.sum("foot").min()),
        "most_friction_over_load": float((pull / load).where(load > 0.0).max()),
    }


def settled(scene):
    """The gait that a long walk settles on, None where it does not; no spectral radius."""
    walk, _ = walk_of(scene, SETTLING)
    steps = jb.footsteps(scene, walk)
    last = steps.period_s[-3:]
    if walk.outcome is not jb.Ending.WALKING or len(last) < 3 or np.ptp(last) > SETTLED * last[-1]:
        return None
    names = dict(period_s="period_s", step_length_m="length_m", speed_m_s="speed_m_s")
    own = {name: float(getattr(steps, key)[-1]) for name, key in names.items()}
    return own | {"peak_normal_N": float(steps.peak_normal_N[-1]), "spectral_radius": None}


def deviations(found, seed):
    """Of every measure from the seed's, as a share; None where there is none."""
    own, its = found["measures"] or {}, seed["measures"] or {}
    pairs = {name: (own.get(name), its.get(name)) for name in MEASURES}
    return {
        name: None if value is None or ours is None else value / ours - 1.0
        for name, (value, ours) in pairs.items()
    }


def verdict(found, seed, mu_static):
    """Whether a law suits, by `CRITERIA`."""
    if found["outcome"] != str(jb.Ending.WALKING):
        return f"does not suit: {found['outcome']} at {found['end_s']:.3f} s"
    if found["least_normal_N"] < 0.0:
        return f"does not suit: the ground pulls with {-found['least_normal_N']:.3g} N"
    if found["measures"] is None:
        return "does not suit: it settles on no gait"
    error = found["unit_multiplier_error"]
    cost = found["attempted_steps"] / seed["attempted_steps"]
    cares = []
    if found["force_jumps_at_touchdown"]:
        cares.append("its force jumps at touchdown")
    if error is None:
        cares.append(f"no derivatives (gait search: {found['search'].partition(', ')[0]})")
    elif not error < TRUSTED:
        cares.append(f"multipliers not to be trusted (unit one off by {error:.1e})")
    if found["most_friction_over_load"] > GRIP * mu_static:
        cares.append(f"friction up to {found['most_friction_over_load']:.3g} of the load")
    if cost > COSTLY:
        cares.append(f"{cost:.1f} times the seed's steps")
    return "suits with care: " + "; ".join(cares) if cares else "suits"
