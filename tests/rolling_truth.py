"""Walks of the rigid walker a second time, many at once: own equations in NumPy, small steps of
DOP853, and events found by repeating the step in which they lie."""

from typing import NamedTuple

import numpy as np
from scipy.integrate._ivp import dop853_coefficients as table

_STEP = 0.04
"""Length of a step, in units of √(l/g)."""


class Walks(NamedTuple):
    """Times of heel strikes (n, k), infinite beyond the last; angles and rates after (n, k, 4);
    times of falls (n,), infinite without one; angles and rates when the walk ended (n, 4)."""

    strikes: np.ndarray
    after: np.ndarray
    falls: np.ndarray
    last: np.ndarray


def walks(scene, states, footsteps, *, torque=None, push_off=0.0, duration=10.0):
    """Follows states until they fall, have walked the footsteps, or a time in √(l/g) is over.

    `torque` of (θ1, θ2, ω1, ω2) acts on leg 1, its opposite on leg 2.
    """
    walker = _Walker(scene, torque, push_off)
    y = np.array(np.broadcast_arrays(*[np.atleast_1d(leaf) for leaf in states[1:]]), float)
    count = y.shape[1]
    unit = np.sqrt(walker.l / walker.g)
    t, struck = np.zeros(count), np.zeros(count, int)
    strikes, after = np.full((count, footsteps), np.inf), np.full((count, footsteps, 4), np.nan)
    falls, begins = np.full(count, np.inf), np.zeros(count, bool)
    going = np.arange(count)
    while len(going):
        old, step = y[:, going], np.full(len(going), _STEP * unit)
        new = walker.step(old, step)
        above = np.where(begins[going], _rate(old) > 0.0, _opening(old) > 0.0)
        # A foot that dips into the ground within the step is asked at the lowest point.
        dips = above & (_rate(old) < 0.0) & (_rate(new) > 0.0)
        end, at = step.copy(), new.copy()
        end[dips] = _lowest(walker, old[:, dips], step[dips])
        at[:, dips] = walker.step(old[:, dips], end[dips])
        found = np.flatnonzero(above & (_opening(at) <= 0.0))
        root = _root(walker, old[:, found], end[found], _opening, _rate)
        at = walker.step(old[:, found], root)
        fell = np.flatnonzero(np.abs(new[1]) > 1.0)
        fall = _root(walker, old[:, fell], step[fell], _uprightness, _uprighting)
        ahead = (at[0] > at[1]) & (np.abs(at[1]) < 1.0)
        where, down = found[ahead], going[found[ahead]]
        step[where], new[:, where] = root[ahead], walker.impact(at[:, ahead])
        first = ~np.isin(fell, where)
        step[fell[first]] = fall[first]
        new[:, fell[first]] = walker.step(old[:, fell[first]], fall[first])
        y[:, going], t[going] = new, t[going] + step
        falls[going[fell[first]]] = t[going[fell[first]]]
        strikes[down, struck[down]], after[down, struck[down]] = t[down], y[:, down].T
        struck[down] += 1
        begins[:] = False
        begins[down] = True
        over = (struck >= footsteps) | np.isfinite(falls) | (t > duration * unit)
        going = going[~over[going]]
    return Walks(strikes, after, falls, y.T)


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
        at = walker.step(y, time)
        time = np.clip(time - _rate(at) / walker.rates(at)[2:].sum(axis=0), 0.0, step)
    return time


def _root(walker, y, step, value, rate):
    """Where within a step a value falls through zero, by Newton's method within a bracket."""
    low, high, time = np.zeros_like(step), step, 0.5 * step
    for _ in range(50 if len(step) else 0):
        at = walker.step(y, time)
        if np.all(np.abs(value(at)) <= 1e-14):
            break
        left = value(at) > 0.0
        low, high = np.where(left, time, low), np.where(left, high, time)
        with np.errstate(divide="ignore"):
            newton = time - value(at) / rate(at)
        inside = (newton > low) & (newton < high)
        time = np.where(inside, newton, 0.5 * (low + high))
    return time


class _Walker:
    def __init__(self, scene, torque, push_off):
        self.m, self.J, self.l, self.d, self.r = (
            float(getattr(scene.walker, name)) for name in "mJldr"
        )
        self.hip, self.slope = float(scene.walker.hip_mass), float(scene.ground.slope)
        self.g, self.torque, self.push_off = float(scene.ground.g), torque, push_off

    def rates(self, y):
        """Of angles and rates: velocities by the rates, d'Alembert's principle for both of them."""
        swing, stance, of_swing, of_stance = y
        reach, m, d = self.l - self.r, self.m, self.d
        pull = self.g * np.array([np.sin(self.slope), -np.cos(self.slope)])[:, None]
        along = lambda angle: np.array([np.cos(angle), np.sin(angle)])
        inward = lambda angle: np.array([-np.sin(angle), np.cos(angle)])
        hip = -reach * along(stance) - self.r * np.array([[1.0], [0.0]])
        bend = -reach * inward(stance) * of_stance**2
        centre, own = d * along(swing), hip + d * along(stance)
        parts = (
            (self.hip, 0.0 * hip, hip, bend),
            (m, centre, hip, bend + d * inward(swing) * of_swing**2),
            (m, 0.0 * hip, own, bend + d * inward(stance) * of_stance**2),
        )
        dot = lambda a, b: (a * b).sum(axis=0)
        a = sum(mass * dot(u, u) for mass, u, _, _ in parts) + self.J
        b = sum(mass * dot(u, v) for mass, u, v, _ in parts)
        c = sum(mass * dot(v, v) for mass, _, v, _ in parts) + self.J
        first = sum(mass * dot(u, pull - rest) for mass, u, _, rest in parts)
        second = sum(mass * dot(v, pull - rest) for mass, _, v, rest in parts)
        if self.torque is not None:
            first, second = first + self.torque(y), second - self.torque(y)
        whole = a * c - b * b
        alpha_1, alpha_2 = c * first - b * second, a * second - b * first
        return np.array([of_swing, of_stance, alpha_1 / whole, alpha_2 / whole])

    def step(self, y, length):
        stages = [self.rates(y)]
        for row in table.A[1:12]:
            moved = sum(w * k for w, k in zip(row, stages, strict=False) if w)
            stages.append(self.rates(y + length * moved))
        return y + length * sum(w * k for w, k in zip(table.B, stages, strict=True) if w)

    def impact(self, y):
        """Momenta of (hip x, hip z, θ1, θ2) change by an impulse that makes foot 1 roll."""
        reach, count = self.l - self.r, y.shape[1]
        matrix = np.zeros((count, 6, 6))
        matrix[:, 0, 0] = matrix[:, 1, 1] = self.hip + 2.0 * self.m
        matrix[:, 2, 2] = matrix[:, 3, 3] = self.J + self.m * self.d**2
        for i, angle in enumerate(y[:2]):
            for j, part in enumerate((np.cos(angle), np.sin(angle))):
                matrix[:, j, 2 + i] = matrix[:, 2 + i, j] = self.m * self.d * part
        hip = [-(reach * np.cos(y[1]) + self.r) * y[3], -reach * np.sin(y[1]) * y[3]]
        momenta = np.einsum("nij,jn->ni", matrix[:, :4, :4], np.array([*hip, y[2], y[3]]))
        momenta += self.push_off * np.stack([-np.sin(y[1]), np.cos(y[1]), 0 * y[0], 0 * y[0]], 1)
        rows = np.zeros((count, 2, 4))
        rows[:, 0, 0] = rows[:, 1, 1] = 1.0
        rows[:, 0, 2], rows[:, 1, 2] = reach * np.cos(y[0]) + self.r, reach * np.sin(y[0])
        matrix[:, 4:, :4], matrix[:, :4, 4:] = rows, -rows.transpose(0, 2, 1)
        wanted = np.concatenate([momenta, np.zeros((count, 2))], axis=1)[..., None]
        found = np.linalg.solve(matrix, wanted)[..., 0]
        return np.array([y[1], y[0], found[:, 3], found[:, 2]])
