"""The paper's figures 4 to 8: the seed's walk on its slope of 0.02 rad, and a moving picture."""

from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from _options import Options, parse

import jaxbiped as jb
from jaxbiped import plot

DURATION = 10.0
QUICK_DURATION = 2.0
GIF_DURATION = 2.0
GAIT = 0.88
"""A little under two footsteps [s]: what figure 4 shows."""


def main() -> None:
    options = parse(__doc__ or "")
    duration = QUICK_DURATION if options.quick else DURATION
    scene = jb.seed_scene(slope=0.02)
    walk = jb.simulate(scene, jb.seed_state(), duration=duration)
    options.say(f"{walk.outcome} for {float(walk.t[-1]):g} s in {int(walk.accepted)} steps")
    pictures = draw(options, scene, walk)
    numbers = {"duration_s": duration, "outcome": str(walk.outcome)} | measure(scene, walk)
    for name, values in numbers.items():
        options.say(f"{name}: {values}")
    options.finish(numbers | {"pictures": [str(path) for path in pictures]})


def draw(options: Options, scene: jb.Scene, walk: jb.Trajectory) -> list[Path]:
    """Writes every picture."""
    end = float(walk.t[-1])
    figures = {
        "fig4_strobe.png": plot.gait_strobe(scene, walk, start=end - GAIT, stop=end),
        "fig5_phase_portrait.png": plot.phase_portrait(scene, walk),
        "fig6_leg_angles.png": plot.leg_angles(scene, walk),
        "fig7_penetrations.png": plot.penetrations(scene, walk),
        "fig8_contact_forces.png": plot.contact_forces(scene, walk),
    }
    paths = []
    for name, figure in figures.items():
        paths.append(options.path(name))
        figure.savefig(paths[-1], dpi=150)
    short = jb.simulate(scene, jb.seed_state(), duration=GIF_DURATION)
    paths.append(plot.save_animation(plot.animate(scene, short), options.path("walk.gif")))
    return paths


def measure(scene: jb.Scene, walk: jb.Trajectory) -> dict[str, Any]:
    """The numbers that each figure shows, at the solver's own steps."""
    state = walk.state
    both, forces = jb.dynamics.feet(scene, state), jb.dynamics.foot_forces(scene, state)
    depths = [jnp.where(jb.dynamics.touches(foot), foot.penetration, 0.0) for foot in both]
    return {
        "fig4_strobe": {
            "distance_along_slope_m": float(state.hip_x[-1] - state.hip_x[0]),
        },
        "fig5_phase_portrait": {
            "angle_range_rad": _range(state.theta_1),
            "rate_range_rad_s": _range(state.omega_1),
        },
        "fig6_leg_angles": {
            "angle_range_leg_1_rad": _range(state.theta_1),
            "angle_range_leg_2_rad": _range(state.theta_2),
        },
        "fig7_penetrations": {"largest_m": [float(jnp.max(depth)) for depth in depths]},
        "fig8_contact_forces": {
            "peak_normal_N": [float(jnp.max(force.normal)) for force in forces],
            "peak_tangential_N": [float(jnp.max(jnp.abs(force.tangential))) for force in forces],
        },
    }


def _range(values: Any) -> list[float]:
    return [float(np.min(values)), float(np.max(values))]


if __name__ == "__main__":
    main()
