"""The compliant walker with actuators: torques on both legs, and feet that extend."""

from collections.abc import Callable

import numpy as np

from .compliant import accelerations, foot, friction_share, normal_force

LIGHT = 0.01
"""Share of the weight in the denominator of the loads' shares."""


def actuated_derivative(
    t: float,
    y: np.ndarray,
    p: np.ndarray,
    torques: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray],
    extension: Callable[[float, float], tuple[float, float]] = lambda angle, rate: (0.0, 0.0),
) -> np.ndarray:
    """Time derivative of the state (8,).

    Args:
        t, y, p: as in `compliant.derivative`.
        torques: on both legs, by their angles, their rates and their shares of the load.
        extension: of a foot and its rate, by its leg's angle and rate.
    """
    along, normal = np.zeros(2), np.zeros(2)
    for leg in range(2):
        depth, sinking, slip = foot(y, leg, p)
        more, faster = extension(y[2 + leg], y[6 + leg])
        if y[6 + leg] < 0.0:
            normal[leg] = normal_force(depth + more, sinking + faster, p[9:15])
        along[leg] = -friction_share(normal[leg], slip, 0.0, p[15:24])[0] * normal[leg]
    weight = np.hypot(p[6], p[7]) * (2.0 * p[0] + p[5])
    shares = normal / (normal.sum() + LIGHT * weight)
    on_legs = tuple(torques(y[2:4], y[6:8], shares))
    return np.concatenate([y[4:8], accelerations(y, p, tuple(along), tuple(normal), on_legs)])
