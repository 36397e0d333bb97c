"""A footstep of the compliant walker and its gait, with derivatives: collocation on smooth pieces.

From mid-stance to mid-stance, one heel strike between: its time, its end, and their derivatives
with respect to the start and to logarithms of the walker's numbers, by `mechanism_flow`. Gaits are
found by Newton's method on footsteps.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from .compliant import DROP, LAWS_AT, numbers
from .mechanism_equations import PRESSING, Tree, contacts, ground_force, motion_of
from .mechanism_flow import Step, flow
from .mechanism_pieces import TINY

MID_STANCE = np.array([0.0, 0.399354, 0.0959, 0.0, 0.27801, -0.00053, 2.3765, -0.695])
"""Hip x, z, both angles and their rates, leg 2 standing upright (SI)."""
UPRIGHT = 2
"""The angle among them that is 0 where a footstep ends."""
PARAMETERS = ("K", "c", "mu_static", "mu_kinetic")
LAWS = numbers()[[LAWS_AT[name] for name in PARAMETERS]]
"""What footsteps are differentiated with respect to unless told, and their values."""
EXCHANGED = [1, 3, 2, 4, 5, 7, 6]
"""What recurs of a state, leg 2 now the one that stands."""
_LONGEST = 2.0
"""Time within which a footstep must come to its end [s]."""


class Footstep(NamedTuple):
    """A footstep and its derivatives, at its end where leg 1 passes the slope's normal.

    Attributes:
        time: [s]. state: at its end, the eight numbers of the state, legs not renamed.
        time_gradient: of the time, with respect to the start (8) and along the k directions.
        gradient: of the state at the end, (8, 8 + k).
        switches: names of the surfaces that were met, feet from 0, in order, with their times [s].
        peak: the largest normal force [N].
    """

    time: float
    state: np.ndarray
    time_gradient: np.ndarray
    gradient: np.ndarray
    switches: list[tuple[str, float]]
    peak: float


class Gait(NamedTuple):
    """A gait at mid-stance of leg 2, θ2 = 0.

    Attributes:
        state: hip z, θ1, θ2 and the rates, (7,).
        measures: period [s], step length [m], speed [m/s] and peak of the normal force [N].
        jacobian: of the return map, (7, 7).
        changes: derivatives of the fixed point along the directions, (7, k).
        elasticities: of the period's logarithm, (k,).
    """

    state: np.ndarray
    measures: np.ndarray
    jacobian: np.ndarray
    changes: np.ndarray
    elasticities: np.ndarray

    @property
    def radius(self) -> float:
        """Absolute value of the largest multiplier."""
        return float(np.max(np.abs(np.linalg.eigvals(self.jacobian))))


def by_logarithms(p: np.ndarray, names: Iterable[str] = PARAMETERS) -> np.ndarray:
    """Directions along logarithms of parameters of the laws, (k, SIZE)."""
    places = [LAWS_AT[name] for name in names]
    return p[places, None] * np.eye(len(p))[places]


def footstep(
    start: np.ndarray = MID_STANCE,
    p: np.ndarray | None = None,
    *,
    directions: np.ndarray | None = None,
    stages: int = 7,
    resolution: float = 1e-9,
) -> Footstep:
    """A footstep and its derivatives.

    Args:
        start: at mid-stance of leg 2.
        p: as by `numbers`; the seed's unless given.
        directions: in p, along which it is differentiated, (k, SIZE); logarithms of `PARAMETERS`
            unless given.
        stages: of the collocation, whose order is twice that less one.
        resolution: what its last Legendre mode may have of state and tangents.
    """
    p = numbers() if p is None else p
    along = by_logarithms(p) if directions is None else directions
    rows = [two_legs(p + 1j * TINY * each).p.imag / TINY for each in along]
    tree, how = two_legs(p), dict(stages=stages, resolution=resolution)
    found = flow(tree, start, _LONGEST, np.reshape(rows, (-1, len(tree.p))), upright=0, **how)
    if found.time >= _LONGEST:
        raise RuntimeError(f"no footstep within {_LONGEST:g} s")
    later = -found.gradient[UPRIGHT] / found.rates[UPRIGHT]
    gradient = found.gradient + np.outer(found.rates, later)
    peak = max(_peak(*each) for each in found.steps)
    return Footstep(found.time, found.state, later, gradient, found.switches, peak)


def two_legs(p: np.ndarray) -> Tree:
    """The walker of these numbers, as by `numbers`, as a tree of two bodies."""
    assert p[DROP] == 0.0
    m, J, l, d, r, hip_mass, downhill, normal, gated = p[:9]
    g = np.sqrt(downhill * downhill + normal * normal)
    values = {"root mass": hip_mass, "g": g, "slope": np.arcsin(downhill / g)}
    values |= {name: p[place] for name, place in LAWS_AT.items()}
    for leg in range(2):
        own = {"along": l - r, "ahead": 0.0, "radius": r}
        values |= {f"foot {leg} {name}": value for name, value in own.items()}
        values |= {f"mass {leg}": m, f"inertia {leg}": J, f"centre {leg} 0": d}
        values |= dict.fromkeys((f"centre {leg} 1", f"at {leg} 0", f"at {leg} 1"), 0.0)
    return Tree(
        p=np.array(list(values.values())),
        names={name: place for place, name in enumerate(values)},
        parents=(-1, -1),
        feet=(0, 1),
        legs=(0, 1),
        sides=(1, 0),
        parts=(),
        gated=bool(gated != 0.0),
    )


def _peak(step: Step, h: float, end: np.ndarray) -> float:
    """The largest normal force of a step, at its end or where a foot's passes a maximum."""
    field, largest = step.field, 0.0
    tree, pieces = field.tree, field.pieces

    def load(y: np.ndarray, k: int) -> complex:
        foot = contacts(tree, motion_of(tree, y, tree.p), tree.p)[k]
        return complex(ground_force(tree, foot, pieces.band[k], tree.p)[1])

    def growth(y: np.ndarray, k: int) -> float:
        """How fast the normal force on a foot grows."""
        return load(y + TINY * 1j * field(y, tree.p), k).imag / TINY

    for k in (k for k, piece in enumerate(pieces.pressing) if piece == PRESSING):
        largest = max(largest, load(end, k).real)
        low, high = (0.0, growth(step.y, k)), (h, growth(end, k))
        if not low[1] > 0.0 > high[1]:
            continue
        for _ in range(4):
            at = (low[0] * high[1] - high[0] * low[1]) / (high[1] - low[1])
            stages = step.stages(at)
            assert stages is not None
            value = growth(stages[-1], k)
            low, high = ((at, value), high) if value > 0.0 else (low, (at, value))
            largest = max(largest, load(stages[-1], k).real)
    return largest


def turn(x: np.ndarray, p: np.ndarray, directions: np.ndarray | None = None) -> Gait:
    """The next mid-stance after x (7,), with a footstep's measures and derivatives.

    Those of the fixed point are along the directions in p, (k, SIZE), as if x were it.
    """
    along = np.zeros((0, len(p))) if directions is None else directions
    found = footstep(np.append(0.0, x), p, directions=along)
    t, length = found.time, found.state[0]
    reached, rows = found.state[EXCHANGED], found.gradient[EXCHANGED, 1:]
    jacobian, columns = rows[:, :7], rows[:, 7:]
    # How the fixed point moves, and the period with it.
    moved = np.linalg.solve(np.eye(7) - jacobian, columns)
    later = found.time_gradient[1:8] @ moved + found.time_gradient[8:]
    measures = np.array([t, length, length / t, found.peak])
    return Gait(reached, measures, jacobian, moved, later / t)


def gait(guess: np.ndarray, p: np.ndarray, directions: np.ndarray | None = None) -> Gait:
    """The gait near a state (7,) on the section; directions as for `turn`."""
    x = np.array(guess, float)
    for _ in range(12):
        next_ = turn(x, p, directions)
        step = np.linalg.solve(next_.jacobian - np.eye(7), next_.state - x)
        x = x - step
        if np.max(np.abs(step)) < 1e-11:
            return next_._replace(state=x)
    raise RuntimeError("no gait near the start")
