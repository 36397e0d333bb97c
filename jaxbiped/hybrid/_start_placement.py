"""Placement of starts: states that stand, roll and are held as a known one does.

Leaves of states have the shape (n,), those of the scene (n,) or ().
"""

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from jaxtyping import PyTree

from jaxbiped.scene._modes import AT_LIMIT, limit_motions, rigid_modes
from jaxbiped.scene._placement import placement
from jaxbiped.scene._scene import RigidScene, Scene


def standing_like(scene: Scene, base: PyTree, states: PyTree, named: Collection[str]) -> PyTree:
    """States whose stance leg is as deep, and rolls and slips, as the base's does.

    The root point's height and velocity follow from the lowest foot of that leg where they are not
    `named`.
    """
    mechanism = scene.mechanism
    structure = mechanism.structure
    root = (structure.coordinates[1], *structure.rates[:2])

    def rolling(state: PyTree) -> dict[str, np.ndarray]:
        given = {name: getattr(state, name) for name in scene.posture}
        leg = structure.legs[structure.stance_leg]
        placed = placement(mechanism, scene.ground.slope, given, leg)
        return {name: np.asarray(placed[name]) for name in root}

    old, new = rolling(base), rolling(states)
    moved = {
        leaf: getattr(base, leaf) + new[leaf] - old[leaf] for leaf in root if leaf not in named
    }
    return states._replace(**moved)


def held_like(scene: RigidScene, base: PyTree, states: PyTree, named: Collection[str]) -> PyTree:
    """States in which the stops that the base holds are held, where they can be.

    Of two bodies that a stop holds, the one that is not `named` follows the other. What is off its
    limit then is not held; states that pass a stop are no numbers, so that they are told to fail.
    """
    modes, structure = rigid_modes(scene.mechanism), scene.mechanism.structure
    if not modes.limits:
        return states
    mode, values = modes.decoded(np, base.mode), states._asdict()
    for limit, stays in zip(modes.limits, mode.held, strict=True):
        names = [structure.bodies[j] for j, _ in limit.gap.weights]
        for kind in ("theta", "omega"):
            lead = [name for name in names if f"{kind}_{name}" in named]
            follow = [name for name in names if name not in lead]
            if len(lead) == len(follow) == 1:
                own, other = f"{kind}_{follow[0]}", f"{kind}_{lead[0]}"
                moved = getattr(base, own) + values[other] - getattr(base, other)
                values[own] = np.where(stays, moved, values[own])
    like, held = values["mode"], []
    motions = limit_motions(scene.mechanism, modes, scene.ground.slope, values)
    for (gap, rate), stays in zip(motions, mode.held, strict=True):
        near = np.abs(np.asarray(gap)) <= AT_LIMIT
        held.append(stays & near & (np.abs(rate) <= AT_LIMIT))
    passed = passes_a_stop(scene, values, by=AT_LIMIT)
    values["mode"] = modes.encoded(np, mode._replace(held=tuple(held)), like)
    return type(states)(**{name: np.where(passed, np.nan, each) for name, each in values.items()})


def passes_a_stop(scene: RigidScene, values: Mapping[str, Any], *, by: float) -> np.ndarray:
    """Whether states by name, arrays of shape (n,), lie beyond a stop by so much [rad]."""
    mechanism, slope = scene.mechanism, scene.ground.slope
    passed = np.zeros(np.shape(values[scene.posture[0]]), dtype=bool)
    for gap, _ in limit_motions(mechanism, rigid_modes(mechanism), slope, values):
        passed = passed | (np.asarray(gap) < -by)
    return passed
