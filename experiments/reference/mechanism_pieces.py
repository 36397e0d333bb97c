"""Smooth pieces of a mechanism's motion: the vector field on each, and the surfaces that end it.

On a piece each contact is free, presses, or is deep without force, and each foot that presses slips
on one branch of friction. Jacobians are complex steps: exact.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from .mechanism_equations import (
    FREE,
    LETTING_GO,
    PRESSING,
    Contact,
    Motion,
    Tree,
    accelerations,
    contacts,
    ground_force,
    leg_rates,
    motion_of,
    over_depth,
    stop_torque,
    summed,
)

TINY = 1e-30
"""Of complex steps."""
KINDS = ("depth", "force", "-v0", "slip", "v0")
"""Of the surfaces of each contact."""
_LIGHT = 0.01
"""Share of the weight that is added to the load, of which each leg's share is taken."""


class Pieces(NamedTuple):
    """Which piece of its law each contact is on, and each foot of the law of friction."""

    pressing: tuple[int, ...]
    band: tuple[int, ...]


@dataclasses.dataclass(frozen=True)
class Field:
    """The smooth vector field of a tree on one piece, and the surfaces that end the piece."""

    tree: Tree
    pieces: Pieces

    def __call__(self, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Rates of states (…, n) under numbers (…, P)."""
        tree, feet = self.tree, len(self.tree.feet)
        motion = motion_of(tree, y, p)
        found = contacts(tree, motion, p)
        forces: list[Any] = []
        loads: list[Any] = [0.0] * (max(tree.legs) + 1)
        for k in range(feet):
            if self.pieces.pressing[k] == PRESSING:
                force = ground_force(tree, found[k], self.pieces.band[k], p)
                loads[tree.legs[k]] = loads[tree.legs[k]] + force[1]
                pair = np.stack(np.broadcast_arrays(*force), -1)
                forces.append((found[k].body, found[k].sole, pair))
        torques = []
        for (part, _, sign), each, piece in zip(
            tree.stops, found[feet:], self.pieces.pressing[feet:], strict=True
        ):
            if piece == PRESSING:
                torques.append((part.weights, -sign * stop_torque(part, each, p)))
        torques += self._joint_torques(motion, p, loads)
        found_rates = accelerations(tree, motion, p, forces, torques)
        half = y.shape[-1] // 2
        moving = np.broadcast_to(y[..., half:], (*found_rates.shape[:-1], half))
        own = [0, 1, *(2 + j for j in tree.free)]
        return np.concatenate([moving, found_rates[..., own]], -1)

    def _joint_torques(self, motion: Motion, p: np.ndarray, loads: Sequence[Any]) -> list[Any]:
        tree, found = self.tree, []
        for part in tree.parts:
            values = {name: p[..., place] for name, place in part.places.items()}
            if part.kind == "spring":
                angle, rate = summed(part.weights, motion)
                angle = angle + part.vertical * p[..., tree.names["slope"]]
                torque = -values.get("stiffness", 0.0) * (angle - values.get("rest", 0.0))
                found.append((part.weights, torque - values.get("damping", 0.0) * rate))
            elif part.kind == "motor":
                masses = [p[..., tree.names[f"mass {j}"]] for j in range(len(tree.parents))]
                weight = (sum(masses) + p[..., tree.names["root mass"]]) * p[..., tree.names["g"]]
                total = _LIGHT * weight + sum(loads)
                for leg, load in enumerate(loads):
                    # Written for the second leg standing; for the first, with the sides exchanged.
                    side = (lambda j: j) if leg == 1 else (lambda j: tree.sides[j])
                    read = [(side(j), w) for j, w in part.read]
                    angle, rate = summed(read, motion)
                    torque = -values["kp"] * angle - values["kd"] * rate
                    weights = [(side(j), w) for j, w in part.weights]
                    found.append((weights, load / total * torque))
        return found

    def slopes(self, y: np.ndarray, p: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Derivatives at states (s, n) with respect to the state and directions in p, (s, n, …)."""
        n, k = y.shape[-1], len(directions)
        by_state = y[:, None, :] + 1j * TINY * np.eye(n)
        found = [self(by_state, p + 0j)]
        if k:
            by_number = p + 1j * TINY * directions
            found.append(self(y[:, None, :] + 0j, by_number[None]))
        return np.swapaxes(np.concatenate(found, 1).imag / TINY, 1, 2)


def surfaces(tree: Tree, y: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Of each contact: depth, what the force has of its sign, slip past −v0, 0 and v0; (…, 5 C)."""
    found, rows = contacts(tree, motion_of(tree, y, p), p), []
    for k, each in enumerate(found):
        rows += [each.depth, _sign_of_force(tree, k, each, p)]
        v0 = p[..., tree.names["v0"]]
        slip = 0.0 * each.depth if each.slip is None else each.slip
        rows += [slip + v0, slip, slip - v0]
    return np.stack(np.broadcast_arrays(*rows), -1)


def _sign_of_force(tree: Tree, k: int, contact: Contact, p: np.ndarray) -> np.ndarray:
    places = tree.names if k < len(tree.feet) else tree.stops[k - len(tree.feet)][0].places
    return over_depth(contact, *(p[..., places[name]] for name in ("K", "c", "n")))


def band_of(slip: float, v0: float) -> int:
    """Which branch of the friction law a foot slips on."""
    return int(np.searchsorted([-v0, 0.0, v0], slip))


def pieces_at(tree: Tree, y: np.ndarray) -> Pieces:
    """The pieces that a state is on."""
    motion = motion_of(tree, y, tree.p)
    rates, v0 = leg_rates(tree, motion, tree.p), tree.p[tree.names["v0"]]
    pressing, band = [], []
    for k, each in enumerate(contacts(tree, motion, tree.p)):
        admitted = k >= len(tree.feet) or not tree.gated or rates[tree.legs[k]] < 0.0
        touches = each.depth > 0.0 and admitted
        pushes = _sign_of_force(tree, k, each, tree.p) > 0.0
        pressing.append((PRESSING if pushes else LETTING_GO) if touches else FREE)
        if each.slip is not None:
            band.append(band_of(each.slip, v0))
    return Pieces(tuple(pressing), tuple(band))


def sides(tree: Tree, pieces: Pieces) -> dict[int, float]:
    """Sign on these pieces of each surface that ends them."""
    found: dict[int, float] = {}
    for k, piece in enumerate(pieces.pressing):
        own = 5 * k
        if piece == FREE:
            found[own] = -1.0
            continue
        found[own] = 1.0
        found[own + 1] = 1.0 if piece == PRESSING else -1.0
        if piece == PRESSING and k < len(tree.feet):
            for i in range(3):
                if pieces.band[k] in (i, i + 1):
                    found[own + 2 + i] = 1.0 if pieces.band[k] > i else -1.0
    return found


def beyond(tree: Tree, pieces: Pieces, which: int, y: np.ndarray) -> Pieces:
    """The pieces on the other side of a surface."""
    k, kind = divmod(which, 5)
    pressing, band = list(pieces.pressing), list(pieces.band)
    if kind == 0:
        pressing[k] = PRESSING if pressing[k] == FREE else FREE
    elif kind == 1:
        pressing[k] = LETTING_GO if pressing[k] == PRESSING else PRESSING
    else:
        band[k] += 1 if band[k] == kind - 2 else -1
    if kind < 2 and k < len(tree.feet):
        slip = surfaces(tree, y, tree.p)[5 * k + 3]
        band[k] = band_of(slip, tree.p[tree.names["v0"]])
    return Pieces(tuple(pressing), tuple(band))
