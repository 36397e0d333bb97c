"""The seed's gait found a second time: footsteps, a search and differences, all written anew.

Nothing here is shared with the package. `tests/collocation.py` solves the motion; SciPy's Radau,
which knows nothing of branches, checks it. Derivatives with respect to parameters are central
differences of converged gaits; a cycle's derivative, for Newton's method and the multipliers, is
the variational equation's, solved by the same steps.
"""

import functools
import math

import numpy as np
from scipy.integrate import solve_ivp

from tests.collocation import Branch, Step, branch_of
from tests.reference import SEED

NAMES = ("m", "J", "l", "d", "r", "hip", "g", "slope", "n", "K", "c", "mu_s", "mu_k", "v0", "xi")
EXCHANGED = [1, 3, 2, 4, 5, 7, 6]  # what recurs of a state, leg 2 now the one that stands
MID_SWING = 0.25  # [s]: leg 1 passes the normal as the swinging leg before, as the standing after


def parameters(**changes):
    return np.array([{**SEED, **changes}[name] for name in NAMES])


def turn(x, p):
    """One footstep from mid-stance (z, θ1, θ2 and rates): the next, its derivative and measures.

    The measures are period, length, speed and peak of the normal force.
    """
    y, moved = np.concatenate([[0.0], x]), np.eye(8)[:, 1:]
    t, h, peak, branch = 0.0, 1e-5, 0.0, branch_of(np.concatenate([[0.0], x]), p)
    while t < 1.0:
        motion = Branch(p, branch)
        step = Step(motion, y, h)
        error = step.error
        if not error < 1.0:
            h *= max(0.2, 0.9 * error ** (-1 / 6)) if step.found else 0.25
            continue
        longer, left = h * min(4.0, 0.9 * max(error, 1e-9) ** (-1 / 6)), step.left
        if left is not None:
            h *= left
            for _ in range(3):
                h += motion.delay(Step(motion, y, h).end)
            step = Step(motion, y, h)
        last = t + h > MID_SWING and step.end[2] < 0.0
        if last:
            for _ in range(5):
                h -= step.end[2] / step.end[6]
                step = Step(motion, y, h)
        peak, moved = max(peak, step.peak), step.carried(moved)
        y, t, h = step.end, t + h, longer
        velocity = motion.field(y[None])[0]
        if last:
            # Where θ2 has moved, the arrival comes sooner or later.
            moved = moved - np.outer(velocity, moved[2]) / velocity[2]
            return y[EXCHANGED], moved[EXCHANGED], np.array([t, y[0], y[0] / t, peak])
        if left is not None:
            branch, h = branch_of(y + 1e-9 * velocity, p), 1e-5
    raise AssertionError("no turn of the reference within a second")


def turn_by_scipy(x, p):
    """The next state, period and length of the same footstep."""

    def field(_, y):
        return Branch(p, branch_of(y, p)).field(y[None])[0]

    def passes(t, y):
        return y[2] + (1.0 if t < MID_SWING else 0.0)

    passes.terminal, passes.direction = True, -1
    solution = solve_ivp(
        field,
        (0.0, 1.0),
        np.concatenate([[0.0], x]),
        "Radau",
        rtol=2e-12,
        atol=2e-14,
        jac=lambda _, y: Branch(p, branch_of(y, p)).slopes(y[None])[0],
        events=passes,
    )
    y, period = solution.y_events[0][0], solution.t_events[0][0]
    return y[EXCHANGED], period, y[0]


def jacobian(x, p):
    """Derivative of `turn` by plain differences, (7, 7): what its own is checked with."""
    h, at = 1e-6, lambda step: turn(np.array(x) + step, p)[0]
    return np.stack([(at(h * e) - at(-h * e)) / (2 * h) for e in np.eye(7)], axis=1)


def gait(guess, p):
    """The fixed point near `guess`, the measures and the turn's derivative there."""
    x = np.array(guess)
    for _ in range(12):
        reached, slopes, measures = turn(x, p)
        step = np.linalg.solve(slopes - np.eye(7), reached - x)
        x = x - step
        if np.max(np.abs(step)) < 1e-11:
            return x, measures, slopes
    raise AssertionError("no gait of the reference near the start")


@functools.cache
def gait_of_the_seed(start):
    return gait(start, parameters())


def sensitivities(start, name, h):
    """d(state, measures, radius)/d log(parameter) by central differences of order four.

    By the parameter itself where it is zero.
    """
    seed, size = gait_of_the_seed(start)[0], SEED[name]

    def at(step, guess):
        p = parameters(**{name: size * math.exp(step) if size else step})
        x, measures, slopes = gait(guess, p)
        return np.array([*x, *measures, np.max(np.abs(np.linalg.eigvals(slopes)))])

    # Parabolas through the gaits known so far lead to the next; a longer leg raises the hip.
    up = at(h, seed + (np.eye(7)[0] * SEED["l"] * math.expm1(h) if name == "l" else 0.0))
    down = at(-h, 2 * seed - up[:7])
    above = at(2 * h, 3 * (up[:7] - seed) + down[:7])
    below = at(-2 * h, 3 * (down[:7] - seed) + up[:7])
    return (8 * (up - down) - (above - below)) / (12 * h)
