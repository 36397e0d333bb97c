"""The smallest push that takes the seed's walker off its gait, with and without gradients."""

import time
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxbiped as jb

COMPONENTS = jb.State._fields[1:]
FARTHEST, TOLERANCE = 1.0, 1e-5
"""In units of 1 rad, speeds √(g l), rates √(g/l), and for the height the foot's penetration."""
MOST_FOOTSTEPS = 4
ROWS = 8
"""Rays that are turned at once, at most."""


def pushes(labelling: jb.Labelling) -> list[dict[str, Any]]:
    """The smallest fatal push by rays alone, by rays turned to secants, and to gradients."""
    attractor = labelling.family.rows[0][0]
    ways: dict[str, dict[str, Any]] = {
        "bisection alone": dict(improved=0),
        "turned to secants": {},
        "turned to gradients": dict(normal=normals(labelling)),
    }
    rows = []
    for way, options in ways.items():
        began = time.perf_counter()
        found = jb.fatal_push(
            fails(labelling),
            attractor.point,
            scales=labelling.family.scales[0],
            farthest=FARTHEST,
            tolerance=TOLERANCE,
            **options,
        )
        seconds = time.perf_counter() - began
        rows.append(
            {
                "way": way,
                "distance": found.distance,
                "angle": found.angle,
                "asked": found.asked,
                "seconds": seconds,
                "direction": found.direction.tolist(),
                "push": dict(zip(COMPONENTS, found.push.tolist(), strict=True)),
            }
        )
    return rows


def fails(labelling: jb.Labelling) -> Any:
    """Whether starts (n, 7) do anything but walk: 1 or 0."""

    def label_of(points: np.ndarray) -> np.ndarray:
        states = jb.State(np.zeros(len(points)), *points.T)
        return (labelling(states).label != int(jb.Label.WALKING)).astype(int)

    return label_of


def normals(labelling: jb.Labelling) -> Any:
    """Gradients of the distance from the gait after a few footsteps, at points (n, 7).

    Starts on the boundary follow it towards an unstable gait, all to one place: that distance is
    constant along the boundary but for what has not died out. As many footsteps are taken as the
    start has left before it fails, up to a few.
    """
    attractor = labelling.family.rows[0][0]

    def arrival(point: Any) -> tuple[Any, Any]:
        came = jb.return_map(labelling.scene, jb.State(jnp.zeros(()), *point), engine="lanes")
        after = jnp.stack(came.state[1:])
        return after, (after, came.code)

    many = jax.jit(jax.vmap(jax.jacfwd(arrival, has_aux=True)))

    def normal(points: np.ndarray) -> np.ndarray:
        count, size = points.shape
        # Always as many rows, so that nothing is compiled again.
        at = np.concatenate([points, np.repeat(points[-1:], max(0, ROWS - count), axis=0)])
        on, walked = np.ones(len(at), dtype=bool), np.zeros(len(at), dtype=int)
        slopes = np.broadcast_to(np.eye(size), (len(at), size, size)).copy()
        for _ in range(MOST_FOOTSTEPS):
            change, (after, code) = jax.tree.map(np.asarray, many(at))
            on = on & (code == 0) & np.isfinite(change).all(axis=(1, 2))
            slopes[on] = change[on] @ slopes[on]
            at[on] = after[on]
            walked += on
        squared = attractor.metric.T @ attractor.metric
        gradients = np.einsum("ni,nij->nj", (at - attractor.point) @ squared, slopes)
        return np.where(walked[:, None] > 0, gradients, np.nan)[:count]

    return normal
