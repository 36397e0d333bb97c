"""Radius of certain attraction about a gait.

A start that comes within it need be followed no further.
"""

import numpy as np
from jaxtyping import PyTree

from jaxbiped.basins._label_oracle import spread_directions
from jaxbiped.basins._labels import Label
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.sweep._attractor import Attractor, component_scales, section_tangents
from jaxbiped.sweep._broadcast import broadcast_leaves
from jaxbiped.sweep._effort import Effort
from jaxbiped.sweep._follow_start import follow_starts
from jaxbiped.sweep._goals import Goals

_SHELLS = 1e-5 * 1.5 ** np.arange(30)
"""Distances that are tried."""
_STRIDE = 5
"""Every so many shells are tried first, then those between the last that is good and the next."""
_HALVED, _MOST_CYCLES = 0.5, 16
"""Samples are followed until the linear model leaves this share of their distance, or so long."""
_NOISE = 100.0
"""Distance that the solver may make of none in a cycle, in units of its tolerance."""
_DIRECTIONS = 128
_SHARE = 0.7
"""Of the largest distance from which every sample came nearer."""


def with_radius(scene: Scene | RigidScene, attractor: Attractor, effort: Effort) -> Attractor:
    """The attractor with its radius measured: all starts of one shell after another.

    On each shell starts lie in many directions. The radius is a share of the last distance up to
    which every one of them returned and had come nearer, by at least half of what the metric
    promises. Where that is little in a cycle they are followed for several: on the way to a gait
    with a multiplier near −1, or a pair near the circle, a distance may well grow for once.
    """
    rho = float(np.max(np.abs(attractor.multipliers)))
    needed = np.ceil(np.log(_HALVED) / np.log(np.clip(rho, 1e-9, 1.0 - 1e-9)))
    cycles = int(np.clip(needed, 1, _MOST_CYCLES))

    def leading(shells: np.ndarray) -> int:
        """How many of the shells, from the first on, are drawn in."""
        return int(np.cumprod(_draws_in(scene, attractor, shells, cycles, effort)).sum())

    good = _STRIDE * leading(_SHELLS[_STRIDE - 1 :: _STRIDE])
    between = _SHELLS[good : good + _STRIDE - 1]
    good += leading(between) if len(between) else 0
    return attractor._replace(radius=_SHARE * float(_SHELLS[good - 1]) if good else -1.0)


def _draws_in(
    scene: Scene | RigidScene,
    attractor: Attractor,
    shells: np.ndarray,
    cycles: int,
    effort: Effort,
) -> np.ndarray:
    """Whether all samples at each of these distances are nearer after so many cycles."""
    size = len(attractor.state) - 1
    directions = spread_directions(_DIRECTIONS, size - 1)
    # The metric maps the section one to one: offsets whose images lie on shells.
    tangents = section_tangents(scene, attractor.state)
    back = tangents @ np.linalg.inv(attractor.metric @ tangents)
    offsets = (shells[:, None, None] * directions).reshape(-1, size - 1) @ back.T
    count = len(offsets)
    strikes = cycles * attractor.cycle_footsteps + (1 if scene.compliant else 0)
    outcome = follow_starts(
        broadcast_leaves(scene, count),
        _displace(attractor.state, offsets),
        _no_goals(scene, attractor, count),
        (attractor.cycle_footsteps,),
        effort._replace(footsteps=strikes, gap=0.0),
    )
    final = np.stack(outcome.final, axis=1)
    returned = (outcome.label == int(Label.UNRESOLVED)) & np.isfinite(final).all(axis=1)
    after = attractor.distance(np.where(returned[:, None], final, attractor.point))
    left = attractor.contraction**cycles
    noise = _NOISE * effort.rtol * (1.0 - left) / (1.0 - attractor.contraction)
    allowed = np.maximum(0.5 * (1.0 + left) * np.repeat(shells, _DIRECTIONS), noise)
    nearer: np.ndarray = (returned & (after <= allowed)).reshape(len(shells), -1).all(axis=1)
    return nearer


def _displace(state: PyTree, offsets: np.ndarray) -> PyTree:
    leaves = [np.full(len(offsets), float(state[0]))]
    leaves += [float(leaf) + offsets[:, i] for i, leaf in enumerate(state[1:])]
    return type(state)(*leaves)


def _no_goals(scene: Scene | RigidScene, attractor: Attractor, count: int) -> Goals:
    # Followed wherever they go: the linear model decides nothing.
    goals = Goals(
        attractor.point[None],
        attractor.metric[None],
        np.full((1, *attractor.model.shape), np.inf),
        attractor.slowest[None],
        np.ones(1),
        np.full(1, -1.0),
        component_scales(scene, attractor.state),
    )
    return broadcast_leaves(goals, count)
