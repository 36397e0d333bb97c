"""The paper's figures 4 to 8: the seed's walk on its slope of 0.02 rad, and a moving picture."""

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
    rows = jb.measure.trajectory_dataset(scene, walk)

    def ends(name):
        return [float(rows[name].min()), float(rows[name].max())]

    def largest(values):
        return values.max("time").values.tolist()

    return {
        "fig4_strobe": {"distance_along_slope_m": float(rows.hip_x[-1] - rows.hip_x[0])},
        "fig5_phase_portrait": {
            "angle_range_rad": ends("theta_1"),
            "rate_range_rad_s": ends("omega_1"),
        },
        "fig6_leg_angles": {f"angle_range_leg_{k}_rad": ends(f"theta_{k}") for k in (1, 2)},
        "fig7_penetrations": {"largest_m": largest(rows.penetration.where(rows.touches))},
        "fig8_contact_forces": {
            "peak_normal_N": largest(rows.normal_force),
            "peak_tangential_N": largest(abs(rows.tangential_force)),
        },
    }


if __name__ == "__main__":
    main()
