"""Comparison of force models: the seed's walk under every law of contact.

The paper sets out to compare several models of the normal force and of friction, and shows one of
each. Here each normal law (with the seed's friction) and each law of friction (with the seed's
normal law), matched to the seed's parameters, walks, is timed, searched for its gait and judged:
force_models_normal.png, force_models_friction.png, force_models_measures.png. Its figures 9 and 10,
leg angle and contact force on several slopes: figure_9_leg_angle.png, figure_10_contact_force.png.
"""

from _experiment import Options, experiment
from _force_laws import CRITERIA, SEED, deviations, findings, verdict
from _force_pictures import friction_picture, measures_picture, normal_picture
from _force_samples import first_stance, motion
from _force_slopes import descents
from _scenes import seed_with

import jaxbiped as jb

LAWS = {"normal": tuple(jb.laws.NORMAL_LAWS), "friction": tuple(jb.laws.FRICTION_LAWS)}
QUICK_LAWS = {
    "normal": ("ristow-schafer", "hunt-crossley"),
    "friction": ("bengisu-akay", "coulomb"),
}
REPEATS, QUICK_REPEATS = 15, 3
DRAWN = 1.0
"""Time from the seed's start in which one step is drawn [s]."""


@experiment
def main(options: Options):
    repeats = options.sized(REPEATS, QUICK_REPEATS)

    def model(**laws):
        """What is measured of a law, and its first step where it makes one."""
        scene = seed_with(**laws)
        return findings(scene, repeats), first_stance(motion(scene, DRAWN))

    seed, mu_static = model(), float(jb.seed_scene().friction.mu_static)
    models = {
        kind: {name: seed if name == SEED[kind] else model(**{kind: name}) for name in names}
        for kind, names in options.sized(LAWS, QUICK_LAWS).items()
    }
    found, stances = (
        {kind: {name: each[k] for name, each in laws.items()} for kind, laws in models.items()}
        for k in range(2)
    )
    slopes, figures = descents(options)
    return {
        "slope_rad": float(jb.seed_scene().ground.slope),
        "criteria": CRITERIA,
        **{
            kind: {
                name: each
                | {
                    "deviations_from_seed": deviations(each, seed[0]),
                    "verdict": verdict(each, seed[0], mu_static),
                }
                for name, each in laws.items()
            }
            for kind, laws in found.items()
        },
        "slopes": slopes,
        "pictures": [
            normal_picture(options, stances["normal"]),
            friction_picture(options, stances["friction"]),
            measures_picture(options, found),
            *figures,
        ],
    }


if __name__ == "__main__":
    main()
