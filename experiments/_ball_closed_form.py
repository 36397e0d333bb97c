"""Closed form of a ball that bounces on a spring: the truth for gradients through contact.

A point mass falls on a floor that pushes back with K δ + c dδ/dt where that is positive (δ is the
depth) and never pulls. Floors that damp only while the ball sinks are known, too. Each phase is a
linear equation with a known solution, and only the times between them are roots; derivatives are
central differences at 60 digits. No simulator is involved.
"""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

from mpmath import mp, mpf

DIGITS = 60
STEPS = ("1e-14", "1e-12")
"""Relative steps of two central differences, whose disagreement is the truth's uncertainty."""
DIFFERENTIATED = ("height", "g", "K", "c")


@dataclasses.dataclass(frozen=True)
class Problem:
    """A ball of 1 kg that is dropped at rest.

    Attributes:
        name: a word for it.
        height: where it begins [m].
        g: gravity [m/s²].
        K: stiffness of the floor [N/m].
        c: damping of the floor [N s/m].
        duration: when its state is asked for [s].
        weight_in_contact: share of gravity that acts during contact: 1 in nature; the constraints
            of some simulators cancel most or all of it.
        damps_rebound: whether the damper acts while the ball rises, too: that of some does not.
    """

    name: str
    height: float
    g: float
    K: float
    c: float
    duration: float
    weight_in_contact: float = 1.0
    damps_rebound: bool = True

    @property
    def parameters(self) -> tuple[str, ...]:
        """What its state is differentiated with respect to."""
        return tuple(name for name in DIFFERENTIATED if getattr(self, name) != 0.0)


PROBLEMS = (
    Problem("spring", height=0.1, g=9.81, K=1e5, c=0.0, duration=0.85),
    Problem("spring and damper", height=0.1, g=9.81, K=1e5, c=20.0, duration=0.75),
)


@dataclasses.dataclass(frozen=True)
class Truth:
    """State and derivatives of a problem.

    Attributes:
        state: height [m] and velocity [m/s] at the end.
        gradient: their derivatives with respect to the logarithm of each parameter, two rows.
        uncertainty: largest disagreement of two differences, relative to the largest derivative.
        bounces: how often the ball left the floor.
    """

    state: tuple[float, float]
    gradient: tuple[tuple[float, ...], tuple[float, ...]]
    uncertainty: float
    bounces: int


@functools.cache
def closed_form(problem: Problem) -> Truth:
    """The ball's state and derivatives, to double precision."""
    with mp.workdps(DIGITS):
        values = {name: mpf(value) for name, value in _numbers(problem).items()}
        z, v, bounces = _final(values)
        rough, fine = (_differences(values, problem.parameters, mpf(step)) for step in STEPS[::-1])
        size = max(abs(entry) for row in fine for entry in row)
        apart = max(
            abs(a - b)
            for row, other in zip(fine, rough, strict=True)
            for a, b in zip(row, other, strict=True)
        )
        rows = tuple(tuple(float(entry) for entry in row) for row in fine)
        return Truth((float(z), float(v)), (rows[0], rows[1]), float(apart / size), bounces)


def _numbers(problem: Problem) -> dict[str, float]:
    fields = dataclasses.fields(problem)
    return {each.name: getattr(problem, each.name) for each in fields if each.name != "name"}


def _differences(values: dict[str, Any], names: tuple[str, ...], step: Any) -> list[list[Any]]:
    columns = []
    for name in names:
        ends = [_final(values | {name: values[name] * (1 + sign * step)})[:2] for sign in (1, -1)]
        columns.append([(up - down) / (2 * step) for up, down in zip(*ends, strict=True)])
    return [[column[row] for column in columns] for row in range(2)]


def _final(values: dict[str, Any]) -> tuple[Any, Any, int]:
    """Height, velocity and bounces at the end, phase by phase."""
    g, left = values["g"], values["duration"]
    z, v, bounces = values["height"], mpf(0), 0
    while True:
        fall = (v + mp.sqrt(v * v + 2 * g * z)) / g
        if fall >= left:
            return z + v * left - g * left * left / 2, v - g * left, bounces
        speed = g * fall - v
        left -= fall
        span, z, v = _contact(values, speed, left)
        if span >= left:
            return z, v, bounces
        left, bounces = left - span, bounces + 1


def _contact(values: dict[str, Any], speed: Any, longest: Any) -> tuple[Any, Any, Any]:
    """Duration of a contact that begins at this speed, with height and velocity at its end."""
    K, c, g = values["K"], values["c"], values["g"] * values["weight_in_contact"]
    # Of each phase its damping, what is zero at its end, and when that is, in halves of a period.
    phases: list[tuple[Any, Callable[[Any, Any], Any], tuple[str, str]]]
    phases = [(c, lambda depth, rate: K * depth + c * rate, ("0.9", "1.05"))]
    if not values["damps_rebound"]:
        sinks = (c, lambda depth, rate: rate, ("0.4", "0.6"))
        phases = [sinks, (mpf(0), lambda depth, rate: depth, ("0.4", "0.6"))]
    passed, now = mpf(0), (mpf(0), speed)
    for damping, left, about in phases:
        at, half = _phase(K, damping, g, now), mp.pi / _frequency(K, damping)
        span = mp.findroot(
            lambda t, at=at, left=left: left(*at(t)), [mpf(each) * half for each in about]
        )
        now, passed = at(min(span, longest - passed)), passed + span
        if passed >= longest:
            break
    return passed, -now[0], -now[1]


def _phase(K: Any, c: Any, g: Any, begin: Any) -> Callable[[Any], tuple[Any, Any]]:
    """Depth and its rate over time: K δ + c δ' + δ'' = g from a depth and its rate."""
    omega, rest = _frequency(K, c), g / K
    cosine = begin[0] - rest
    sine = (begin[1] + c / 2 * cosine) / omega

    def at(t: Any) -> tuple[Any, Any]:
        decay, cos, sin = mp.exp(-c / 2 * t), mp.cos(omega * t), mp.sin(omega * t)
        depth = rest + decay * (sine * sin + cosine * cos)
        rate = decay * (
            (sine * omega - c / 2 * cosine) * cos - (cosine * omega + c / 2 * sine) * sin
        )
        return depth, rate

    return at


def _frequency(K: Any, c: Any) -> Any:
    return mp.sqrt(K - c * c / 4)
