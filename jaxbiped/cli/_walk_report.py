"""Numbers of a walk: footsteps, costs and warnings; and its files.

Warned of is a walk that is no walk, and numbers that are not to be relied on.
"""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax.tree_util as jtu
import numpy as np

import jaxbiped as jb
from jaxbiped._files import JsonObject
from jaxbiped._progress import stage
from jaxbiped._types import rows_of
from jaxbiped.cli._options import OutputOptions
from jaxbiped.constraints._constraint_methods import name_of
from jaxbiped.dynamics._contacts import contacts
from jaxbiped.dynamics._energy import is_driven
from jaxbiped.hybrid._scales import unresolved_slip
from jaxbiped.measure._footsteps import footstep_dataset
from jaxbiped.measure._samples import evaluate_along, from_start, places_of_standing
from jaxbiped.solve._error_estimate import error_numbers

_SHOWN = 60.0
"""The part of a long walk that is drawn and can be watched [s]."""
_AT_LEAST = ("time_s", "period_s", "length_m", "speed_m_s")
"""What is known of footsteps on any feet."""
AIRBORNE = "airborne"
"""How a simulation ended whose time ran out before any foot touched the ground."""
_WORST_RESIDUAL = 1e-3
"""Share of the energy turned over that may be left open, however loose the tolerance."""
_FAR = 1e3
"""How many times the relative tolerance it may be."""


def walk_numbers(
    scene: Any, walk: "jb.Trajectory[Any]", settings: JsonObject, wall: dict[str, float]
) -> JsonObject:
    """What is known of a walk of any kind in SI units, ready for JSON."""
    numbers: JsonObject = {
        "slope_rad": float(scene.ground.slope),
        "duration_s": float(np.asarray(walk.t)[-1]),
        "solver": settings | {"engine": walk.engine},
        "wall_s": wall,
    }
    if walk.error is not None:
        numbers["error"] = error_numbers(walk.error)
    rolls = isinstance(scene, jb.RigidScene)
    if rolls:
        assert walk.arrivals is not None
        numbers |= {
            "model": "rigid",
            "ending": str(walk.outcome),
            "footsteps": max(int(walk.arrivals.total) - 1, 0),
            "steps": _rigid_footsteps(scene, walk.arrivals),
        }
        numbers["solver"]["attempted"] = int(walk.attempted)
    else:
        numbers |= _compliant_numbers(scene, walk)
        numbers["solver"] |= {"accepted": int(walk.accepted), "rejected": int(walk.rejected)}
    if is_driven(scene) and (numbers["steps"] or not rolls):
        numbers |= walk_cost(scene, walk)
    warnings_of = rigid_warnings if rolls else walk_warnings
    numbers["warnings"] = warnings_of(scene, numbers, rtol=settings["rtol"])
    return numbers


def _compliant_numbers(scene: Any, walk: "jb.Trajectory[Any]") -> JsonObject:
    with stage("measuring the footsteps"):
        rows = footstep_rows(jb.footsteps(scene, walk))
        legs = scene.mechanism.structure.legs
        struck = jb.measure.heel_strikes(scene, walk).foot[1:]
        rows = [{"leg": legs[leg - 1]} | row for leg, row in zip(struck, rows, strict=True)]
        ledger = jb.measure.energy_ledger(scene, walk)
    numbers: JsonObject = {
        "ending": ending_name(scene, walk),
        "steps": rows,
        "energy_residual_J": float(ledger.residual[0]),
        "energy_residual_relative": relative_residual(ledger),
        "gravity_work_J": float(ledger.gravity_work[0]),
    }
    if is_driven(scene):
        numbers["actuation_work_J"] = float(ledger.actuation_work[0])
    if scene.redundant:
        numbers["constraints"] = _constraint_numbers(scene, walk)
    return numbers


def footstep_rows(steps: Any) -> list[dict[str, float]]:
    """The footsteps of a walk on compliant feet, each ready for JSON."""
    names = (*_AT_LEAST, "peak_normal_N", "max_penetration_m", "double_support_s")
    return _rows({name: np.asarray(getattr(steps, name)) for name in names})


def footstep_csv(rows: list[dict[str, Any]]) -> str:
    """Footsteps of a walk on any feet as comma-separated values."""
    names = rows[0] if rows else _AT_LEAST
    found = footstep_dataset({name: [row[name] for row in rows] for name in names})
    return jb.measure.to_csv(found, "footstep")


def _rows(found: dict[str, np.ndarray]) -> list[dict[str, float]]:
    rows = np.transpose([*found.values()]).tolist()
    return [dict(zip(found, row, strict=True)) for row in rows]


def _rigid_footsteps(scene: "jb.RigidScene", strikes: Any) -> list[dict[str, float]]:
    """Each footstep from one heel strike to the next."""
    count, states = min(int(strikes.total), len(np.asarray(strikes.t))), strikes.state
    at = np.asarray(strikes.t)[:count]
    places = places_of_standing(scene, rows_of(states, slice(count)))
    periods, lengths = np.diff(at), np.diff(places)
    found = {"time_s": at[1:], "period_s": periods, "length_m": lengths}
    return _rows(found | {"speed_m_s": lengths / periods})


def _motion_figures(scene: Any, walk: "jb.Trajectory[Any]") -> dict[str, Callable[[], Any]]:
    """What draws a walk on any feet, by the names of the files."""
    return {
        "strobe": lambda: jb.plot.gait_strobe(scene, walk),
        "phase_portrait": lambda: jb.plot.phase_portrait(scene, walk),
        "leg_angles": lambda: jb.plot.leg_angles(scene, walk),
    }


def write_outputs(
    scene: Any, state: Any, walk: "jb.Trajectory[Any]", output: OutputOptions
) -> list[Path]:
    """Writes the figures, the animations and the trajectory of a walk; returns their paths."""
    assert output.out is not None
    if isinstance(scene, jb.RigidScene):
        shown = from_start(scene, _rigid_beginning(walk), state)
        page = jb.plot.view(scene, shown).save(output.out / "walk.html")
        return [*output.draw(_motion_figures(scene, shown)), page]
    # The numbers first: no picture that fails takes them away.
    data = output.out / "trajectory.nc"
    jb.measure.trajectory_dataset(scene, walk).to_netcdf(data)
    figures = _motion_figures(scene, walk) | {
        "penetrations": lambda: jb.plot.penetrations(scene, walk),
        "contact_forces": lambda: jb.plot.contact_forces(scene, walk),
    }
    paths, t = output.draw(figures), np.asarray(walk.t)
    count = int(np.searchsorted(t, _SHOWN, side="right"))
    t, state = jtu.tree_map(lambda leaf: leaf[:count], (walk.t, walk.state))
    shown = dataclasses.replace(walk, t=t, state=state)
    page = jb.plot.view(scene, shown).save(output.out / "walk.html")
    played = jb.plot.save_animation(jb.plot.animate(scene, shown), output.out / "walk.gif")
    return [data, *paths, played, page]


def _rigid_beginning(walk: "jb.Trajectory[Any]") -> "jb.Trajectory[Any]":
    """The part of a long walk that can be watched: as far as its last heel strike there."""
    assert walk.arrivals is not None
    if float(np.asarray(walk.t)[-1]) <= _SHOWN:
        return walk
    count = int(np.searchsorted(np.asarray(walk.arrivals.t), _SHOWN))
    t, state = jtu.tree_map(lambda leaf: leaf[:count], walk.arrivals[1:])
    return dataclasses.replace(walk, arrivals=walk.arrivals._replace(t=t, state=state))


def walk_cost(scene: Any, walk: "jb.Trajectory[Any]") -> JsonObject:
    """Cost of transport over the whole footsteps of a walk, ready for JSON; {} without any."""
    found = jb.measure.cost_of_transport(scene, walk)
    if not len(found.cost):
        return {}
    weight = float(scene.mechanism.total_mass) * float(scene.ground.g)
    motors, gravity = float(found.motor_work.sum()), float(found.gravity_work.sum())
    return {
        "cost_of_transport": (motors + gravity) / (weight * float(found.distance.sum())),
        "motor_work_J": motors,
    }


def cost_sentence(cost: JsonObject) -> str:
    return (
        f"cost of transport {cost['cost_of_transport']:.5f} over whole footsteps, with "
        f"{cost['motor_work_J']:.4g} J of the motors' positive work"
    )


def _constraint_numbers(scene: "jb.RedundantScene", walk: "jb.Trajectory[Any]") -> JsonObject:
    """Largest violations at the ends of the steps and what was corrected at the start (SI)."""
    off = jb.dynamics.violation(scene, walk.state)
    force = jb.dynamics.hip_force(scene, walk.state)
    correction = walk.correction
    return {
        "formulation": "redundant",
        "method": name_of(scene.method),
        "orientation": scene.orientation,
        "max_violation_m": float(np.max(off.position)),
        "max_violation_rate": float(np.max(off.rate)),
        "max_hip_force_N": float(np.max(np.hypot(force.x, force.z))),
        "start_correction_m": float(correction.position),
        "start_correction_m_s": float(correction.velocity),
    }


def ending_name(scene: Any, trajectory: "jb.Trajectory[Any]") -> str:
    """How a walk ended, in words: its `Ending`, or that it never came to the ground."""
    if trajectory.outcome is jb.Ending.WALKING:
        touching = evaluate_along(scene, trajectory.state, contacts).touching
        if not np.any(np.stack(touching)):
            return AIRBORNE
    return str(trajectory.outcome)


def relative_residual(ledger: "jb.measure.EnergyLedger") -> float | None:
    """The energy left open as a share of what gravity, losses and storage turned over.

    None where that is no number: nothing happened, or the solve failed.
    """
    lost = ledger.damper_loss[0] + ledger.friction_loss[0]
    works = (ledger.gravity_work[0], ledger.actuation_work[0])
    turned_over = sum(map(abs, (*works, lost, ledger.stored_change[0])))
    share = float(abs(ledger.residual[0]) / turned_over) if turned_over > 0.0 else float("nan")
    return share if np.isfinite(share) else None


def walk_warnings(scene: Any, numbers: JsonObject, *, rtol: float | None) -> list[str]:
    """One sentence for each thing to know before relying on a walk's numbers."""
    found = []
    if numbers["ending"] == AIRBORNE:
        found.append(
            "no foot touched the ground in all that time: this is free flight, no walk; start "
            "lower (--hip-z) or simulate longer"
        )
    steps = numbers["solver"]["accepted"] + numbers["solver"]["rejected"]
    found += cut_short(numbers["ending"], steps)
    if rtol is not None and (said := unresolved_slip(rtol, scene.minimal)):
        found.append(said)
    share = numbers["energy_residual_relative"]
    bound = _WORST_RESIDUAL if rtol is None else min(_WORST_RESIDUAL, _FAR * rtol)
    if share is not None and share > bound:
        found.append(
            f"the energy left open is {share:.2g} of what was turned over: these numbers are not "
            f"accurate; take a smaller --{'dt' if rtol is None else 'rtol'}"
        )
    elif not np.isfinite(numbers["energy_residual_J"]):
        found.append(
            "the energy left open is not a number, because the walk's energy overflowed: take a "
            f"smaller --{'dt' if rtol is None else 'rtol'}"
        )
    return [*found, *friction_warnings(scene)]


def rigid_warnings(scene: Any, numbers: JsonObject, *, rtol: float | None) -> list[str]:
    found, listed = cut_short(numbers["ending"], numbers["solver"]["attempted"]), numbers["steps"]
    if numbers["footsteps"] > len(listed):
        found.append(f"only the first {len(listed)} footsteps are listed")
    return found


def cut_short(ending: str, steps: int) -> list[str]:
    """A sentence where the cap on the solver's steps ended a walk."""
    if ending != str(jb.Ending.OUT_OF_STEPS):
        return []
    return [
        f"the walk was cut short at {steps} of the solver's steps: --max-solver-steps allows "
        "more, a larger --rtol takes fewer"
    ]


def friction_warnings(scene: Any) -> list[str]:
    """A sentence where friction grows with slip instead of falling."""
    law = scene.friction
    static, kinetic = (getattr(law, name, None) for name in ("mu_static", "mu_kinetic"))
    if static is None or kinetic is None or not float(kinetic) > float(static):
        return []
    return [
        f"mu_kinetic = {float(kinetic):g} is above mu_static = {float(static):g}: friction grows "
        "with slip, and has no Stribeck peak"
    ]
