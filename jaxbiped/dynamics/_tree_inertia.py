"""Inertia of a tree of bodies: accelerations by elimination, in as many operations as bodies.

Every body is eliminated from the leaves to the root point. Accelerations are those in the frame
that falls freely, so that gravity enters once, at the root point.
"""

from typing import Any, NamedTuple

from jaxbiped._types import Scalar
from jaxbiped.dynamics._tree import Arm, Loads, Pose, Vector, arm_of, plus, times
from jaxbiped.linalg._elimination import Entry
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._structure import Structure


class Composites(NamedTuple):
    """Each body with all that hangs on it as mass points at its hinges; of parameters alone.

    Attributes:
        masses: [kg]. total: of everything, the root point's too.
        along, ahead: first moments about each body's hinge, in its frame [kg·m].
        inertias: about each body's hinge [kg·m²].
    """

    masses: tuple[Scalar, ...]
    total: Scalar
    along: tuple[Scalar, ...]
    ahead: tuple[Entry, ...]
    inertias: tuple[Scalar, ...]


def composites(mechanism: Mechanism) -> Composites:
    """The composite bodies of a mechanism."""
    structure, bodies = mechanism.structure, mechanism.bodies
    n = len(bodies)
    masses: list[Any] = [None] * n
    along, ahead, inertias = list(masses), list(masses), list(masses)
    for j in reversed(range(n)):
        body = bodies[j]
        mass, first = body.mass, body.mass * body.centre.along
        second = times(body.mass, body.centre.ahead)
        inertia: Any = body.inertia + first * body.centre.along
        inertia = plus(inertia, times(second, body.centre.ahead))
        for k in structure.children[j]:
            mass, at = mass + masses[k], bodies[k].at
            if at is None:
                continue
            moment = masses[k] * at.along
            first, inertia = first + moment, inertia + moment * at.along
            if at.ahead is not None:
                moment = masses[k] * at.ahead
                second, inertia = plus(second, moment), inertia + moment * at.ahead
        masses[j], along[j], ahead[j], inertias[j] = mass, first, second, inertia
    total: Any = mechanism.root_mass
    for k in structure.children[-1]:
        total = plus(total, masses[k])
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
    for j in reversed(range(n)):
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
    for j in reversed(range(n)):
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
    found: list[Any] = [ax, az]
    hinges: list[tuple[Entry, Entry]] = []
    for j, parent in enumerate(structure.parents):
        hx, hz = (ax, az) if parent < 0 else hinges[parent]
        arm = pose.hinges[j]
        if arm is not None:
            turning = found[2 + parent]
            hx, hz = plus(hx, times(arm.dx, turning)), plus(hz, times(arm.dz, turning))
        hinges.append((hx, hz))
        ux, uz = factors.shares[j]
        moved = plus(times(ux, hx), times(uz, hz))
        own = times(torques[j], factors.over[j])
        found.append(own if moved is None else plus(own, -moved))
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


def centrifugal_loads(structure: Structure, known: Composites, pose: Pose) -> Loads:
    """Generalised forces of the motion itself, in the frame that falls freely."""
    n = len(structure.bodies)
    moments = moments_of(known, pose)
    squares = [rate * rate for rate in pose.motion.rates]
    pulls: list[tuple[Entry, Entry]] = [(None, None)] * n  # of the hinges' own circles
    torques: list[Entry] = [None] * n
    for j, parent in enumerate(structure.parents):
        px, pz = (None, None) if parent < 0 else pulls[parent]
        arm = pose.hinges[j]
        if arm is not None:
            px = plus(px, squares[parent] * arm.dz)
            pz = plus(pz, -(squares[parent] * arm.dx))
        pulls[j] = px, pz
        torques[j] = plus(times(px, moments[j].dx), times(pz, moments[j].dz))
    forces: list[tuple[Scalar, Scalar]] = [moments[0]] * n
    x = z = None
    for j in reversed(range(n)):
        fx, fz = squares[j] * moments[j].dz, -(squares[j] * moments[j].dx)
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
