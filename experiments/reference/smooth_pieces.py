"""Smooth pieces of the compliant walker's motion under the seed's laws.

On a piece each foot is free, presses, or is in the ground without force, and slips on one branch
of friction. All functions take complex numbers, too: Jacobians are complex steps, which have no
cancellation.
"""

from typing import NamedTuple

import numpy as np

from .compliant import accelerations, compiled, foot

FREE, PRESSING, LETTING_GO = 0, 1, 2
"""Pieces of the normal law: no contact, a force, and a clamped one while the foot is still in."""
TINY = 1e-30
"""Of complex steps."""
NAMES = (
    *(f"{what} {leg}" for leg in (1, 2) for what in ("depth", "force", "-v0", "slip", "v0")),
    "end",
)
"""Surfaces that end a piece; the last is where leg 1 is upright."""
UPRIGHT = len(NAMES) - 1


@compiled
def normal_over_depth(depth, sinking, p):
    """The normal force without its clamp, over the depth."""
    damping = p[11] * sinking
    if depth.real <= 0.0:
        return damping
    root = np.sqrt(depth) if p[12] == 1.5 else depth ** (p[12] - 1.0)
    return p[10] * root + damping


@compiled
def pressed(y, leg, p, band):
    """Forces along the slope and along its normal on a foot that presses."""
    depth, sinking, slip = foot(y, leg, p)
    normal = depth * normal_over_depth(depth, sinking, p)
    sign = 1.0 if band >= 2 else -1.0
    past = sign * slip - p[18]
    if band == 0 or band == 3:
        share = p[17] + (p[16] - p[17]) * np.exp(-p[19] * past)
    else:
        share = p[16] * (1.0 - past * past / (p[18] * p[18]))
    return -sign * share * normal, normal


@compiled
def field(y, p, pressing, band):
    """Rates of the state on a piece."""
    none = 0.0 * (y[0] + p[0])
    along_1, normal_1, along_2, normal_2 = none, none, none, none
    if pressing[0] == PRESSING:
        along_1, normal_1 = pressed(y, 0, p, band[0])
    if pressing[1] == PRESSING:
        along_2, normal_2 = pressed(y, 1, p, band[1])
    rates = np.empty(8, (y + p[:8]).dtype)
    rates[:4] = y[4:]
    rates[4], rates[5], rates[6], rates[7] = accelerations(
        y, p, (along_1, along_2), (normal_1, normal_2), (0.0, 0.0)
    )
    return rates


@compiled
def surfaces(y, p):
    """Per leg: depth, what the force has of its sign, and slip past −v0, 0 and v0; then θ1."""
    values = np.empty(11, (y + p[:8]).dtype)
    for leg in range(2):
        depth, sinking, slip = foot(y, leg, p)
        values[5 * leg] = depth
        values[5 * leg + 1] = normal_over_depth(depth, sinking, p)
        values[5 * leg + 2] = slip + p[18]
        values[5 * leg + 3] = slip
        values[5 * leg + 4] = slip - p[18]
    values[10] = y[2]
    return values


@compiled
def stepped(y, p, k, varied):
    """State and numbers with one of them moved by a complex step: a logarithm of those varied."""
    moved, law = y.astype(np.complex128), p.astype(np.complex128)
    if k < 8:
        moved[k] += 1j * TINY
    else:
        law[varied[k - 8]] *= 1.0 + 1j * TINY
    return moved, law


@compiled
def slopes(y, p, pressing, band, varied):
    """Derivative of the field with respect to state and logarithms of numbers in p, (8, 8 + k)."""
    found = np.empty((8, 8 + len(varied)))
    for k in range(8 + len(varied)):
        moved, law = stepped(y, p, k, varied)
        found[:, k] = field(moved, law, pressing, band).imag / TINY
    return found


@compiled
def surface_slopes(y, p, which, varied):
    """Derivative of one surface's function, likewise (8 + k,)."""
    found = np.empty(8 + len(varied))
    for k in range(8 + len(varied)):
        moved, law = stepped(y, p, k, varied)
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
            found[UPRIGHT] = 1.0
        return found

    def beyond(self, which: int, y: np.ndarray, p: np.ndarray) -> "Pieces":
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
            band[leg] = band_of(y, leg, p)
        return Pieces(pressing, band)


def band_of(y: np.ndarray, leg: int, p: np.ndarray) -> int:
    """Which branch of the friction law a foot slips on."""
    return int(np.searchsorted([-p[18], 0.0, p[18]], foot(y, leg, p)[2]))
