"""The seed's gait found a second time: equations of motion in numba, SciPy's Radau, differences.

Nothing here is shared with the package. Derivatives by parameters are central differences of
converged solves; a turn's derivative, for the multipliers, is the variational equation's.
"""

import functools
import math

import numba
import numpy as np
from scipy.integrate import solve_ivp

from tests.reference import SEED

NAMES = ("m", "J", "l", "d", "r", "hip", "g", "slope", "n", "K", "c", "mu_s", "mu_k", "v0", "xi")
TOLERANCE = 2e-12
EXCHANGED = [1, 3, 2, 4, 5, 7, 6]  # what recurs of a state, leg 2 now the one that stands
TINY = 1e-30j  # a step that rounds nothing away: f(y + TINY v).imag / 1e-30 is f'(y) v exactly


@numba.njit(cache=False)
def _foot(y, i, p):
    """Depth and its rate, the normal force while pressed, the slip, and the arms z and x."""
    length, r, n, K, c = p[2], p[4], p[8], p[9], p[10]
    z, x = (length - r) * np.cos(y[2 + i]) + r, (length - r) * np.sin(y[2 + i])
    depth, rate = z - y[1], -(y[5] + x * y[6 + i])
    # Just before the ground the force is continued smoothly: a power of |depth|.
    normal = K * (math.copysign(1.0, depth.real) * depth) ** n + c * depth * rate
    return depth, rate, normal, y[4] + z * y[6 + i], z, x


@numba.njit(cache=False)
def _branch(y, p):
    """Of each foot: whether it carries, which way it slips and whether slower than v0."""
    out = np.zeros((2, 3))
    for i in range(2):
        depth, _, normal, slip, _, _ = _foot(y, i, p)
        if depth > 0.0 and y[6 + i] < 0.0 and normal > 0.0:
            out[i] = 1.0, math.copysign(1.0, slip), 1.0 if abs(slip) < p[13] else 0.0
    return out


@numba.njit(cache=False)
def _switches(y, p):
    """What passes zero where a branch changes."""
    out = np.zeros((2, 6), dtype=y.dtype)
    for i in range(2):
        depth, rate, _, slip, _, _ = _foot(y, i, p)
        size = math.copysign(1.0, depth.real) * depth
        force = p[9] * size ** (p[8] - 1.0) + p[10] * rate  # normal / depth
        out[i] = depth, force, y[6 + i], slip, slip - p[13], slip + p[13]
    return out.ravel()


@numba.njit(cache=False)
def _rates(y, p, branch):
    """Rates of y, real or complex, on one branch of the contact; the last leg's normal force."""
    m, J, _, d, _, hip, g, slope, _, _, _, mu_s, mu_k, v0, xi = p
    total = 2 * m + hip
    mass = np.zeros((4, 4), dtype=y.dtype)
    force = np.zeros(4, dtype=y.dtype)
    mass[0, 0] = mass[1, 1] = total
    force[0], force[1] = total * g * math.sin(slope), -total * g * math.cos(slope)
    for i in range(2):
        a, w, k = y[2 + i], y[6 + i], 2 + i
        sine, cosine, md = np.sin(a), np.cos(a), m * d
        mass[k, k] = J + m * d * d
        mass[0, k] = mass[k, 0] = md * cosine
        mass[1, k] = mass[k, 1] = md * sine
        force[0] += md * sine * w * w
        force[1] -= md * cosine * w * w
        force[k] += md * g * np.sin(slope - a)
        _, _, normal, slip, z, x = _foot(y, i, p)
        carries, way, slow = branch[i]
        normal = carries * normal
        s = way * slip
        if slow:
            size = mu_s * normal * (1.0 - ((s - v0) / v0) ** 2)
        else:
            size = normal * (mu_k + (mu_s - mu_k) * np.exp(-xi * (s - v0)))
        friction = -way * size
        force[0] += friction
        force[1] += normal
        force[k] += normal * x + friction * z
    return np.concatenate((y[4:], np.linalg.solve(mass, force))), normal


@numba.njit(cache=False)
def _field(t, y, p):
    return _rates(y, p, _branch(y, p))[0]


@numba.njit(cache=False)
def _slopes(y, p, branch):
    """The field's Jacobian, (8, 8)."""
    out = np.empty((8, 8))
    for i, e in enumerate(np.eye(8)):
        out[:, i] = _rates(y + TINY * e, p, branch)[0].imag / 1e-30
    return out


@numba.njit(cache=False)
def _variation(t, u, p, branch):
    """Rates of the state, the first row of u, and of seven displacements of it, the others."""
    rows = u.reshape(8, 8)
    out = rows @ _slopes(rows[0], p, branch).T
    out[0] = _rates(rows[0], p, branch)[0]
    return out.ravel()


@numba.njit(cache=False)
def _delay(y, p, branch):
    """Time from y to the nearest switch, along the field."""
    along = _switches(y + TINY * _rates(y, p, branch)[0], p)
    delays = -along.real / (along.imag / 1e-30)
    return delays[np.argmin(np.abs(delays))]


@numba.njit(cache=False)
def _load(y, p):
    """The larger normal force: by exchanging the legs, each is the last one once."""
    swapped = y.copy()
    swapped[2], swapped[3], swapped[6], swapped[7] = y[3], y[2], y[7], y[6]
    return max(_rates(y, p, _branch(y, p))[1], _rates(swapped, p, _branch(swapped, p))[1])


def parameters(**changes):
    return np.array([{**SEED, **changes}[name] for name in NAMES])


def turn(x, p):
    """One footstep from mid-stance (z, θ1, θ2 and rates): the next, period, length and peak."""

    def passes(t, y):
        return y[2] + (1.0 if t < 0.25 else 0.0)  # leg 1 in its turn as the standing leg

    passes.terminal, passes.direction = True, -1
    solution = solve_ivp(
        lambda t, y: _field(t, y, p),
        (0.0, 1.0),
        np.concatenate([[0.0], x]),
        "Radau",
        rtol=TOLERANCE,
        atol=TOLERANCE * 1e-2,
        jac=lambda t, y: _slopes(y, p, _branch(y, p)),
        events=passes,
        dense_output=True,
    )
    y, period = solution.y_events[0][0], solution.t_events[0][0]
    loads = [_load(each, p) for each in solution.y.T]
    k = int(np.argmax(loads))
    around = np.linspace(solution.t[k - 1], solution.t[k + 1], 9)
    fit = np.polyfit(around - solution.t[k], [_load(solution.sol(t), p) for t in around], 6)
    inner = np.linspace(around[0], around[-1], 4001) - solution.t[k]
    peak = np.max(np.polyval(fit, inner))
    return y[EXCHANGED], np.array([period, y[0], y[0] / period, peak])


@functools.cache
def jacobian(start):
    """Derivative of `turn` at the seed's parameters, by central differences, (7, 7)."""
    x, p, h = np.array(start), parameters(), 1e-5
    return np.stack(
        [(turn(x + h * e, p)[0] - turn(x - h * e, p)[0]) / (2 * h) for e in np.eye(7)], axis=1
    )


def _pieces(x, p, period):
    """Times at which the motion from x leaves a branch of the contact, and those branches."""
    solution = solve_ivp(
        lambda t, y: _field(t, y, p),
        (0.0, period),
        np.concatenate([[0.0], x]),
        "Radau",
        rtol=1e-10,
        atol=1e-12,
        jac=lambda t, y: _slopes(y, p, _branch(y, p)),
        events=[lambda t, y, k=k: _switches(y, p)[k] for k in range(12)],
        dense_output=True,
    )
    times = np.concatenate([[0.0], np.sort(np.concatenate(solution.t_events)), [period]])
    branches = [_branch(solution.sol(t), p) for t in (times[1:] + times[:-1]) / 2]
    left = [k for k in range(len(branches) - 1) if np.any(branches[k] != branches[k + 1])]
    left.append(len(branches) - 1)
    return times[[k + 1 for k in left]], [branches[k] for k in left]


def _carried(u, start, end, p, branch, tolerance):
    """State and displacements at the end of a piece, where the field is smooth."""
    solution = solve_ivp(
        lambda t, u: _variation(t, u, p, branch),
        (start, end),
        u,
        "Radau",
        (end,),
        rtol=tolerance,
        atol=tolerance * 1e-2,
        # Newton's method does without the displacements' dependence on the state.
        jac=lambda t, u: np.kron(np.eye(8), _slopes(u[:8], p, branch)),
    )
    return solution.y[:, -1]


def turn_derivative(x, p, period, tolerance=1e-8):
    """Derivative of `turn` at a gait, (7, 7), by the variational equation.

    The field is continuous, so nothing is added at a switch. But its Jacobian jumps by some 1e6
    there: pieces end on the switches, to rounding.
    """
    rows = np.zeros((8, 8))
    rows[0, 1:], rows[1:, 1:] = x, np.eye(7)
    u, start = rows.ravel(), 0.0
    ends, branches = _pieces(x, p, period)
    for end, branch in zip(ends, branches, strict=True):
        u = _carried(u, start, end, p, branch, tolerance)
        delay = 0.0 if end == period else _delay(u[:8], p, branch)
        u, start = u + delay * _variation(end, u, p, branch), end + delay
    rows = u.reshape(8, 8)
    velocity, moved = _field(period, rows[0], p)[EXCHANGED], rows[1:, EXCHANGED].T
    # Where θ2 has moved, the arrival comes sooner or later.
    return moved - np.outer(velocity, moved[2]) / velocity[2]


def radius(x, p, period):
    """The gait's largest multiplier in absolute value."""
    return np.max(np.abs(np.linalg.eigvals(turn_derivative(x, p, period))))


def gait(start, p, guess=None):
    """The fixed point near `guess` or `start`, and the measures there."""
    x, slope = np.array(start), jacobian(start) - np.eye(7)
    x[0] += p[2] - SEED["l"]  # a longer leg raises the hip
    x = x if guess is None else guess
    for _ in range(12):
        reached, measures = turn(x, p)
        step = np.linalg.solve(slope, reached - x)
        x = x - step
        if np.max(np.abs(step)) < 1e-11:
            return x, measures
    raise AssertionError("no gait of the reference near the start")


def sensitivities(start, name, h):
    """d(state, measures, radius)/d log(parameter) by central differences of order four.

    By the parameter itself where it is zero.
    """

    def at(step, guess=None):
        seed = SEED[name]
        p = parameters(**{name: seed * math.exp(step) if seed else step})
        x, measures = gait(start, p, guess)
        return np.array([*x, *measures, radius(x, p, measures[0])])

    up, down = at(h), at(-h)
    # Parabolas through the gaits known so far lead to the next.
    above = at(2 * h, 3 * (up[:7] - np.array(start)) + down[:7])
    below = at(-2 * h, 3 * (down[:7] - np.array(start)) + up[:7])
    return (8 * (up - down) - (above - below)) / (12 * h)
