"""Inertia of a tree of bodies: accelerations by elimination, in as many operations as bodies.

Every body is eliminated from the leaves to the root point. Accelerations are those in the frame
that falls freely, so that gravity enters once, at the root point.
"""

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

from jaxbiped._types import Scalar
from jaxbiped.dynamics._tree import Arm, Loads, Pose, Tree, Vector, arm_of
from jaxbiped.linalg._sparse_lu import Entry, SparseMatrix, plus, times
from jaxbiped.scene._structure import Structure


class Composites(NamedTuple):
    """Each body with all that hangs on it as mass points at its hinges; of parameters alone.

    Attributes:
        masses: [kg]. total: of everything, with a mass at the root point.
        along, ahead: first moments about each body's hinge, in its frame [kg·m].
        inertias: about each body's hinge [kg·m²].
    """

    masses: tuple[Scalar, ...]
    total: Scalar
    along: tuple[Scalar, ...]
    ahead: tuple[Entry, ...]
    inertias: tuple[Scalar, ...]


def composites(tree: Tree, points: Sequence[tuple[int, Any, Entry]] | None = None) -> Composites:
    """The composite bodies of a tree.

    Args:
        tree: of bodies.
        points: mass points [kg] on bodies: the body's number, −1 for the root point, the place on
            it, None for its hinge, and the mass, None for none. None for a mechanism's own one.
    """
    structure, bodies = tree.structure, tree.bodies
    if points is None:
        points = [(-1, None, getattr(tree, "root_mass", None))]
    n = len(bodies)
    masses: list[Any] = [None] * n
    along, ahead, inertias = list(masses), list(masses), list(masses)

    def carried(j: int) -> list[tuple[Any, Any]]:
        """Masses that hang on a body, and where."""
        own = [(mass, at) for body, at, mass in points if body == j and mass is not None]
        return own + [(masses[k], bodies[k].at) for k in structure.children[j]]

    for j in reversed(structure.outwards):
        body = bodies[j]
        mass, first = body.mass, body.mass * body.centre.along
        second = times(body.mass, body.centre.ahead)
        inertia: Any = body.inertia + first * body.centre.along
        inertia = plus(inertia, times(second, body.centre.ahead))
        for more, at in carried(j):
            mass = mass + more
            if at is None:
                continue
            moment = more * at.along
            first, inertia = first + moment, inertia + moment * at.along
            if at.ahead is not None:
                moment = more * at.ahead
                second, inertia = plus(second, moment), inertia + moment * at.ahead
        masses[j], along[j], ahead[j], inertias[j] = mass, first, second, inertia
    total: Any = None
    for more, _ in carried(-1):
        total = plus(total, more)
    return Composites(tuple(masses), total, tuple(along), tuple(ahead), tuple(inertias))


class Elimination(NamedTuple):
    """The mass matrix with every body's angle eliminated, from the leaves to the root point.

    Attributes:
        pose: at which it holds.
        over: one over each body's inertia as its hinge feels it [1/(kg·m²)].
        shares: how much of a body's torque its hinge takes as a force [1/m].
        root: symmetric inertia (xx, xz, zz) of everything at the root point [kg].
    """

    pose: Pose
    over: tuple[Scalar, ...]
    shares: tuple[Vector, ...]
    root: tuple[Scalar, Entry, Scalar]


def moments_of(known: Composites, pose: Pose) -> tuple[Arm, ...]:
    """First moments of the composite bodies, turned as their arms are [kg·m]."""
    return tuple(
        arm_of(*each)
        for each in zip(known.along, known.ahead, pose.sines, pose.cosines, strict=True)
    )


def eliminate(structure: Structure, known: Composites, pose: Pose) -> Elimination:
    """Factors of the mass matrix at a pose."""
    n = len(structure.bodies)
    moments = moments_of(known, pose)
    # What a body's hinge feels beyond the composite mass: a symmetric 2 × 2.
    more: list[tuple[Any, Any, Any]] = [(None, None, None)] * n
    over: list[Scalar] = list(known.inertias)
    shares: list[Vector] = [moments[0]] * n
    for j in reversed(structure.outwards):
        cx, cz = moments[j]
        inertia = known.inertias[j]
        xx: Any = None
        xz: Any = None
        zz: Any = None
        for k in structure.children[j]:
            kxx, kxz, kzz = more[k]
            arm = pose.hinges[k]
            if arm is not None:
                kx, kz = kxx * arm.dx + kxz * arm.dz, kxz * arm.dx + kzz * arm.dz
                cx, cz = cx + kx, cz + kz
                inertia = inertia + arm.dx * kx + arm.dz * kz
            xx, xz, zz = plus(xx, kxx), plus(xz, kxz), plus(zz, kzz)
        over[j] = 1.0 / inertia
        ux, uz = cx * over[j], cz * over[j]
        shares[j] = ux, uz
        more[j] = plus(xx, -(ux * cx)), plus(xz, -(ux * cz)), plus(zz, -(uz * cz))
    xx, xz, zz = known.total, None, known.total
    for k in structure.children[-1]:
        xx, xz, zz = plus(xx, more[k][0]), plus(xz, more[k][1]), plus(zz, more[k][2])
    return Elimination(pose, tuple(over), tuple(shares), (xx, xz, zz))


def substitute(structure: Structure, factors: Elimination, loads: Loads) -> list[Scalar]:
    """What the inverse of the mass matrix makes of generalised forces: x, z, angles."""
    n, pose = len(structure.bodies), factors.pose
    forces: list[tuple[Entry, Entry]] = [(None, None)] * n
    torques: list[Any] = list(loads.torques)
    for j in reversed(structure.outwards):
        fx = fz = None
        for k in structure.children[j]:
            hx, hz = forces[k]
            arm = pose.hinges[k]
            if arm is not None:
                turned = plus(times(hx, arm.dx), times(hz, arm.dz))
                torques[j] = plus(torques[j], turned)
            fx, fz = plus(fx, hx), plus(fz, hz)
        if torques[j] is not None:
            ux, uz = factors.shares[j]
            fx, fz = plus(fx, -(ux * torques[j])), plus(fz, -(uz * torques[j]))
        forces[j] = fx, fz
    fx, fz = loads.x, loads.z
    for k in structure.children[-1]:
        fx, fz = plus(fx, forces[k][0]), plus(fz, forces[k][1])
    ax, az = _of_symmetric(factors.root, fx, fz)
    found: list[Any] = [ax, az, *[None] * n]
    hinges: list[tuple[Entry, Entry]] = [(ax, az)] * n
    for j in structure.outwards:
        parent = structure.parents[j]
        hx, hz = (ax, az) if parent < 0 else hinges[parent]
        arm = pose.hinges[j]
        if arm is not None:
            turning = found[2 + parent]
            hx, hz = plus(hx, times(arm.dx, turning)), plus(hz, times(arm.dz, turning))
        hinges[j] = hx, hz
        ux, uz = factors.shares[j]
        moved = plus(times(ux, hx), times(uz, hz))
        own = times(torques[j], factors.over[j])
        found[2 + j] = own if moved is None else plus(own, -moved)
    return found


def _of_symmetric(matrix: tuple[Scalar, Entry, Scalar], x: Entry, z: Entry) -> tuple[Entry, Entry]:
    """The solution of a symmetric 2 × 2 system."""
    xx, xz, zz = matrix
    if xz is None:
        return (None if x is None else x / xx), (None if z is None else z / zz)
    over = 1.0 / (xx * zz - xz * xz)
    first = plus(times(zz, x), None if z is None else -(xz * z))
    second = plus(times(xx, z), None if x is None else -(xz * x))
    return times(first, over), times(second, over)


def inertial_loads(
    structure: Structure,
    known: Composites,
    pose: Pose,
    accelerations: Sequence[Entry] | None = None,
) -> Loads:
    """Generalised forces of the motion itself, in the frame that falls freely (d'Alembert's).

    Accelerations are those of the root point and of all angles; without them, the forces are the
    centrifugal ones alone.
    """
    n = len(structure.bodies)
    moments = moments_of(known, pose)
    squares = [rate * rate for rate in pose.motion.rates]
    turning: Sequence[Entry] = (None,) * n if accelerations is None else accelerations[2:]
    moved = (None, None) if accelerations is None else accelerations[:2]
    root_x, root_z = (None if each is None else -each for each in moved)
    root = (root_x, root_z)

    def pull(j: int, arm: Arm) -> tuple[Scalar, Scalar]:
        """Minus the acceleration of a point of body j about the body's hinge."""
        x, z = squares[j] * arm.dz, -(squares[j] * arm.dx)
        own = turning[j]
        return (x, z) if own is None else (x - own * arm.dx, z - own * arm.dz)

    pulls: list[tuple[Entry, Entry]] = [root] * n  # of the hinges
    torques: list[Entry] = [None] * n
    for j in structure.outwards:
        parent = structure.parents[j]
        px, pz = root if parent < 0 else pulls[parent]
        arm = pose.hinges[j]
        if arm is not None:
            ax, az = pull(parent, arm)
            px, pz = plus(px, ax), plus(pz, az)
        pulls[j] = px, pz
        torques[j] = plus(times(px, moments[j].dx), times(pz, moments[j].dz))
        own = turning[j]
        torques[j] = plus(torques[j], None if own is None else -(known.inertias[j] * own))
    forces: list[tuple[Scalar, Scalar]] = [moments[0]] * n
    x, z = times(root[0], known.total), times(root[1], known.total)
    for j in reversed(structure.outwards):
        fx, fz = pull(j, moments[j])
        for k in structure.children[j]:
            arm = pose.hinges[k]
            if arm is not None:
                turned = arm.dx * forces[k][0] + arm.dz * forces[k][1]
                torques[j] = plus(torques[j], turned)
            fx, fz = fx + forces[k][0], fz + forces[k][1]
        forces[j] = fx, fz
    for k in structure.children[-1]:
        x, z = plus(x, forces[k][0]), plus(z, forces[k][1])
    return Loads(x, z, tuple(torques))


def mass_entries(structure: Structure, known: Composites, pose: Pose) -> SparseMatrix:
    """The mass matrix of the root point's place (rows 0 and 1) and of all angles (2 on)."""
    found: SparseMatrix = {(0, 0): known.total, (1, 1): known.total}
    for j, moment in enumerate(moments_of(known, pose)):
        found[2 + j, 2 + j] = known.inertias[j]
        pairs: list[tuple[int, Scalar]] = [(0, moment.dx), (1, moment.dz)]
        chain = structure.chains[j]
        for above, below in itertools.pairwise(chain):
            arm = pose.hinges[below]
            if arm is not None:
                pairs.append((2 + above, arm.dx * moment.dx + arm.dz * moment.dz))
        for i, entry in pairs:
            found[2 + j, i] = found[i, 2 + j] = entry
    return found
