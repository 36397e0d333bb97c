"""Warnings of `jaxbiped walk`: a walk that is no walk, numbers not to be relied on."""

from typing import Any

import numpy as np

import jaxbiped as jb
from jaxbiped._files import JsonObject
from jaxbiped.dynamics._contacts import contacts
from jaxbiped.measure._samples import at_steps
from jaxbiped.solve._accuracy import unresolved_slip

AIRBORNE = "airborne"
"""How a simulation ended whose time ran out before any foot touched the ground."""
_WORST_RESIDUAL = 1e-3
"""Share of the energy turned over that may be left open, however loose the tolerance."""
_FAR = 1e3
"""How many times the relative tolerance it may be."""


def ending_name(scene: Any, trajectory: "jb.Trajectory[Any]") -> str:
    """How a walk ended, in words: its `Ending`, or that it never came to the ground."""
    if trajectory.outcome is jb.Ending.WALKING:
        touching = at_steps(scene, trajectory, contacts).touching
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
