"""The seed's walker written a second time, from the equations alone, for SciPy's integrators.

Nothing here is shared with the package: plain Python, a 4 × 4 mass matrix solved by NumPy.
"""

import functools
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
    _, z, a1, a2, vx, vz, w1, w2 = (float(value) for value in y)
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
        depth, rate = p["r"] - (z - length * cosine), -(vz + length * sine * w)
        normal = normal_force(depth, rate, p) if w < 0.0 else 0.0
        friction = friction_force(normal, vx + (length * cosine + p["r"]) * w, p)
        force[0] += friction
        force[1] += normal
        force[k] += normal * length * sine + friction * (length * cosine + p["r"])
    return np.concatenate([[vx, vz, w1, w2], np.linalg.solve(mass, force)])


@functools.cache
def reference_states():
    """Times and states (n, 8) of the seed's walk over 2 s, by SciPy's Radau at 1e-11."""
    times = np.linspace(0.0, 2.0, 41)
    solution = solve_ivp(
        derivative, (0.0, 2.0), START, "Radau", times, args=(SEED,), rtol=1e-11, atol=1e-13
    )
    assert solution.success
    return times, solution.y.T
