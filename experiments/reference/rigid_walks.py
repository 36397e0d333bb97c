"""Walks of the rigid walker, many at once: small steps of DOP853, and events found by repeating the
step in which they lie."""

from typing import Any, NamedTuple

import numpy as np
from scipy.integrate._ivp import dop853_coefficients as table

from .rigid import RigidWalker, rigid_walker

_STEP = 0.04
"""Length of a step, in units of √(l/g)."""


class RigidWalks(NamedTuple):
    """Times of heel strikes (n, k), infinite beyond the last; angles and rates after (n, k, 4);
    times of falls (n,), infinite without one; angles and rates when the walk ended (n, 4)."""

    strikes: np.ndarray
    after: np.ndarray
    falls: np.ndarray
    last: np.ndarray


def rigid_walks(
    scene: Any, states: Any, footsteps: int, *, duration: float = 10.0, **options: Any
) -> RigidWalks:
    """Follows states until they fall, have walked the footsteps, or a time in √(l/g) is over.

    Args:
        scene: of jaxbiped's, whose numbers are used.
        states: hip x, θ1, θ2, ω1 and ω2, numbers or arrays (n,).
        footsteps: at most.
        duration: at most, in √(l/g).
        options: of `RigidWalker`.
    """
    walker = rigid_walker(scene, **options)
    y = np.array(np.broadcast_arrays(*[np.atleast_1d(leaf) for leaf in states[1:]]), float)
    count = y.shape[1]
    unit = np.sqrt(walker.l / walker.g)
    t, struck = np.zeros(count), np.zeros(count, int)
    strikes, after = np.full((count, footsteps), np.inf), np.full((count, footsteps, 4), np.nan)
    falls, begins = np.full(count, np.inf), np.zeros(count, bool)
    going = np.arange(count)
    while len(going):
        old, step = y[:, going], np.full(len(going), _STEP * unit)
        new = _step(walker, old, step)
        above = np.where(begins[going], _rate(old) > 0.0, _opening(old) > 0.0)
        # A foot that dips into the ground within the step is asked at the lowest point.
        dips = above & (_rate(old) < 0.0) & (_rate(new) > 0.0)
        end, at = step.copy(), new.copy()
        end[dips] = _lowest(walker, old[:, dips], step[dips])
        at[:, dips] = _step(walker, old[:, dips], end[dips])
        found = np.flatnonzero(above & (_opening(at) <= 0.0))
        root = _root(walker, old[:, found], end[found], _opening, _rate)
        at = _step(walker, old[:, found], root)
        fell = np.flatnonzero(np.abs(new[1]) > 1.0)
        fall = _root(walker, old[:, fell], step[fell], _uprightness, _uprighting)
        ahead = (at[0] > at[1]) & (np.abs(at[1]) < 1.0)
        where, down = found[ahead], going[found[ahead]]
        step[where], new[:, where] = root[ahead], walker.after_impact(at[:, ahead])
        first = ~np.isin(fell, where)
        step[fell[first]] = fall[first]
        new[:, fell[first]] = _step(walker, old[:, fell[first]], fall[first])
        y[:, going], t[going] = new, t[going] + step
        falls[going[fell[first]]] = t[going[fell[first]]]
        strikes[down, struck[down]], after[down, struck[down]] = t[down], y[:, down].T
        struck[down] += 1
        begins[:] = False
        begins[down] = True
        over = (struck >= footsteps) | np.isfinite(falls) | (t > duration * unit)
        going = going[~over[going]]
    return RigidWalks(strikes, after, falls, y.T)


def _step(walker: RigidWalker, y: np.ndarray, length: np.ndarray) -> np.ndarray:
    stages = [walker.rates(y)]
    for row in table.A[1:12]:
        moved = sum(w * k for w, k in zip(row, stages, strict=False) if w)
        stages.append(walker.rates(y + length * moved))
    return y + length * sum(w * k for w, k in zip(table.B, stages, strict=True) if w)


def _opening(y):
    return y[0] + y[1]


def _rate(y):
    return y[2] + y[3]


def _uprightness(y):
    return 1.0 - np.abs(y[1])


def _uprighting(y):
    return -np.sign(y[1]) * y[3]


def _lowest(walker, y, step):
    """Where within a step an opening that falls first turns."""
    time = 0.5 * step
    for _ in range(6 if len(step) else 0):
        at = _step(walker, y, time)
        time = np.clip(time - _rate(at) / walker.rates(at)[2:].sum(axis=0), 0.0, step)
    return time


def _root(walker, y, step, value, rate):
    """Where within a step a value falls through zero, by Newton's method within a bracket."""
    low, high, time = np.zeros_like(step), step, 0.5 * step
    for _ in range(50 if len(step) else 0):
        at = _step(walker, y, time)
        if np.all(np.abs(value(at)) <= 1e-14):
            break
        left = value(at) > 0.0
        low, high = np.where(left, time, low), np.where(left, high, time)
        with np.errstate(divide="ignore"):
            newton = time - value(at) / rate(at)
        inside = (newton > low) & (newton < high)
        time = np.where(inside, newton, 0.5 * (low + high))
    return time
