"""The simplest walker written a second time: its published equations in SciPy's hands."""

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

FELL = 1.0
"""Angle of the stance leg [rad] from upright at which the hip has fallen."""
WAIT = 50.0
"""Longest time between two strikes, in units of √(l/g)."""
DEPARTING = 1e-3
"""Time in which the foot behind leaves the ground."""
STABLE = {0.004: (0.153389, -0.156080), 0.009: (0.200310900544287, -0.199832473004977)}
"""Stance angle and rate of the gait after a strike: published at 0.009, a guess at 0.004."""


def fixed_point(slope: float) -> np.ndarray:
    """Stance angle and rate after a strike that repeat themselves, by Newton's method."""
    point = np.array(STABLE[slope])
    for _ in range(20):
        shift = 1e-6
        here = strike_map(point, slope)[0]
        columns = [
            (strike_map(point + shift * e, slope)[0] - strike_map(point - shift * e, slope)[0])
            / (2.0 * shift)
            for e in np.eye(2)
        ]
        step = np.linalg.solve(np.stack(columns, axis=1) - np.eye(2), here - point)
        point = point - step
        if np.max(np.abs(step)) < 1e-10:
            break
    return point


def strike_map(point: np.ndarray, slope: float) -> tuple[np.ndarray, str]:
    """From just after one strike to just after the next: stance angle and rate, or how it ended.

    θ̈ = sin(θ − γ), φ̈ = θ̈ + sin φ (θ̇² − cos(θ − γ)); the swing foot strikes at φ = 2 θ, the leg
    ahead; then θ⁺ = −θ, θ̇⁺ = cos 2θ θ̇, φ⁺ = −2 θ, φ̇⁺ = cos 2θ (1 − cos 2θ) θ̇.
    """

    def rates(t: float, y: np.ndarray) -> list[float]:
        theta, phi, theta_rate, phi_rate = y
        pull = np.sin(theta - slope)
        return [
            theta_rate,
            phi_rate,
            pull,
            pull + np.sin(phi) * (theta_rate**2 - np.cos(theta - slope)),
        ]

    def strike(t: float, y: np.ndarray) -> float:
        return y[1] - 2.0 * y[0]

    def fall(t: float, y: np.ndarray) -> float:
        return FELL - abs(y[0])

    strike.terminal = fall.terminal = True  # type: ignore[attr-defined]
    strike.direction = 1.0  # type: ignore[attr-defined]
    options: dict[str, Any] = dict(rtol=1e-10, atol=1e-12, max_step=0.05, method="DOP853")
    theta, rate = point
    time, y = 0.0, np.array([theta, 2.0 * theta, rate, rate * (1.0 - np.cos(2.0 * theta))])
    while time < WAIT:
        # Departing, and with the leg behind, a foot on the ground is no strike.
        y = solve_ivp(rates, (time, time + DEPARTING), y, **options).y[:, -1]
        time += DEPARTING
        found = solve_ivp(rates, (time, WAIT + 1.0), y, events=(strike, fall), **options)
        time, y = float(found.t[-1]), found.y[:, -1]
        if found.t_events[1].size:
            return y[[0, 2]], "fell forward" if y[0] < 0.0 else "fell back"
        if found.t_events[0].size and y[1] < 0.0:
            return np.array([-y[0], np.cos(2.0 * y[0]) * y[2]]), "strike"
    return y[[0, 2]], "timed out"


def walks(point: np.ndarray, gait: np.ndarray, slope: float, *, footsteps: int) -> bool:
    """Whether a start comes within 1e-4 of the gait in so many footsteps."""
    for _ in range(footsteps):
        point, how = strike_map(point, slope)
        if how != "strike":
            return False
        if np.max(np.abs(point - gait)) < 1e-4:
            return True
    return False
