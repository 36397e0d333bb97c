"""The seed's gait found a second time: equations of motion in numba, SciPy's Radau, differences.

Nothing here is shared with the package. Derivatives are central differences of converged solves.
"""

import functools
import math

import numba
import numpy as np
from scipy.integrate import solve_ivp

from tests.reference import SEED

NAMES = ("m", "J", "l", "d", "r", "hip", "g", "slope", "n", "K", "c", "mu_s", "mu_k", "v0", "xi")
TOLERANCE = 2e-12


@numba.njit(cache=False)
def _rates(y, p):
    m, J, length, d, r, hip, g, slope, n, K, c, mu_s, mu_k, v0, xi = p
    total = 2 * m + hip
    mass = np.zeros((4, 4))
    force = np.zeros(4)
    mass[0, 0] = mass[1, 1] = total
    force[0], force[1] = total * g * math.sin(slope), -total * g * math.cos(slope)
    reach = length - r
    for i in range(2):
        a, w, k = y[2 + i], y[6 + i], 2 + i
        sine, cosine, md = math.sin(a), math.cos(a), m * d
        mass[k, k] = J + m * d * d
        mass[0, k] = mass[k, 0] = md * cosine
        mass[1, k] = mass[k, 1] = md * sine
        force[0] += md * sine * w * w
        force[1] -= md * cosine * w * w
        force[k] += md * g * math.sin(slope - a)
        depth, rate = r - (y[1] - reach * cosine), -(y[5] + reach * sine * w)
        normal = 0.0
        if depth > 0.0 and w < 0.0:
            normal = max(0.0, K * depth**n + c * depth * rate)
        slip = y[4] + (reach * cosine + r) * w
        s = abs(slip)
        if s < v0:
            size = mu_s * normal * (1.0 - ((s - v0) / v0) ** 2)
        else:
            size = normal * (mu_k + (mu_s - mu_k) * math.exp(-xi * (s - v0)))
        friction = -math.copysign(size, slip)
        force[0] += friction
        force[1] += normal
        force[k] += normal * reach * sine + friction * (reach * cosine + r)
    return np.concatenate((y[4:], np.linalg.solve(mass, force))), max(0.0, normal)


@numba.njit(cache=False)
def _field(t, y, p):
    return _rates(y, p)[0]


@numba.njit(cache=False)
def _load(y, p):
    """The larger normal force: by exchanging the legs, each is the last one once."""
    swapped = y.copy()
    swapped[2], swapped[3], swapped[6], swapped[7] = y[3], y[2], y[7], y[6]
    return max(_rates(y, p)[1], _rates(swapped, p)[1])


def parameters(**changes):
    return np.array([{**SEED, **changes}[name] for name in NAMES])


def turn(x, p):
    """One footstep from mid-stance (z, θ1, θ2 and rates): the next, period, length and peak."""

    def passes(t, y):
        return y[2] + (1.0 if t < 0.25 else 0.0)  # leg 1 in its turn as the standing leg

    passes.terminal, passes.direction = True, -1
    solution = solve_ivp(
        lambda t, y: _field(t, y, p),
        (0.0, 1.0),
        np.concatenate([[0.0], x]),
        "Radau",
        rtol=TOLERANCE,
        atol=TOLERANCE * 1e-2,
        events=passes,
        dense_output=True,
    )
    y, period = solution.y_events[0][0], solution.t_events[0][0]
    loads = [_load(each, p) for each in solution.y.T]
    k = int(np.argmax(loads))
    around = np.linspace(solution.t[k - 1], solution.t[k + 1], 9)
    fit = np.polyfit(around - solution.t[k], [_load(solution.sol(t), p) for t in around], 6)
    inner = np.linspace(around[0], around[-1], 4001) - solution.t[k]
    peak = np.max(np.polyval(fit, inner))
    return y[[1, 3, 2, 4, 5, 7, 6]], np.array([period, y[0], y[0] / period, peak])


@functools.cache
def jacobian(start):
    """Derivative of `turn` at the seed's parameters, by central differences, (7, 7)."""
    x, p, h = np.array(start), parameters(), 1e-5
    return np.stack(
        [(turn(x + h * e, p)[0] - turn(x - h * e, p)[0]) / (2 * h) for e in np.eye(7)], axis=1
    )


def gait(start, p):
    """The fixed point near `start`, and the measures there."""
    x, slope = np.array(start), jacobian(start) - np.eye(7)
    for _ in range(12):
        reached, measures = turn(x, p)
        step = np.linalg.solve(slope, reached - x)
        x = x - step
        if np.max(np.abs(step)) < 1e-11:
            break
    return x, measures


def sensitivities(start, name, h):
    """d(state, measures)/d log(parameter) by central differences of order four."""

    def at(change):
        return np.concatenate(gait(start, parameters(**{name: SEED[name] * (1 + change)})))

    return (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)
