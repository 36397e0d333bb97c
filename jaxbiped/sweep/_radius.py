"""Radius of certain attraction about a gait.

A start that comes within it need be followed no further.
"""

import numpy as np
from jaxtyping import PyTree

from jaxbiped.basins._label import Label
from jaxbiped.basins._spherical_points import spread_directions
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.scene._scene import Scene
from jaxbiped.sweep._attractor import Attractor, component_scales, section_tangents
from jaxbiped.sweep._broadcast import broadcast_leaves
from jaxbiped.sweep._effort import Effort
from jaxbiped.sweep._follow_start import follow_starts
from jaxbiped.sweep._goals import Goals

_SHELLS = 1e-5 * 1.5 ** np.arange(30)
"""Distances that are tried."""
_NEARER = 0.95
"""Share of its distance that is left of every sample after a cycle, where the shell is good."""
_NOISE = 100.0
"""Distance that the solver may make of none, in units of its tolerance."""
_DIRECTIONS = 128
_SHARE = 0.7
"""Of the largest distance from which every sample came nearer."""


def with_radius(scene: Scene | RigidScene, attractor: Attractor, effort: Effort) -> Attractor:
    """The attractor with its radius measured: all starts of one shell after another, one cycle.

    On each shell starts lie in many directions. The radius is a share of the
    last distance up to which every one of them returned and had come nearer.
    """
    size = len(attractor.state) - 1
    directions = spread_directions(_DIRECTIONS, size - 1)
    # The metric maps the section one to one: offsets whose images lie on shells.
    tangents = section_tangents(scene, attractor.state)
    back = tangents @ np.linalg.inv(attractor.metric @ tangents)
    offsets = (_SHELLS[:, None, None] * directions).reshape(-1, size - 1) @ back.T
    states = _displace(attractor.state, offsets)
    count = len(offsets)
    strikes = attractor.cycle_footsteps + (1 if scene.compliant else 0)
    outcome = follow_starts(
        broadcast_leaves(scene, count),
        states,
        _no_goals(scene, attractor, count),
        (attractor.cycle_footsteps,),
        effort._replace(footsteps=strikes, gap=0.0),
    )
    final = np.stack(outcome.final, axis=1)
    returned = (outcome.label == int(Label.UNRESOLVED)) & np.isfinite(final).all(axis=1)
    final = np.where(returned[:, None], final, attractor.point)
    after = attractor.distance(final)
    allowed = np.maximum(_NEARER * np.repeat(_SHELLS, _DIRECTIONS), _NOISE * effort.rtol)
    nearer = (returned & (after <= allowed)).reshape(len(_SHELLS), _DIRECTIONS).all(axis=1)
    good = len(_SHELLS) if nearer.all() else int(np.argmin(nearer))
    return attractor._replace(radius=_SHARE * float(_SHELLS[good - 1]) if good else -1.0)


def _displace(state: PyTree, offsets: np.ndarray) -> PyTree:
    leaves = [np.full(len(offsets), float(state[0]))]
    leaves += [float(leaf) + offsets[:, i] for i, leaf in enumerate(state[1:])]
    return type(state)(*leaves)


def _no_goals(scene: Scene | RigidScene, attractor: Attractor, count: int) -> Goals:
    scales = component_scales(scene, attractor.state)
    goals = Goals(
        attractor.point[None], attractor.metric[None], np.full(1, -1.0), np.asarray(scales)
    )
    return broadcast_leaves(goals, count)
