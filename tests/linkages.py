"""Linkages that tests share."""

import math

import jax.numpy as jnp
import numpy as np

import jaxbiped as jb

LEG = dict(mass=1.0, inertia=0.0096)
DISTANCE = 0.1


def pinned_pendulum(orientation="angle", *, twice=False):
    """Two of the seed's legs hanging from one pin; `twice` says the second joint twice."""
    body = jb.constraints.LinkBody(**LEG)
    hip = (0.0, DISTANCE)
    joints = [jb.constraints.Pin(hip, (0.0, 0.0), 0), jb.constraints.Pin(hip, hip, 0, 1)]
    return jb.constraints.Linkage((body, body), joints + joints[1:] * twice, orientation)


def one_leg(distance=DISTANCE):
    """The seed's leg hanging from a pin: the linkage that compiles soonest."""
    joint = jb.constraints.Pin((0.0, distance), (0.0, 0.0), 0)
    return jb.constraints.Linkage((jb.constraints.LinkBody(**LEG),), (joint,))


def four_bar(orientation="angle"):
    """Crank, coupler and rocker between two pins of the ground; each bar a thin rod."""
    lengths = (0.2, 0.5, 0.4)
    bars = [jb.constraints.LinkBody(length, length**3 / 12.0) for length in lengths]
    ends = [((-length / 2, 0.0), (length / 2, 0.0)) for length in lengths]
    joints = (
        jb.constraints.Pin(ends[0][0], (0.0, 0.0), 0),
        jb.constraints.Pin(ends[0][1], ends[1][0], 0, 1),
        jb.constraints.Pin(ends[1][1], ends[2][1], 1, 2),
        jb.constraints.Pin(ends[2][0], (0.5, 0.0), 2),
    )
    return jb.constraints.Linkage(bars, joints, orientation)


def four_bar_state(crank, rate=0.0):
    """Angles and centres of the four-bar with its crank at an angle [rad], turning [rad/s].

    By the intersection of two circles, and rates by central differences of the same.
    """
    place = _four_bar_place(crank)
    step = 1e-6
    slopes = (_four_bar_place(crank + step) - _four_bar_place(crank - step)) / (2.0 * step)
    return jb.dynamics.LinkageState(
        tuple(map(float, place)), tuple(float(rate * s) for s in slopes)
    )


def _four_bar_place(crank):
    elbow = 0.2 * np.array([math.cos(crank), math.sin(crank)])
    to_ground = np.array([0.5, 0.0]) - elbow
    gap = float(np.hypot(*to_ground))
    along = (0.5**2 - 0.4**2 + gap**2) / (2.0 * gap)
    across = math.sqrt(0.5**2 - along**2)
    unit = to_ground / gap
    knee = elbow + along * unit + across * np.array([-unit[1], unit[0]])
    coupler, rocker = knee - elbow, knee - np.array([0.5, 0.0])
    parts = []
    for start, bar, angle in (
        (np.zeros(2), elbow, crank),
        (elbow, coupler, math.atan2(coupler[1], coupler[0])),
        (np.array([0.5, 0.0]), rocker, math.atan2(rocker[1], rocker[0])),
    ):
        parts += [*(start + 0.5 * bar), angle]
    return np.array(parts)


def hanging(*angles, rates=(0.0, 0.0)):
    """The pendulum's state with its legs at these angles [rad], turning at these rates [rad/s]."""
    q, v = [], []
    for angle, rate in zip(angles, rates, strict=True):
        sine, cosine = math.sin(angle), math.cos(angle)
        q += [DISTANCE * sine, -DISTANCE * cosine, angle]
        v += [DISTANCE * cosine * rate, DISTANCE * sine * rate, rate]
    return jb.dynamics.LinkageState(tuple(q), tuple(v))


def with_euler_parameters(state):
    """The same state with Euler parameters in place of angles."""
    q, v = [], []
    for k in range(len(state.q) // 3):
        x, z, angle = state.q[3 * k : 3 * k + 3]
        vx, vz, rate = state.v[3 * k : 3 * k + 3]
        cosine, sine = jnp.cos(0.5 * angle), jnp.sin(0.5 * angle)
        q += [x, z, cosine, sine]
        v += [vx, vz, -0.5 * rate * sine, 0.5 * rate * cosine]
    return jb.dynamics.LinkageState(tuple(q), tuple(v))
