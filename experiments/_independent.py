"""The seed's walker written a second time, without JAX: plain equations in SciPy's hands.

Independent of `jaxbiped`: the hip is eliminated from the 4 × 4 mass matrix, where the package
eliminates the legs. Compiled with numba where it is installed, plain Python where it is not.
"""

import functools
import importlib.util
import math
from collections.abc import Callable
from typing import Any

import numpy as np

START = np.array([0.0, 0.395, -0.2479, 0.1655, 0.49797, 0.05853, -0.0052, -1.2565])
"""The seed's start: hip x, hip z, θ1, θ2 and their rates."""

MASS, INERTIA, LENGTH, CENTRE, RADIUS = 1.0, 0.0096, 0.40, 0.10, 0.08
STIFFNESS, DAMPING = 1e6, 1e7
STATIC, KINETIC, PEAK_SPEED, DECAY = 0.50, 0.40, 1e-4, 1000.0
LAWS = (STIFFNESS, DAMPING, DECAY)
"""K, c and ξ, which derivatives are taken by."""
COEFFICIENTS = (STATIC, KINETIC)
PULL_X, PULL_Z = 9.8 * math.sin(0.02), -9.8 * math.cos(0.02)

try:
    import numba
except ImportError:
    numba = None

compiled: Callable[..., Any] = (
    (lambda function: function) if numba is None else numba.njit(error_model="numpy")
)


@compiled
def contact(hip_z, vx, vz, sine, cosine, rate, laws=LAWS, coefficients=COEFFICIENTS):
    """Force on one foot along the slope and along its normal [N]."""
    stiffness, damping, decay = laws
    static, kinetic = coefficients
    arm = LENGTH - RADIUS
    depth = RADIUS - (hip_z - arm * cosine)
    if depth <= 0.0 or rate >= 0.0:
        return 0.0, 0.0
    sinking = -(vz + arm * sine * rate)
    normal = max(0.0, stiffness * depth * math.sqrt(depth) + damping * depth * sinking)
    slip = vx + arm * cosine * rate + RADIUS * rate
    speed = abs(slip)
    if speed < PEAK_SPEED:
        size = static * normal * (1.0 - ((speed - PEAK_SPEED) / PEAK_SPEED) ** 2)
    else:
        left = math.exp(-decay * (speed - PEAK_SPEED))
        size = normal * (kinetic + (static - kinetic) * left)
    return -math.copysign(size, slip), normal


@compiled
def rates(y, laws=LAWS, coefficients=COEFFICIENTS):
    """Time derivative of the eight numbers of the state."""
    _, hip_z, angle_1, angle_2, vx, vz, rate_1, rate_2 = y
    s_1, c_1, s_2, c_2 = math.sin(angle_1), math.cos(angle_1), math.sin(angle_2), math.cos(angle_2)
    along_1, normal_1 = contact(hip_z, vx, vz, s_1, c_1, rate_1, laws, coefficients)
    along_2, normal_2 = contact(hip_z, vx, vz, s_2, c_2, rate_2, laws, coefficients)
    arm, moment, total = LENGTH - RADIUS, MASS * CENTRE, 2.0 * MASS
    spin_1, spin_2 = moment * rate_1 * rate_1, moment * rate_2 * rate_2
    push_x = total * PULL_X + along_1 + along_2 + s_1 * spin_1 + s_2 * spin_2
    push_z = total * PULL_Z + normal_1 + normal_2 - c_1 * spin_1 - c_2 * spin_2
    turn_1 = moment * (c_1 * PULL_X + s_1 * PULL_Z)
    turn_1 += arm * s_1 * normal_1 + (arm * c_1 + RADIUS) * along_1
    turn_2 = moment * (c_2 * PULL_X + s_2 * PULL_Z)
    turn_2 += arm * s_2 * normal_2 + (arm * c_2 + RADIUS) * along_2
    # Eliminate the hip, whose block of the mass matrix is `total` times the identity.
    share = moment / total
    turn_1 -= share * (c_1 * push_x + s_1 * push_z)
    turn_2 -= share * (c_2 * push_x + s_2 * push_z)
    own = INERTIA + moment * CENTRE - share * moment
    mixed = -share * moment * (c_1 * c_2 + s_1 * s_2)
    determinant = own * own - mixed * mixed
    alpha_1 = (own * turn_1 - mixed * turn_2) / determinant
    alpha_2 = (own * turn_2 - mixed * turn_1) / determinant
    ax = (push_x - moment * (c_1 * alpha_1 + c_2 * alpha_2)) / total
    az = (push_z - moment * (s_1 * alpha_1 + s_2 * alpha_2)) / total
    return vx, vz, rate_1, rate_2, ax, az, alpha_1, alpha_2


@compiled
def right_hand_side(t, y, laws=LAWS, coefficients=COEFFICIENTS):
    """What `scipy.integrate.solve_ivp` calls."""
    state = (y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[7])
    return np.array(rates(state, laws, coefficients))


def solved(
    method: str, duration: float, rtol: float, atol: float, start: np.ndarray = START
) -> np.ndarray:
    """The final state, by one of SciPy's methods."""
    from scipy.integrate import solve_ivp

    options: dict[str, Any] = dict(method=method, rtol=rtol, atol=atol)
    with np.errstate(over="ignore"):  # of columns of the Jacobian that are zero
        solution = solve_ivp(right_hand_side, (0.0, duration), start, **options)
    return solution.y[:, -1]


def reference(duration: float, start: np.ndarray = START) -> np.ndarray:
    """The final state, by Radau at a relative tolerance of 1e-11."""
    return solved("Radau", duration, 1e-11, 1e-13, start)


@functools.cache
def lsoda_address() -> int | None:
    """Address of the right-hand side in numbalsoda's form; None where that is not installed."""
    if numba is None or importlib.util.find_spec("numbalsoda") is None:
        return None
    import numbalsoda

    def derivative(t, y, out, parameters):
        value = rates((y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[7]))
        for i in range(8):
            out[i] = value[i]

    return numba.cfunc(numbalsoda.lsoda_sig)(derivative).address


def lsoda(duration: float, rtol: float, atol: float, start: np.ndarray = START) -> np.ndarray:
    """The final state, by numbalsoda."""
    import numbalsoda

    times = np.array([0.0, duration])
    states, _ = numbalsoda.lsoda(lsoda_address(), start, times, rtol=rtol, atol=atol)
    return states[-1]


@functools.cache
def lsoda_batch() -> Callable[[np.ndarray, np.ndarray, float, float], np.ndarray]:
    """numbalsoda over many starts (n, 8) on all of numba's threads; gives final states (n, 8).

    A lane that fails is not a number.
    """
    from numbalsoda import lsoda as compiled_lsoda

    address = lsoda_address()

    @numba.njit(parallel=True)
    def batch(starts, times, rtol, atol):
        finals = np.empty_like(starts)
        for i in numba.prange(starts.shape[0]):
            states, done = compiled_lsoda(
                address, starts[i], times, np.array([0.0]), rtol, atol, 100000
            )
            finals[i] = states[-1] if done else np.full(8, np.nan)
        return finals

    return batch
