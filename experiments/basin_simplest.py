"""The basin of the simplest walker: a small, thin area, as Schwab and Wisse found it in 2001.

Starts are those just after a heel strike: both feet on the ground, the swing leg's rate from the
impact. Writes basin_simplest.png: above in the plane of stance angle and rate, below against
the rate that leads upright, so that the thin area can be seen.
"""

import numpy as np
from _experiment import Options, experiment
from reference.rigid import rigid_walker
from reference.rigid_walks import rigid_walks
from scipy.optimize import root

import jaxbiped as jb
from jaxbiped import plot
from jaxbiped.plot.style import new_figure

SLOPES = (0.004, 0.009)
SIDES, QUICK_SIDES = (200, 400), (100, 200)
TOLERANCES = {"draft": 1e-4, "balanced": 1e-6}
DRAWN, QUICK_DRAWN = 400, 100
CHECKED, QUICK_CHECKED = 300, 40
"""Starts that are walked by independent equations, too, at each slope."""
NEAR, LONGEST = 1e-4, 1000.0
"""How near the gait a start must come to walk, and in which time [√(l/g)]."""
STABLE = {0.004: (0.153389, -0.156080), 0.009: (0.200310900544287, -0.199832473004977)}
"""Stance angle and rate of the gait after a strike: published at 0.009, a guess at 0.004."""
THETA, RATE = (0.0, 0.6), (-0.6, 0.0)
"""Stance angle [rad] and its rate [√(g/l)] just after a strike."""
OFF = (-0.015, 0.005)
"""The rate's difference from that of the walker which comes to rest upright, in the strip."""
FOOTSTEPS = 60
WALKING = int(jb.basins.Label.WALKING)


@experiment
def main(options: Options):
    sides, checked = options.sized(SIDES, QUICK_SIDES), options.sized(CHECKED, QUICK_CHECKED)
    found = {f"{slope:g}": basin_of(slope, sides, checked) for slope in SLOPES}
    return {"slopes": found, "picture": draw(options, options.sized(DRAWN, QUICK_DRAWN))}


def basin_of(slope, sides, checked):
    """Fractions, reach and the independent check at a slope."""
    labellings = {name: labelling_of(slope, rtol=rtol) for name, rtol in TOLERANCES.items()}
    best, gait = labellings["balanced"], fixed_point(slope)
    rows = [
        {"accuracy": name, "side": side, **vars(fraction_of(labelling, side))}
        for name, labelling in labellings.items()
        for side in sides
    ]
    return {
        "gait": gait.tolist(),
        "gait_off": float(np.max(np.abs(best.family.rows[0][0].point[[1, 3]] - gait))),
        "fractions": rows,
        # They have a value in common.
        "intervals_overlap": max(row["low"] for row in rows) <= min(row["high"] for row in rows),
        "reach": reach(best, gait),
        "check": compared(best, slope, checked),
    }


def fixed_point(slope):
    """Stance angle and rate after a strike that repeat themselves, by independent equations."""
    walker = rigid_walker(jb.models.garcia(slope))

    def missed(point):
        theta, rate = point
        start = np.array([-theta, theta, np.cos(2.0 * theta) * rate, rate])
        return walker.footstep(start)[0][[1, 3]] - point

    return root(missed, STABLE[slope], tol=1e-12).x


def just_struck(scene, states):
    """Both feet on the ground, and the swing leg's rate from the impact."""
    theta, rate = states.theta_2, states.omega_2
    return states._replace(theta_1=-theta, omega_1=rate * np.cos(2.0 * theta))


def labelling_of(slope, **options):
    """A labelling that knows the gait."""
    scene = jb.models.garcia(slope)
    guess = start_at(scene, *fixed_point(slope))
    return jb.labelling(scene, guess=guess, footsteps=FOOTSTEPS, **options)


def start_at(scene, theta, rate):
    """The state just after a strike with this stance angle and rate."""
    return just_struck(scene, jb.dynamics.RigidState(0.0 * theta, -theta, theta, rate, rate))


def labels_at(labelling):
    """A function that labels points (n, 2): stance angle and rate just after a strike."""
    return jb.labels.label_at(labelling, ("theta_stance", "omega_stance"), follow=just_struck)


def fraction_of(labelling, side):
    """Fraction of a grid over the whole square that walks, with its interval."""

    def middles(low, high):
        return low + (high - low) * (np.arange(side) + 0.5) / side

    values = {"omega_stance": middles(*RATE), "theta_stance": middles(*THETA)}
    starts = jb.starts.grid(labelling.scene, values, follow=just_struck)
    walks = jb.sweep(labelling, starts, look_for_gaits=False)["label"].values == WALKING
    low, high = jb.basins.wilson_interval(walks.sum(), walks.size)
    return jb.basins.Fraction(float(walks.mean()), float(low), float(high), int(walks.sum()))


def reach(labelling, gait):
    """How far the basin reaches from the gait each way along each axis, by bisection."""
    found = {}
    for k, name in enumerate(("angle", "rate")):
        for sign, way in ((1.0, "+"), (-1.0, "-")):
            push = jb.basins.minimal_fatal_shock(
                labels_at(labelling), gait, scales=np.ones(2), max_distance=0.5, tolerance=1e-6,
                directions=np.eye(2)[k : k + 1] * sign, steps=2000, improved=0,
            )  # fmt: skip
            label = str(jb.basins.Label(push.label))
            found[f"{name} {way}"] = {"distance": push.distance, "label": label}
    return found


def compared(labelling, slope, count):
    """Whether starts in the strip walk, by the labels and by independent equations."""
    spread = np.random.default_rng(0).random((count, 2))
    theta = 0.05 + 0.4 * spread[:, 0]
    off = OFF[0] + (OFF[1] - OFF[0]) * spread[:, 1]
    points = np.stack([theta, upright(theta, slope) + off], axis=1)
    ours, starts = labels_at(labelling)(points) == WALKING, start_at(labelling.scene, *points.T)
    after = rigid_walks(labelling.scene, starts, FOOTSTEPS, duration=LONGEST).after[:, :, [1, 3]]
    theirs = np.any(np.max(np.abs(after - fixed_point(slope)), axis=2) < NEAR, axis=1)
    return {
        "starts": count,
        "walking": int(ours.sum()),
        "walking_independently": int(np.sum(theirs)),
        "disagree": int(np.sum(ours != theirs)),
    }


def upright(theta, slope):
    """The rate with which the hip just reaches the top of its arc, by its energy."""
    return -np.sqrt(2.0 * (1.0 - np.cos(theta - slope)))


def draw(options, side):
    figure = new_figure(13.0, 7.6)
    grid = figure.subplots(2, 2)
    theta, rate, off = (np.linspace(*ends, side) for ends in (THETA, RATE, OFF))
    for (plane, strip), slope in zip(grid.T, SLOPES, strict=True):
        label, gait = labels_at(labelling_of(slope)), fixed_point(slope)

        def codes(angle, rate, label=label):
            return label(np.stack([angle.ravel(), rate.ravel()], axis=1)).reshape(side, side)

        plot.basin(
            codes(*np.meshgrid(theta, rate)), theta, rate, ax=plane, mark=(gait[0], gait[1]),
            names=("stance angle, θ", "its rate, θ̇"), units=("rad", "√(g/l)"),
            title=f"Just after a strike, slope {slope:g} rad",
        )  # fmt: skip
        angle, beside = np.meshgrid(theta, off)
        plot.basin(
            codes(angle, upright(angle, slope) + beside), theta, 1e3 * off, ax=strip,
            mark=(gait[0], 1e3 * float(gait[1] - upright(gait[:1], slope)[0])),
            names=("stance angle, θ", "θ̇ less the rate that leads upright"),
            units=("rad", "10⁻³ √(g/l)"), title="The same, about the rate that leads upright",
        )  # fmt: skip
    return options.save(figure, "basin_simplest.png")


if __name__ == "__main__":
    main()
