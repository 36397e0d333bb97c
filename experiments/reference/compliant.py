"""Equations of motion of the compliant walker, from plain numbers.

Written from the equations alone: Lagrange's, with all four coordinates in one mass matrix, and the
laws of contact from their sources. Compiled where numba is installed.
"""

import importlib
import importlib.util
import math
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """The function, compiled where numba is installed."""
    if importlib.util.find_spec("numba") is None:
        return function
    return importlib.import_module("numba").njit(error_model="numpy")(function)


NORMAL = (
    "hertz",
    "kelvin-voigt",
    "kuwabara-kono",
    "tsuji",
    "hunt-crossley",
    "ristow-schafer",
    "smooth-ristow-schafer",
)
FRICTION = (
    "frictionless",
    "viscous",
    "coulomb",
    "threlfall",
    "ambrosio",
    "stribeck",
    "bengisu-akay",
    "smooth-bengisu-akay",
    "andersson",
    "brown-mcphee",
    "dahl",
    "lugre",
)
"""Laws by name; a law's number is its place here."""
WALKER, NORMAL_AT, FRICTION_AT, SIZE = 9, 9, 15, 24
"""Numbers of a walker on its slope, m, J, l, d, r, m_S, g, slope and whether a swinging foot clears
the ground; then where the laws begin, each its number and its parameters; and how many in all."""


@compiled
def ramp(x: float, width: float) -> float:
    """Zero up to 0, x from `width` on, and twice continuously differentiable in between."""
    if x <= 0.0:
        return 0.0
    if x >= width:
        return x
    t = x / width
    return x * t**3 * (10.0 - 15.0 * t + 6.0 * t * t)


@compiled
def normal_force(depth: float, rate: float, law: np.ndarray) -> float:
    """Force along the ground's normal [N]; `law` its number and its parameters."""
    if depth <= 0.0:
        return 0.0
    kind, stiffness = int(law[0]), law[1]
    if kind == 0:
        force = stiffness * depth ** law[2]
    elif kind == 1:
        force = stiffness * depth + law[2] * rate
    elif kind == 2:
        force = stiffness * depth**1.5 + law[2] * math.sqrt(depth) * rate
    elif kind == 3:
        force = stiffness * depth**1.5 + law[2] * depth**0.25 * rate
    elif kind == 4:
        force = stiffness * depth ** law[3] * (1.0 + law[2] * rate)
    elif kind == 5:
        force = stiffness * depth ** law[3] + law[2] * depth * rate
    else:
        soft = ramp(depth, law[4])
        force = ramp(stiffness * soft ** law[3] + law[2] * soft * rate, law[5])
    return max(force, 0.0)


@compiled
def fallen(static: float, kinetic: float, speed: float, scale: float, exponent: float) -> float:
    """A coefficient that falls from static to kinetic over a scale of speed."""
    return kinetic + (static - kinetic) * math.exp(-((speed / scale) ** exponent))


@compiled
def friction_share(normal: float, slip: float, bent: float, law: np.ndarray) -> tuple[float, float]:
    """Friction against the slip over the normal force, and the rate of a bristle in contact."""
    kind, a, b, c, d = int(law[0]), law[1], law[2], law[3], law[4]
    s = abs(slip)
    way = 0.0 if slip == 0.0 else math.copysign(1.0, slip)
    if kind == 1:
        return a * slip, 0.0
    if kind == 2:
        return a * math.tanh(slip / b), 0.0
    if kind == 3:
        return way * a * (1.0 - math.exp(-3.0 * min(s, b) / b)), 0.0
    if kind == 4:
        return way * a * min(max((s - b) / (c - b), 0.0), 1.0), 0.0
    if kind == 5:
        return fallen(a, b, s, c, d) * math.tanh(slip / law[6]) + law[5] * slip, 0.0
    if kind == 6:
        if s < c:
            return way * (a - a * ((s - c) / c) ** 2), 0.0
        return way * (b + (a - b) * math.exp(-d * (s - c))), 0.0
    if kind == 7:
        u = min(s / c, 1.0)
        level = b + (a - b) * math.exp(-d * ramp(s - c, c))
        return way * level * (15.0 * u - 10.0 * u**3 + 3.0 * u**5) / 8.0, 0.0
    if kind == 8:
        return fallen(a, b, s, c, d) * math.tanh(law[5] * slip), 0.0
    if kind == 9:
        u = slip / c
        return b * math.tanh(4.0 * u) + (a - b) * u / (0.25 * u * u + 0.75) ** 2, 0.0
    if kind == 10:
        return bent, b * (slip - s * bent / a)
    if kind == 11:
        steady = b + (a - b) * math.exp(-((slip / c) ** 2))
        moved = slip - s * bent / steady
        return bent + law[5] * moved + law[6] * slip, d * moved
    return 0.0, 0.0


@compiled
def derivative(t: float, y: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Time derivative of x, z, θ1, θ2, their rates, and the bristles' shares where there are any.

    SI units; `p` are the numbers that `WALKER` and its like describe, shape (SIZE,).
    """
    m, inertia, md = p[0], p[1] + p[0] * p[3] * p[3], p[0] * p[3]
    reach, radius, gravity, slope = p[2] - p[4], p[4], p[6], p[7]
    total = 2.0 * m + p[5]
    matrix, push = np.zeros((4, 4)), np.zeros(4)
    matrix[0, 0] = matrix[1, 1] = total
    push[0] = total * gravity * math.sin(slope)
    push[1] = -total * gravity * math.cos(slope)
    out = np.zeros(y.size)
    for i in range(2):
        angle, rate, k = y[2 + i], y[6 + i], 2 + i
        sine, cosine = math.sin(angle), math.cos(angle)
        matrix[k, k] = inertia
        matrix[0, k] = matrix[k, 0] = md * cosine
        matrix[1, k] = matrix[k, 1] = md * sine
        push[0] += md * sine * rate * rate
        push[1] -= md * cosine * rate * rate
        push[k] += md * gravity * math.sin(slope - angle)
        depth = radius - y[1] + reach * cosine
        sinking = -(y[5] + reach * sine * rate)
        slip = y[4] + (reach * cosine + radius) * rate
        load = 0.0
        if p[8] == 0.0 or rate < 0.0:
            load = normal_force(depth, sinking, p[9:15])
        bent = y[8 + i] if y.size > 8 else 0.0
        share, bending = friction_share(load, slip, bent, p[15:24])
        friction = -share * load
        push[0] += friction
        push[1] += load
        push[k] += load * reach * sine + friction * (reach * cosine + radius)
        if y.size > 8:
            kind = int(p[15])
            engaging, relaxation = (p[18], p[19]) if kind == 10 else (p[22], p[23])
            held = load / (load + engaging)
            out[8 + i] = held * bending - (1.0 - held) * relaxation * bent
    out[:4] = y[4:8]
    out[4:8] = np.linalg.solve(matrix, push)
    return out


@compiled
def jacobian(t: float, y: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Derivatives of `derivative` with respect to y, shape (n, n), by differences.

    Their steps resolve how deep feet stand and the slip speed over which friction builds up, which
    those that LSODA takes by itself may not.
    """
    kind, slow = int(p[15]), 1.0
    if kind == 2 or kind == 3 or kind == 4:
        slow = p[17]
    elif kind == 5:
        slow = p[21]
    elif kind == 6 or kind == 7 or kind == 9:
        slow = p[18]
    elif kind == 8:
        slow = 1.0 / p[20]
    base, out = derivative(t, y, p), np.zeros((y.size, y.size))
    for k in range(y.size):
        unit = p[2] if k < 2 else 1.0
        step = 1e-10 * unit if k < 4 or k > 7 else min(1e-8, 1e-3 * slow)
        moved = y.copy()
        moved[k] += step
        out[:, k] = (derivative(t, moved, p) - base) / (moved[k] - y[k])
    return out
