"""Figure of an optimum's motors: their torques over the cycle, and what free ones could save."""

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped.dynamics._walker_motion import WalkerMotion
from jaxbiped.optimise._optimum import Optimum
from jaxbiped.optimise._torque_gap import TorqueGap
from jaxbiped.plot import style
from jaxbiped.simulate._simulate import simulate

_POINTS = 200
"""Times at which torques are drawn."""


def motor_torques(best: Optimum, gap: TorqueGap | None = None) -> Figure:
    """Draws the torques of all motors over the cycle of an optimum's gait.

    Args:
        best: the optimum of a walker with motors.
        gap: from `torque_gap`, for a second panel with ∂H/∂u of each motor: the derivative of the
            Hamiltonian with respect to its torque, which is zero for the best torque of all.

    Returns:
        A new figure.

    Raises:
        ArgumentError: an argument of another type, or a scene without motors.
    """
    check_type("best", best, Optimum)
    if gap is not None:
        check_type("gap", gap, TorqueGap)
    measures, scene = best.gait.measures, best.scene.minimal
    times = np.linspace(0.0, float(measures.period), _POINTS, endpoint=False)
    saved = jnp.asarray(times)
    states = simulate(scene, measures.state, duration=float(measures.period), save=saved).state
    motors = jax.vmap(lambda state: WalkerMotion(scene, state).motors())(states)
    if not motors:
        raise ArgumentError("best is not allowed: its scene has no motors.")
    panels = 1 if gap is None else 2
    figure = style.new_figure(4.6 * panels, 3.4)
    axes = figure.subplots(1, panels, squeeze=False)[0]
    for name, drives in motors.items():
        for k, drive in enumerate(drives, 1):
            label = name if len(drives) == 1 else f"{name}, angle {k}"
            axes[0].plot(times, np.asarray(drive.torque), linewidth=1.2, label=label)
    style.dress(axes[0], "Torques of the motors", "time (s)", "torque (N m)", panel=panels > 1)
    if gap is not None:
        for name, slopes in gap.switching.items():
            axes[1].plot(gap.times, slopes, linewidth=1.2, label=name)
        unit = best.quantities[next(iter(best.problem.weights))].unit_in_figure
        label = rf"$\partial H/\partial u$ (({unit})/(N m s))"
        style.dress(axes[1], "What torques could still save", "time (s)", label, panel=True)
    for ax in axes:
        ax.margins(x=0.01)
        style.legend_below(ax, columns=3)
    return figure
