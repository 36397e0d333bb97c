"""The seed's walker written a second time, from the equations alone, for SciPy's integrators.

Nothing here is shared with the package: plain Python, a 4 × 4 mass matrix solved by NumPy.
"""

import functools
import itertools
import math

import numpy as np
from scipy.integrate import solve_ivp

SEED = dict(
    m=1.0,
    J=0.0096,
    l=0.40,
    d=0.10,
    r=0.08,
    hip=0.0,
    g=9.8,
    slope=0.02,
    n=1.5,
    K=1e6,
    c=1e7,
    mu_s=0.5,
    mu_k=0.4,
    v0=1e-4,
    xi=1000.0,
)
START = np.array([0.0, 0.395, -0.2479, 0.1655, 0.49797, 0.05853, -0.0052, -1.2565])


def normal_force(depth, rate, p):
    """The seed's normal law."""
    if depth <= 0.0:
        return 0.0
    return max(0.0, p["K"] * depth ** p["n"] + p["c"] * depth * rate)


def friction_force(normal, slip, p):
    """Bengisu and Akay's law, as corrected, opposing the slip."""
    static, kinetic, s = p["mu_s"] * normal, p["mu_k"] * normal, abs(slip)
    if s < p["v0"]:
        size = static - static / p["v0"] ** 2 * (s - p["v0"]) ** 2
    else:
        size = kinetic + (static - kinetic) * math.exp(-p["xi"] * (s - p["v0"]))
    return -math.copysign(size, slip)


def derivative(_, y, p):
    """Time derivative of (x, z, θ1, θ2 and their rates)."""
    _, _, a1, a2, vx, vz, w1, w2 = (float(value) for value in y)
    total = 2 * p["m"] + p["hip"]
    mass = np.diag([total, total, p["J"] + p["m"] * p["d"] ** 2, p["J"] + p["m"] * p["d"] ** 2])
    force = np.array(
        [
            total * p["g"] * math.sin(p["slope"]),
            -total * p["g"] * math.cos(p["slope"]),
            0.0,
            0.0,
        ]
    )
    length = p["l"] - p["r"]
    for i, (a, w) in enumerate(((a1, w1), (a2, w2))):
        k, sine, cosine, md = 2 + i, math.sin(a), math.cos(a), p["m"] * p["d"]
        mass[0, k] = mass[k, 0] = md * cosine
        mass[1, k] = mass[k, 1] = md * sine
        force[0] += md * sine * w * w
        force[1] -= md * cosine * w * w
        force[k] += md * p["g"] * math.sin(p["slope"] - a)
        normal, friction = contact(y, i, p)[2:]
        force[0] += friction
        force[1] += normal
        force[k] += normal * length * sine + friction * (length * cosine + p["r"])
    return np.concatenate([[vx, vz, w1, w2], np.linalg.solve(mass, force)])


def contact(y, leg, p):
    """Rate of penetration, slip, and forces normal and along the ground, of a leg's foot."""
    length, a, w = p["l"] - p["r"], float(y[2 + leg]), float(y[6 + leg])
    depth = p["r"] - (float(y[1]) - length * math.cos(a))
    if leg == 0:
        depth -= p.get("drop", 0.0)
    rate = -(float(y[5]) + length * math.sin(a) * w)
    slip = float(y[4]) + (length * math.cos(a) + p["r"]) * w
    normal = normal_force(depth, rate, p) if w < 0.0 else 0.0
    return rate, slip, normal, friction_force(normal, slip, p)


@functools.cache
def _reference():
    solution = solve_ivp(
        derivative,
        (0.0, 2.0),
        START,
        "Radau",
        np.linspace(0.0, 2.0, 41),
        args=(SEED,),
        rtol=1e-11,
        atol=1e-13,
        dense_output=True,
    )
    assert solution.success
    return solution


def reference_states():
    """Times and states (n, 8) of the seed's walk over 2 s, by SciPy's Radau at 1e-11."""
    return _reference().t, _reference().y.T


def mechanical_energies(y, p):
    """Kinetic, gravitational and elastic energy at a state."""
    _, _, a1, a2, vx, vz, w1, w2 = map(float, y)
    kinetic, height = 0.5 * p["hip"] * (vx**2 + vz**2), p["hip"] * _rise(y[0], y[1], p)
    elastic = 0.0
    for leg, (a, w) in enumerate(((a1, w1), (a2, w2))):
        x, z = y[0] + p["d"] * math.sin(a), y[1] - p["d"] * math.cos(a)
        u, v = vx + p["d"] * math.cos(a) * w, vz + p["d"] * math.sin(a) * w
        kinetic += 0.5 * (p["m"] * (u**2 + v**2) + p["J"] * w**2)
        height += p["m"] * _rise(x, z, p)
        depth = p["r"] - (y[1] - (p["l"] - p["r"]) * math.cos(a))
        if contact(y, leg, p)[2] > 0.0:
            elastic += p["K"] * depth ** (p["n"] + 1.0) / (p["n"] + 1.0)
    return kinetic, p["g"] * height, elastic


def _rise(x, z, p):
    return z * math.cos(p["slope"]) - x * math.sin(p["slope"])


def reference_works():
    """The energy ledger of the same walk, by quadrature over the steps of the same solve [J]."""
    steps = _reference().sol.ts
    nodes, weights = np.polynomial.legendre.leggauss(4)
    indentation = friction = 0.0
    for begin, end in itertools.pairwise(steps):
        half = 0.5 * (end - begin)
        for y, weight in zip(
            _reference().sol(begin + half * (1.0 + nodes)).T, weights, strict=True
        ):
            for leg in range(2):
                rate, slip, normal, along = contact(y, leg, SEED)
                indentation += half * weight * normal * rate
                friction -= half * weight * along * slip
    ends = [mechanical_energies(_reference().sol(t), SEED) for t in steps[[0, -1]]]
    kinetic, potential, elastic = np.subtract(ends[1], ends[0])
    return {
        "gravity_work": -potential,
        "damper_loss": indentation - elastic,
        "friction_loss": friction,
        "stored_change": kinetic + elastic,
    }
