"""Equations of motion of the compliant walker, from plain numbers.

Written from the equations alone: Newton's and Euler's with the hip eliminated, where the package
eliminates the legs, and the laws of contact from their sources. Compiled where numba is installed;
`precise_solves` runs the same code on numbers of 40 digits.
"""

import importlib
import importlib.util
import math
import types
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """The function, compiled where numba is installed; kept on disk if it needs this file alone."""
    if importlib.util.find_spec("numba") is None:
        return function
    cached = function.__module__ == __name__
    return importlib.import_module("numba").njit(error_model="numpy", cache=cached)(function)


def on_numbers(**numpy: Any) -> dict[str, Callable[..., Any]]:
    """This module's functions on other numbers: `numpy` are what they take from NumPy, by name."""
    names = dict(globals()) | {"np": types.SimpleNamespace(**numpy)}
    for name, function in globals().items():
        code = getattr(getattr(function, "py_func", function), "__code__", None)
        if code is not None:
            names[name] = types.FunctionType(code, names)
    return names


NORMAL = (
    "hertz", "kelvin-voigt", "kuwabara-kono", "tsuji", "hunt-crossley", "ristow-schafer",
    "smooth-ristow-schafer",
)  # fmt: skip
FRICTION = (
    "frictionless", "viscous", "coulomb", "threlfall", "ambrosio", "stribeck", "bengisu-akay",
    "smooth-bengisu-akay", "andersson", "brown-mcphee", "dahl", "lugre",
)  # fmt: skip
"""Laws by name; a law's number is its place here."""
NORMAL_AT, FRICTION_AT, DROP, SIZE = 9, 15, 24, 25
"""Numbers of a walker on its slope: m, J, l, d, r, m_S, gravity along the slope and along its
normal, and whether a swinging foot clears the ground; from these places on the laws, each its
number and its parameters; how much lower the ground is under leg 1; and how many in all."""
SEED = dict(
    m=1.0, J=0.0096, l=0.40, d=0.10, r=0.08, hip_mass=0.0, g=9.8, slope=0.02,
    K=1e6, c=1e7, n=1.5, mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1000.0,
)  # fmt: skip
START = np.array([0.0, 0.395, -0.2479, 0.1655, 0.49797, 0.05853, -0.0052, -1.2565])
"""The seed's start: hip x, hip z, θ1, θ2 and their rates [SI]."""
LAWS_AT = {"K": 10, "c": 11, "n": 12, "mu_static": 16, "mu_kinetic": 17, "v0": 18, "xi": 19}
"""Places of the parameters of the seed's laws."""


def numbers(*, drop: float = 0.0, **changes: float) -> np.ndarray:
    """Numbers of the seed's walker under its own laws, some parameters changed, shape (SIZE,)."""
    assert changes.keys() <= SEED.keys(), changes
    given = SEED | changes
    p = np.zeros(SIZE)
    p[:6] = [given[name] for name in ("m", "J", "l", "d", "r", "hip_mass")]
    p[6:9] = *gravity(given["g"], given["slope"]), 1.0
    p[NORMAL_AT], p[FRICTION_AT] = NORMAL.index("ristow-schafer"), FRICTION.index("bengisu-akay")
    for name, place in LAWS_AT.items():
        p[place] = given[name]
    p[DROP] = drop
    return p


def gravity(g: float, slope: float) -> tuple[float, float]:
    """Gravity along a slope and along its normal [m/s²]."""
    return g * math.sin(slope), -g * math.cos(slope)


@compiled
def power(x: float, exponent: float) -> float:
    """A power, the seed's by a root."""
    return x * np.sqrt(x) if exponent == 1.5 else x**exponent


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
        force = stiffness * power(depth, law[2])
    elif kind == 1:
        force = stiffness * depth + law[2] * rate
    elif kind == 2:
        force = stiffness * depth**1.5 + law[2] * np.sqrt(depth) * rate
    elif kind == 3:
        force = stiffness * depth**1.5 + law[2] * depth**0.25 * rate
    elif kind == 4:
        force = stiffness * power(depth, law[3]) * (1.0 + law[2] * rate)
    elif kind == 5:
        force = stiffness * power(depth, law[3]) + law[2] * depth * rate
    else:
        soft = ramp(depth, law[4])
        force = ramp(stiffness * soft ** law[3] + law[2] * soft * rate, law[5])
    return max(force, 0.0)


@compiled
def fallen(static: float, kinetic: float, speed: float, scale: float, exponent: float) -> float:
    """A coefficient that falls from static to kinetic over a scale of speed."""
    return kinetic + (static - kinetic) * np.exp(-((speed / scale) ** exponent))


@compiled
def friction_share(normal: float, slip: float, bent: float, law: np.ndarray) -> tuple[float, float]:
    """Friction against the slip over the normal force, and the rate of a bristle in contact."""
    kind, a, b, c, d = int(law[0]), law[1], law[2], law[3], law[4]
    s = abs(slip)
    way = 0.0 if slip == 0.0 else np.copysign(1.0, slip)
    if kind == 1:
        return a * slip, 0.0
    if kind == 2:
        return a * np.tanh(slip / b), 0.0
    if kind == 3:
        return way * a * (1.0 - np.exp(-3.0 * min(s, b) / b)), 0.0
    if kind == 4:
        return way * a * min(max((s - b) / (c - b), 0.0), 1.0), 0.0
    if kind == 5:
        return fallen(a, b, s, c, d) * np.tanh(slip / law[6]) + law[5] * slip, 0.0
    if kind == 6:
        if s < c:
            return way * (a - a * ((s - c) / c) ** 2), 0.0
        return way * (b + (a - b) * np.exp(-d * (s - c))), 0.0
    if kind == 7:
        u = min(s / c, 1.0)
        level = b + (a - b) * np.exp(-d * ramp(s - c, c))
        return way * level * (15.0 * u - 10.0 * u**3 + 3.0 * u**5) / 8.0, 0.0
    if kind == 8:
        return fallen(a, b, s, c, d) * np.tanh(law[5] * slip), 0.0
    if kind == 9:
        u = slip / c
        dry = b * np.tanh(4.0 * u) + (a - b) * u / (0.25 * u * u + 0.75) ** 2
        return dry + (d * slip * np.tanh(4.0 * normal / law[5]) / normal if d > 0.0 else 0.0), 0.0
    if kind == 10:
        return bent, b * (slip - s * bent / a)
    if kind == 11:
        steady = b + (a - b) * np.exp(-((slip / c) ** 2))
        moved = slip - s * bent / steady
        return bent + law[5] * moved + law[6] * slip, d * moved
    return 0.0, 0.0


@compiled
def foot(y: np.ndarray, leg: int, p: np.ndarray) -> tuple[float, float, float]:
    """Depth of a foot, the rate at which it sinks in, and the velocity at which it slips."""
    sine, cosine, rate = np.sin(y[2 + leg]), np.cos(y[2 + leg]), y[6 + leg]
    reach = p[2] - p[4]
    depth = p[4] - y[1] + reach * cosine
    if leg == 0:
        depth -= p[24]
    return depth, -(y[5] + reach * sine * rate), y[4] + (reach * cosine + p[4]) * rate


@compiled
def contact(y: np.ndarray, leg: int, p: np.ndarray) -> tuple[float, float, float]:
    """Forces on a foot along the slope and along its normal [N], and the rate of its bristle."""
    depth, sinking, slip = foot(y, leg, p)
    normal, friction, bending = 0.0, 0.0, 0.0
    if p[8] == 0.0 or y[6 + leg] < 0.0:
        normal = normal_force(depth, sinking, p[9:15])
    bent = y[8 + leg] if len(y) > 8 else 0.0
    if normal > 0.0 or len(y) > 8:
        friction, bending = friction_share(normal, slip, bent, p[15:24])
    if len(y) > 8:
        engaging, relaxation = (p[18], p[19]) if int(p[15]) == 10 else (p[22], p[23])
        held = normal / (normal + engaging)
        bending = held * bending - (1.0 - held) * relaxation * bent
    return -friction * normal, normal, bending


@compiled
def accelerations(
    y: np.ndarray,
    p: np.ndarray,
    along: tuple[float, float],
    normal: tuple[float, float],
    torque: tuple[float, float],
) -> tuple[float, float, float, float]:
    """Accelerations of the hip and of both angles, under forces on the feet and hip torques."""
    moment, total, reach = p[0] * p[3], 2.0 * p[0] + p[5], p[2] - p[4]
    s_1, c_1, s_2, c_2 = np.sin(y[2]), np.cos(y[2]), np.sin(y[3]), np.cos(y[3])
    spin_1, spin_2 = moment * y[6] * y[6], moment * y[7] * y[7]
    push_x = total * p[6] + along[0] + along[1] + s_1 * spin_1 + s_2 * spin_2
    push_z = total * p[7] + normal[0] + normal[1] - c_1 * spin_1 - c_2 * spin_2
    turn_1 = torque[0] + moment * (c_1 * p[6] + s_1 * p[7])
    turn_1 += reach * s_1 * normal[0] + (reach * c_1 + p[4]) * along[0]
    turn_2 = torque[1] + moment * (c_2 * p[6] + s_2 * p[7])
    turn_2 += reach * s_2 * normal[1] + (reach * c_2 + p[4]) * along[1]
    # Eliminate the hip, whose block of the mass matrix is `total` times the identity.
    share = moment / total
    turn_1 -= share * (c_1 * push_x + s_1 * push_z)
    turn_2 -= share * (c_2 * push_x + s_2 * push_z)
    own = p[1] + moment * p[3] - share * moment
    mixed = -share * moment * (c_1 * c_2 + s_1 * s_2)
    determinant = own * own - mixed * mixed
    alpha_1 = (own * turn_1 - mixed * turn_2) / determinant
    alpha_2 = (own * turn_2 - mixed * turn_1) / determinant
    ax = (push_x - moment * (c_1 * alpha_1 + c_2 * alpha_2)) / total
    az = (push_z - moment * (s_1 * alpha_1 + s_2 * alpha_2)) / total
    return ax, az, alpha_1, alpha_2


@compiled
def derivative(t: float, y: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Time derivative of x, z, θ1, θ2, their rates, and the bristles' shares where there are any.

    SI units; `p` as by `numbers`.
    """
    along_1, normal_1, bending_1 = contact(y, 0, p)
    along_2, normal_2, bending_2 = contact(y, 1, p)
    out = np.zeros(len(y))
    out[:4] = y[4:8]
    out[4], out[5], out[6], out[7] = accelerations(
        y, p, (along_1, along_2), (normal_1, normal_2), (0.0, 0.0)
    )
    if len(y) > 8:
        out[8], out[9] = bending_1, bending_2
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
