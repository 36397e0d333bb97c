"""Equations of motion of any mechanism in maximal coordinates, from plain numbers.

Each body has three coordinates of its own; hinges and couplings are constraints, solved together
with Newton's and Euler's equations. Written beside the package, from the equations alone, under the
seed's laws of contact. All functions take batches and complex numbers, so that derivatives are
complex steps.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

ALONG, AHEAD = 0, 1
LAWS = ("K", "c", "n", "mu_static", "mu_kinetic", "v0", "xi")
FREE, PRESSING, LETTING_GO = 0, 1, 2
"""Pieces of a normal law: no contact, a force, and a clamped one while the contact is deep."""


class Part(NamedTuple):
    """What acts on a weighted sum of angles: `kind` with places of its numbers in p, by name."""

    kind: str
    weights: tuple[tuple[int, float], ...]
    vertical: float
    places: dict[str, int]
    read: tuple[tuple[int, float], ...] = ()


class Tree(NamedTuple):
    """A mechanism on its slope as plain data.

    Attributes:
        p: all its numbers, shape (P,).
        names: place of each in p, by name: "mass 0", "foot 1 radius", "K", ….
        parents: of the bodies, −1 for the root point. feet: body of each foot.
        legs: of each foot. sides: bodies by the names that they have one footstep later.
        parts: springs, stops, couplings and motors.
        gated: whether a foot may touch only while its leg turns backwards.
    """

    p: np.ndarray
    names: dict[str, int]
    parents: tuple[int, ...]
    feet: tuple[int, ...]
    legs: tuple[int, ...]
    sides: tuple[int, ...]
    parts: tuple[Part, ...]
    gated: bool

    @property
    def fixed(self) -> tuple[int, ...]:
        """Bodies whose angles couplings fix: the first that each names."""
        return tuple(each.weights[0][0] for each in self.parts if each.kind == "coupling")

    @property
    def free(self) -> tuple[int, ...]:
        """The other bodies."""
        return tuple(j for j in range(len(self.parents)) if j not in self.fixed)

    @property
    def stops(self) -> tuple[tuple[Part, str, float], ...]:
        """Limits of stops: the part, which limit, and the sign of the angle that passes it."""
        return tuple(
            (part, limit, sign)
            for part in self.parts
            for limit, sign in (("upper", 1.0), ("lower", -1.0))
            if part.kind == "stop" and limit in part.places
        )


class Motion(NamedTuple):
    """Root point (…, 2) with its velocity, and angles and rates of all bodies (…, n)."""

    root: np.ndarray
    speed: np.ndarray
    angles: np.ndarray
    rates: np.ndarray


class Contact(NamedTuple):
    """A foot or a limit of a stop: depth and its rate, and a foot's slip.

    `sole` is a foot's lowest point from its body's hinge.
    """

    depth: Any
    sinking: Any
    slip: Any = None
    body: int = -1
    sole: Any = None


def turned(angle: Any, along: Any, ahead: Any) -> tuple[Any, Any]:
    """A point of a body from its hinge, and its derivative with respect to the angle, (…, 2)."""
    s, c = np.sin(angle), np.cos(angle)
    point = np.stack([along * s + ahead * c, -along * c + ahead * s], -1)
    moves = np.stack([along * c - ahead * s, along * s + ahead * c], -1)
    return point, moves


def motion_of(tree: Tree, y: np.ndarray, p: np.ndarray) -> Motion:
    """The motion of all bodies in a state: root point, free angles, then their rates."""
    half, n = y.shape[-1] // 2, len(tree.parents)
    free, fixed = list(tree.free), list(tree.fixed)
    shape = np.broadcast_shapes(y.shape[:-1], p.shape[:-1])
    angles = np.zeros((*shape, n), np.result_type(y, p))
    rates = angles.copy()
    angles[..., free], rates[..., free] = y[..., 2:half], y[..., half + 2 :]
    if fixed:
        couplings = [part for part in tree.parts if part.kind == "coupling"]
        weights = np.zeros((len(couplings), n))
        rest = np.zeros((*shape, len(couplings)), angles.dtype)
        for row, part in enumerate(couplings):
            for body, weight in part.weights:
                weights[row, body] = weight
            rest[..., row] = -part.vertical * p[..., tree.names["slope"]]
            if "rest" in part.places:
                rest[..., row] += p[..., part.places["rest"]]
        own = np.linalg.inv(weights[:, fixed])
        angles[..., fixed] = (rest - angles @ weights.T) @ own.T
        rates[..., fixed] = -(rates @ weights.T) @ own.T
    return Motion(y[..., :2], y[..., half : half + 2], angles, rates)


def hinges(tree: Tree, motion: Motion, p: np.ndarray) -> list[tuple[Any, Any]]:
    """Place and velocity of each body's hinge."""
    found: list[tuple[Any, Any]] = []
    for j, parent in enumerate(tree.parents):
        if parent < 0:
            found.append((motion.root, motion.speed))
            continue
        at, speed = found[parent]
        place = [p[..., tree.names[f"at {j} {axis}"]] for axis in (ALONG, AHEAD)]
        point, moves = turned(motion.angles[..., parent], *place)
        found.append((at + point, speed + moves * motion.rates[..., parent, None]))
    return found


def contacts(tree: Tree, motion: Motion, p: np.ndarray) -> list[Contact]:
    """All feet, then all limits of stops."""
    found, known = [], hinges(tree, motion, p)
    for k, body in enumerate(tree.feet):
        along, ahead, radius = (p[..., tree.names[f"foot {k} {what}"]] for what in _OF_FOOT)
        angle, rate = motion.angles[..., body], motion.rates[..., body]
        at, speed = known[body]
        point, moves = turned(angle, along, ahead)
        centre, velocity = at + point, speed + moves * rate[..., None]
        slip = velocity[..., 0] + radius * rate
        sole = np.stack([point[..., 0], point[..., 1] - radius], -1)
        found.append(Contact(radius - centre[..., 1], -velocity[..., 1], slip, body, sole))
    for part, limit, sign in tree.stops:
        angle, rate = summed(part.weights, motion)
        angle = angle + part.vertical * p[..., tree.names["slope"]]
        found.append(Contact(sign * (angle - p[..., part.places[limit]]), sign * rate))
    return found


_OF_FOOT = ("along", "ahead", "radius")


def summed(weights: Sequence[tuple[int, float]], motion: Motion) -> tuple[Any, Any]:
    """A weighted sum of angles and of their rates."""
    bodies, by = [j for j, _ in weights], np.array([w for _, w in weights])
    return motion.angles[..., bodies] @ by, motion.rates[..., bodies] @ by


def leg_rates(tree: Tree, motion: Motion, p: np.ndarray) -> list[Any]:
    """Rate at which the line from the root point to the mean of each leg's feet turns."""
    known, found = hinges(tree, motion, p), []
    for leg in range(max(tree.legs) + 1):
        line, moving = [], []
        for k, body in enumerate(tree.feet):
            if tree.legs[k] != leg:
                continue
            along, ahead, _ = (p[..., tree.names[f"foot {k} {what}"]] for what in _OF_FOOT)
            point, moves = turned(motion.angles[..., body], along, ahead)
            line.append(known[body][0] + point - motion.root)
            speed = known[body][1] - motion.speed
            moving.append(speed + moves * motion.rates[..., body, None])
        r, v = sum(line) / len(line), sum(moving) / len(moving)
        found.append((r[..., 0] * v[..., 1] - r[..., 1] * v[..., 0]) / np.sum(r * r, -1))
    return found


def ground_force(tree: Tree, contact: Contact, band: int, p: np.ndarray) -> tuple[Any, Any]:
    """Force on a foot that presses, along the slope and along its normal."""
    K, c, n, static, kinetic, v0, xi = (p[..., tree.names[name]] for name in LAWS)
    normal = contact.depth * over_depth(contact, K, c, n)
    sign = 1.0 if band >= 2 else -1.0
    past = sign * contact.slip - v0
    if band in (0, 3):
        share = kinetic + (static - kinetic) * np.exp(-xi * past)
    else:
        share = static * (1.0 - past * past / (v0 * v0))
    return -sign * share * normal, normal


def stop_torque(part: Part, contact: Contact, p: np.ndarray) -> Any:
    """Torque of a limit that is pressed against its passing."""
    K, c, n = (p[..., part.places[name]] for name in ("K", "c", "n"))
    return contact.depth * over_depth(contact, K, c, n)


def over_depth(contact: Contact, K: Any, c: Any, n: Any) -> Any:
    """A normal force without its clamp, over the depth."""
    inside = np.real(contact.depth) > 0.0
    depth = np.where(inside, contact.depth, 1.0)
    return np.where(inside, K * np.exp((n - 1.0) * np.log(depth)), 0.0) + c * contact.sinking


def accelerations(
    tree: Tree,
    motion: Motion,
    p: np.ndarray,
    forces: Sequence[tuple[int, Any, Any]],
    torques: Sequence[tuple[Sequence[tuple[int, float]], Any]],
) -> np.ndarray:
    """Accelerations of the root point and of all angles, (…, 2 + n).

    Args:
        tree: the mechanism.
        motion: of all bodies.
        p: its numbers, (…, P).
        forces: body, lever from its hinge (…, 2), and force (…, 2).
        torques: weights of bodies, and the torque.
    """
    n, of = len(tree.parents), tree.names
    couplings = [part for part in tree.parts if part.kind == "coupling"]
    size, rows = 2 + 3 * n, 2 * n + len(couplings)
    shape = np.broadcast_shapes(motion.angles.shape[:-1], p.shape[:-1])
    kind = np.result_type(motion.angles, p)
    whole = np.zeros((*shape, size + rows, size + rows), kind)
    right = np.zeros((*shape, size + rows), kind)
    slope, g = p[..., of["slope"]], p[..., of["g"]]
    gravity = np.stack([g * np.sin(slope), -g * np.cos(slope)], -1)
    whole[..., 0, 0] = whole[..., 1, 1] = p[..., of["root mass"]]
    right[..., :2] = p[..., of["root mass"], None] * gravity
    arms = []
    for j, parent in enumerate(tree.parents):
        at, mass = 2 + 3 * j, p[..., of[f"mass {j}"]]
        whole[..., at, at] = whole[..., at + 1, at + 1] = mass
        whole[..., at + 2, at + 2] = p[..., of[f"inertia {j}"]]
        right[..., at : at + 2] = mass[..., None] * gravity
        place = [p[..., of[f"centre {j} {axis}"]] for axis in (ALONG, AHEAD)]
        arm, moves = turned(motion.angles[..., j], *place)
        arms.append((arm, moves))
        for i in range(2):
            # The mass centre less its own arm is the hinge, on the parent or on the root point.
            row = size + 2 * j + i
            whole[..., row, at + i] = 1.0
            whole[..., row, at + 2] = -moves[..., i]
            right[..., row] = -arm[..., i] * motion.rates[..., j] ** 2
            if parent < 0:
                whole[..., row, i] = -1.0
                continue
            up, above = 2 + 3 * parent, motion.angles[..., parent]
            hinge = [p[..., of[f"at {j} {axis}"]] for axis in (ALONG, AHEAD)]
            point, moved = turned(above, *hinge)
            own, own_moves = arms[parent]
            whole[..., row, up + i] = -1.0
            whole[..., row, up + 2] = own_moves[..., i] - moved[..., i]
            right[..., row] += (own - point)[..., i] * motion.rates[..., parent] ** 2
    for k, part in enumerate(couplings):
        for j, weight in part.weights:
            whole[..., size + 2 * n + k, 4 + 3 * j] = weight
    whole[..., :size, size:] = np.swapaxes(whole[..., size:, :size], -1, -2)
    for weights, torque in torques:
        for j, weight in weights:
            right[..., 4 + 3 * j] += weight * torque
    for j, lever, force in forces:
        right[..., 2 + 3 * j : 4 + 3 * j] += force
        from_centre = lever - arms[j][0]
        right[..., 4 + 3 * j] += (
            from_centre[..., 0] * force[..., 1] - from_centre[..., 1] * force[..., 0]
        )
    found = np.linalg.solve(whole, right[..., None])[..., 0]
    return np.concatenate([found[..., :2], found[..., 4:size:3]], -1)
