"""The seed's walker a third time, on one smooth piece of its laws at a time.

Nothing of `jaxbiped` is used, nor of the other independent equations. All functions take complex
numbers, too: their Jacobians are complex steps, which have no cancellation.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

try:
    import numba
except ImportError:
    numba = None

START = np.array([0.0, 0.399354, 0.0959, 0.0, 0.27801, -0.00053, 2.3765, -0.695])
"""Hip x, z, both angles and their rates, leg 2 standing upright (SI)."""
PARAMETERS = ("K", "c", "mu_static", "mu_kinetic")
LAWS = np.array([1e6, 1e7, 0.50, 0.40])
MASS, INERTIA, LENGTH, CENTRE, RADIUS = 1.0, 0.0096, 0.40, 0.10, 0.08
V0, XI = 1e-4, 1000.0
GRAVITY, SLOPE = 9.8, 0.02
FREE, PRESSING, LETTING_GO = 0, 1, 2
"""Pieces of the normal law: no contact, a force, and a clamped one while the foot is still in."""
TINY = 1e-30
"""Complex steps: they have no cancellation."""

compiled: Callable[..., Any] = (lambda function: function) if numba is None else numba.njit


@compiled
def foot(y, leg):
    """Depth of a foot, its rate, and the velocity at which it slips."""
    sine, cosine, rate = np.sin(y[2 + leg]), np.cos(y[2 + leg]), y[6 + leg]
    arm = LENGTH - RADIUS
    depth = RADIUS - y[1] + arm * cosine
    sinking = -y[5] - arm * sine * rate
    return depth, sinking, y[4] + arm * cosine * rate + RADIUS * rate


@compiled
def field(y, laws, pressing, band):
    """Rates of the state where the laws' pieces are given: of complex numbers, too."""
    m, d, arm = MASS, CENTRE, LENGTH - RADIUS
    mass, push = np.zeros((4, 4), y.dtype), np.zeros(4, y.dtype)
    mass[0, 0] = mass[1, 1] = 2.0 * m
    gx, gz = GRAVITY * math.sin(SLOPE), -GRAVITY * math.cos(SLOPE)
    push[0], push[1] = 2.0 * m * gx, 2.0 * m * gz
    for leg in range(2):
        sine, cosine, rate = np.sin(y[2 + leg]), np.cos(y[2 + leg]), y[6 + leg]
        mass[0, 2 + leg] = mass[2 + leg, 0] = m * d * cosine
        mass[1, 2 + leg] = mass[2 + leg, 1] = m * d * sine
        mass[2 + leg, 2 + leg] = INERTIA + m * d * d
        push[0] += m * d * sine * rate * rate
        push[1] -= m * d * cosine * rate * rate
        push[2 + leg] = m * d * (cosine * gx + sine * gz)
        if pressing[leg] == PRESSING:
            depth, sinking, slip = foot(y, leg)
            root = np.sqrt(depth) if depth.real > 0.0 else 0.0 * depth
            normal = depth * (laws[0] * root + laws[1] * sinking)
            sign = 1.0 if band[leg] >= 2 else -1.0
            past = sign * slip - V0
            if band[leg] == 0 or band[leg] == 3:
                share = laws[3] + (laws[2] - laws[3]) * np.exp(-XI * past)
            else:
                share = laws[2] * (1.0 - past * past / (V0 * V0))
            along = -sign * share * normal
            push[0] += along
            push[1] += normal
            push[2 + leg] += arm * sine * normal + (arm * cosine + RADIUS) * along
    rates = np.full(8, np.nan, y.dtype)
    rates[:4] = y[4:]
    if np.isfinite(push).all() and np.isfinite(mass).all():
        rates[4:] = np.linalg.solve(mass, push)
    return rates


@compiled
def surfaces(y, laws):
    """Per leg: depth, what the force has of its sign, and slip past −v0, 0 and v0; then θ1."""
    values = np.empty(11, y.dtype)
    for leg in range(2):
        depth, sinking, slip = foot(y, leg)
        root = np.sqrt(depth) if depth.real > 0.0 else 0.0 * depth
        own = (depth, laws[0] * root + laws[1] * sinking, slip + V0, slip, slip - V0)
        for k in range(5):
            values[5 * leg + k] = own[k]
    values[10] = y[2]
    return values


NAMES = (
    *(f"{what} {leg}" for leg in (1, 2) for what in ("depth", "force", "-v0", "slip", "v0")),
    "end",
)


@compiled
def slopes(y, laws, pressing, band):
    """Derivative of the field with respect to state and logarithms of the laws, (8, 12)."""
    found = np.empty((8, 12))
    for k in range(12):
        moved, law = y.astype(np.complex128), laws.astype(np.complex128)
        if k < 8:
            moved[k] += 1j * TINY
        else:
            law[k - 8] *= 1.0 + 1j * TINY
        found[:, k] = field(moved, law, pressing, band).imag / TINY
    return found


@compiled
def surface_slopes(y, laws, which):
    """Derivative of one surface's function, likewise (12,)."""
    found = np.empty(12)
    for k in range(12):
        moved, law = y.astype(np.complex128), laws.astype(np.complex128)
        if k < 8:
            moved[k] += 1j * TINY
        else:
            law[k - 8] *= 1.0 + 1j * TINY
        found[k] = surfaces(moved, law)[which].imag / TINY
    return found


class Pieces(NamedTuple):
    """Which piece of its laws each foot is on: of the normal law, and of friction."""

    pressing: np.ndarray
    band: np.ndarray

    def sides(self) -> dict[int, float]:
        """Sign on this piece of each surface that ends it; θ1 is looked at once leg 1 stands."""
        found: dict[int, float] = {}
        for leg in range(2):
            own = 5 * leg
            if self.pressing[leg] == FREE:
                found[own] = -1.0
                continue
            found[own + 1] = 1.0 if self.pressing[leg] == PRESSING else -1.0
            if self.pressing[leg] == LETTING_GO:
                found[own] = 1.0
                continue
            for k in range(3):
                if self.band[leg] in (k, k + 1):
                    found[own + 2 + k] = 1.0 if self.band[leg] > k else -1.0
        if self.pressing[0] != FREE:
            found[10] = 1.0
        return found

    def beyond(self, which: int, y: np.ndarray) -> "Pieces":
        """The pieces on the other side of a surface."""
        leg, kind = divmod(which, 5)
        pressing, band = self.pressing.copy(), self.band.copy()
        if kind == 0:
            pressing[leg] = PRESSING if pressing[leg] == FREE else FREE
        elif kind == 1:
            pressing[leg] = LETTING_GO if pressing[leg] == PRESSING else PRESSING
        else:
            band[leg] += 1 if band[leg] == kind - 2 else -1
        if kind < 2:
            band[leg] = band_of(foot(y, leg)[2])
        return Pieces(pressing, band)


def band_of(slip: float) -> int:
    """Which branch of the friction law a slip velocity is on."""
    return int(np.searchsorted([-V0, 0.0, V0], slip))
