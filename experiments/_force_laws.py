"""A law of contact in the seed's walk: its cost, its gait, and whether it suits."""

import jax
import jax.numpy as jnp
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
MOST_STEPS = 1 << 20
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


def extremes(scene, state):
    """Loads and depths of both feet, for the `extremes` of a simulation."""
    both, forces = jb.dynamics.feet(scene, state), jb.dynamics.foot_forces(scene, state)
    normal = [force.normal for force in forces]
    depths = [jnp.where(jb.dynamics.touches(foot), foot.penetration, 0.0) for foot in both]
    tangential = [
        0.0 if force.tangential is None else jnp.abs(force.tangential) for force in forces
    ]
    ratios = [
        jnp.where(load > 0.0, pull / jnp.where(load > 0.0, load, 1.0), 0.0)
        for pull, load in zip(tangential, normal, strict=True)
    ]
    return {
        "depth": jnp.maximum(*depths),
        "least": jnp.minimum(*normal),
        "most": jnp.maximum(*normal),
        "total": normal[0] + normal[1],
        "ratio": jnp.maximum(*ratios),
    }


def walk(scene, state, duration):
    """A walk by lanes, ready to run: heel strikes and extremes. One program for every duration."""
    how = dict(save=jb.HeelStrike(), extremes=extremes, max_solver_steps=MOST_STEPS)
    return jb.Simulation.prepare(scene, state, duration=duration, engine="lanes", **how).compile()


def findings(scene, repeats):
    """What is measured of one law; SI units.

    `measures`: of the gait, by `found_by` a search, or a settled walk where that found none; None
    where there is no gait. `walked_period_difference`: of the two ways, as a share. Extremes are
    over the ends of the solver's steps of the walk from the seed's start: `least_total_N` of both
    feet together is above zero unless the walker leaves the ground.
    """
    run = walk(scene, jb.seed_state(), DURATION)
    first = run()
    walks = first.outcome is jb.Ending.WALKING
    walked = settled(scene) if walks else None
    gait = jb.find_gait(scene, parameters=(), radius_sensitivities=False)
    found = gait.outcome is jb.gait.Search.FOUND
    searched = {name: float(getattr(gait.measures, key)) for name, key in MEASURES.items()}
    both = found and walked
    low, high = first.lowest, first.highest
    return {
        "outcome": str(first.outcome),
        "end_s": DURATION if walks else end_time(scene),
        "attempted_steps": int(first.attempted),
        "wall_ms": 1e3 * seconds_of({0: run}, repeats, warm=False)[0],
        "search": str(gait.outcome) + ("" if found else f", last walk: {gait.walk_outcome}"),
        "found_by": "search" if found else ("walk" if walked else None),
        "measures": searched if found else walked,
        "unit_multiplier_error": float(gait.unit_multiplier_error) if found else None,
        "walked_period_difference": walked["period_s"] / searched["period_s"] - 1 if both else None,
        "force_jumps_at_touchdown": scene.normal.jumps_at_touchdown,
        "largest_penetration_m": float(high["depth"]),
        "least_normal_N": float(low["least"]),
        "most_normal_N": float(high["most"]),
        "least_total_N": float(low["total"]),
        "most_friction_over_load": float(high["ratio"]),
    }


def settled(scene):
    """The gait that a long walk settles on, None where it does not; no spectral radius."""
    long = walk(scene, jb.seed_state(), SETTLING)()
    strikes = long.arrivals
    count = int(strikes.total)
    times, places = (np.asarray(row)[:count] for row in (strikes.t, strikes.state.hip_x))
    periods = np.diff(times)
    if long.outcome is not jb.Ending.WALKING or count < 4:
        return None
    if np.ptp(periods[-3:]) > SETTLED * periods[-1]:
        return None
    # Beginning where the foot strikes: so the extremes are those of the gait alone.
    last = jax.tree_util.tree_map(lambda leaf: leaf[count - 1], strikes.state)
    period, length = float(periods[-1]), float(places[-1] - places[-2])
    return {
        "period_s": period,
        "step_length_m": length,
        "speed_m_s": length / period,
        "peak_normal_N": float(walk(scene, last, DURATION)().highest["most"]),
        "spectral_radius": None,
    }


def end_time(scene):
    """When a walk from the seed's start ends [s]."""
    walk = jb.simulate(scene, jb.seed_state(), duration=DURATION, save="end", engine="lanes")
    return float(walk.t[-1])


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
