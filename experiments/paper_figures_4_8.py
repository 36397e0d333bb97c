"""The paper's figures 4 to 8: the seed's walk on its slope of 0.02 rad, and a moving picture."""

import jax.numpy as jnp
import numpy as np
from _experiment import Options, experiment

import jaxbiped as jb
from jaxbiped import plot

DURATION, QUICK_DURATION = 10.0, 2.0
GIF_DURATION = 2.0
GAIT = 0.88
"""A little under two footsteps [s]: what figure 4 shows."""


@experiment
def main(options: Options):
    duration = options.sized(DURATION, QUICK_DURATION)
    scene = jb.seed_scene(slope=0.02)
    walk = jb.simulate(scene, jb.seed_state(), duration=duration)
    short = jb.simulate(scene, jb.seed_state(), duration=GIF_DURATION)
    end = float(walk.t[-1])
    figures = {
        "fig4_strobe.png": plot.gait_strobe(scene, walk, start=end - GAIT, stop=end),
        "fig5_phase_portrait.png": plot.phase_portrait(scene, walk),
        "fig6_leg_angles.png": plot.leg_angles(scene, walk),
        "fig7_penetrations.png": plot.penetrations(scene, walk),
        "fig8_contact_forces.png": plot.contact_forces(scene, walk),
    }
    pictures = [options.save(figure, name) for name, figure in figures.items()]
    gif = plot.save_animation(plot.animate(scene, short), options.path("walk.gif"))
    told = {"duration_s": duration, "outcome": str(walk.outcome), "steps": int(walk.accepted)}
    return told | measure(scene, walk) | {"pictures": [*pictures, str(gif)]}


def measure(scene, walk):
    """The numbers that each figure shows, at the solver's own steps."""
    state = walk.state
    both, forces = jb.dynamics.feet(scene, state), jb.dynamics.foot_forces(scene, state)
    depths = [jnp.where(jb.dynamics.touches(foot), foot.penetration, 0.0) for foot in both]

    def ends(values):
        return [float(np.min(values)), float(np.max(values))]

    return {
        "fig4_strobe": {"distance_along_slope_m": float(state.hip_x[-1] - state.hip_x[0])},
        "fig5_phase_portrait": {
            "angle_range_rad": ends(state.theta_1),
            "rate_range_rad_s": ends(state.omega_1),
        },
        "fig6_leg_angles": {
            "angle_range_leg_1_rad": ends(state.theta_1),
            "angle_range_leg_2_rad": ends(state.theta_2),
        },
        "fig7_penetrations": {"largest_m": [float(jnp.max(depth)) for depth in depths]},
        "fig8_contact_forces": {
            "peak_normal_N": [float(jnp.max(force.normal)) for force in forces],
            "peak_tangential_N": [float(jnp.max(jnp.abs(force.tangential))) for force in forces],
        },
    }


if __name__ == "__main__":
    main()
