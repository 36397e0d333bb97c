"""Walking on level ground: what it costs to push off, to turn the hip or to press the feet down.

Writes level_ground.png. Left the simplest walker (Kuo 2002), driven by push-off on level ground or
by gravity on the slope where its steps are as long. Right the seed's walker, each way to drive it
along its own strength, and the cheapest rigid designs. Every first gait is found without a guess.
"""

import dataclasses

import numpy as np
from _experiment import Options, experiment
from _scenes import rigid_seed

import jaxbiped as jb
from jaxbiped.plot.style import COLOURS, MARKERS, dress, legend_below, new_figure

IMPULSES, QUICK_IMPULSES = 9, 3
"""Push-offs of the simplest walker."""
CUBE, SQUARE = 1.0929, 0.62
"""Slope of the simplest walker's long gait with the stance angle α after a strike, near enough to
begin a search with: CUBE α³ (1 + SQUARE α²), which is 0.009 at 0.2003 rad (Garcia, Chatterjee,
Ruina and Coleman 1998)."""
SPEEDS, QUICK_SPEEDS = (0.2, 0.28, 0.4), (0.28,)
"""That designs are asked for [m/s]."""
VARY = {"impulse": (0.02, 0.4), "d": (0.05, 0.2), "J": (0.003, 0.02)}
LEVEL = jb.seed_scene(slope=0.0)
PUSHED = dataclasses.replace(rigid_seed(0.0), actuation=jb.actuation.PushOff(0.1))
PRESSED = dataclasses.replace(LEVEL, actuation=jb.actuation.FootPreload(3e-3))
TURNED = dataclasses.replace(LEVEL, actuation=jb.actuation.HipTorque(0.1))
DRIVES = {
    "push-off, rigid": (PUSHED, "impulse", 0.1, (0.02, 0.5, 9)),
    "foot preload": (PRESSED, "extension", 3e-3, (1.2e-3, 1.2e-2, 10)),
    "hip torque": (TURNED, "torque", 0.1, (0.06, 0.2, 11)),
    "gravity, rigid": (rigid_seed(0.0), "slope", 0.02, (2e-3, 0.1, 33)),
    "gravity": (LEVEL, "slope", 0.02, (8e-3, 0.08, 13)),
}
"""Scene, parameter, where the search has no guess, how far both ways from there and how finely."""


@experiment
def main(options: Options):
    pairs, lost = simplest_pairs(options.sized(IMPULSES, QUICK_IMPULSES))
    names = options.sized(list(DRIVES), list(DRIVES)[:2])
    curves = {name: along(options, *DRIVES[name]) for name in names}
    designs = [cheapest(speed) for speed in options.sized(SPEEDS, QUICK_SPEEDS)]
    return {
        "simplest": pairs,
        "simplest_without_gait": lost,
        "seed": curves,
        "designs": designs,
        "picture": draw(options, pairs, curves, designs),
    }


def along(options, scene, parameter, first, range_):
    """Gaits along a parameter, each searched from its neighbour, the first from nothing."""
    low, high, count = range_
    ways = np.linspace(first, low, count), np.linspace(first, high, count)
    points, begun = {}, None
    for values in options.sized(ways, ([first, 0.9 * first], [first, 1.2 * first])):
        state = begun
        for value in map(float, values):
            if value in points:
                continue
            found = jb.with_parameters(scene, {parameter: value})
            gait = jb.find_gait(found, state, parameters=())
            if gait.outcome is not jb.gait.Search.FOUND or not bool(gait.sound):
                points[value] = {"value": value, "found": False, "stable": None}
                break
            state = gait.measures.state
            begun = state if begun is None else begun
            points[value] = {"value": value, "found": True, **point(found, gait)}
    return [points[value] for value in sorted(points)]


def point(scene, gait):
    """A gait's measures, its cost of transport [–] and the motors' positive work in a footstep."""
    cost, measures = cost_of(scene, gait), gait.measures
    return {
        "stable": bool(gait.stable),
        "speed_m_s": float(measures.speed),
        "step_length_m": float(measures.step_length),
        "period_s": float(measures.period),
        "spectral_radius": float(measures.spectral_radius),
        "cost_of_transport": float(cost.cost[0]),
        "motor_work_J": float(cost.motor_work[0]),
    }


def cost_of(scene, gait):
    """Cost of transport between the first two heel strikes of a gait."""
    state = gait.measures.state
    if isinstance(scene, jb.RigidScene):
        walk = jb.rigid_walk(scene, state, footsteps=2, max_arrivals=2, accuracy="tight")
    else:
        walk = jb.simulate(scene, state, footsteps=2)
    return jb.measure.cost_of_transport(scene, walk)


def cheapest(speed):
    """The cheapest design at a speed, found from a scene alone, and the seed's own walker there."""
    how = dict(minimise="cost_of_transport", subject_to={"speed": (speed, speed)})
    best = jb.optimise_gait(PUSHED, vary=VARY, **how)
    own = jb.optimise_gait(PUSHED, vary={"impulse": VARY["impulse"]}, **how)
    return {
        "speed_m_s": float(best.known.values["speed"]),
        "outcome": str(best.outcome),
        "variables": {name: float(value) for name, value in best.variables.items()},
        "cost_of_transport": float(best.objective),
        "error": float(best.known.errors["cost_of_transport"]),
        "seed_cost": float(own.objective),
        "residual": float(best.optimality.residual),
        "spectral_radius": float(best.gait.measures.spectral_radius),
    }


def simplest_pairs(count):
    """Level gaits from nothing, with steps of about 0.05 to 0.3 rad; impulses that have none.

    Beside each, the slope on which gravity makes steps of the same angle, whose sine is the cost
    there. Kuo's relations have P/(v tan α) and push-off's work over ½ P² as 1.
    """
    pairs, lost = [], []
    for impulse in map(float, 1.05 * np.linspace(0.05, 0.3, count) ** 2):
        scene = jb.models.kuo(impulse)
        gait = jb.find_gait(scene, accuracy="tight", parameters=())
        if gait.outcome is not jb.gait.Search.FOUND:
            lost.append(impulse)
            continue
        state, cost = gait.measures.state, cost_of(scene, gait)
        alpha, speed, slope = float(state.theta_2), -float(state.omega_2), passive_of(state)
        pairs.append(
            {
                "angle_rad": alpha,
                "impulse": impulse,
                "speed": speed,
                "impulse_over_speed_tan": float(impulse / (speed * np.tan(alpha))),
                "work_over_half_square": float(cost.motor_work[0]) / (0.5 * impulse**2),
                "cost": float(cost.cost[0]),
                "slope": slope,
                "ratio": float(np.sin(slope) / cost.cost[0]),
                "spectral_radius": float(gait.measures.spectral_radius),
            }
        )
    return pairs, lost


def passive_of(level):
    """The slope on which gravity makes steps as long as a level gait's, by Newton's method.

    Its hip begins a step as fast as makes up for the impact: it gains gravity's work.
    """
    alpha = float(level.theta_2)
    slope = CUBE * alpha**3 * (1.0 + SQUARE * alpha**2)
    rate = -np.sqrt(4.0 * slope * np.sin(alpha)) / np.tan(2.0 * alpha)
    guess = level._replace(omega_1=np.cos(2.0 * alpha) * rate, omega_2=rate)
    for _ in range(8):
        gait = jb.find_gait(jb.models.garcia(slope), guess, accuracy="tight", parameters=("slope",))
        if gait.outcome is not jb.gait.Search.FOUND:
            raise RuntimeError(f"no passive gait with steps of {alpha:g} rad: {gait.outcome}")
        guess = gait.measures.state
        step = (alpha - float(guess.theta_2)) / float(gait.sensitivities.state.theta_2[0])
        slope += step
        if abs(step) < 1e-10 * slope:
            break
    return slope


def draw(options, pairs, curves, designs):
    left, right = new_figure(9.6, 4.6).subplots(1, 2)
    draw_simplest(left, pairs)
    for (name, curve), colour, marker in zip(curves.items(), COLOURS, MARKERS, strict=False):
        known = [each for each in curve if each["found"]]
        speed, cost, stable = (
            np.array([each[key] for each in known])
            for key in ("speed_m_s", "cost_of_transport", "stable")
        )
        right.plot(speed, cost, color=colour, linewidth=1.0, label=name)
        for rows, fill in ((stable, colour), (~stable, "white")):
            look = dict(color=colour, markerfacecolor=fill, markersize=4)
            right.plot(speed[rows], cost[rows], marker, **look)
    stars = ([each[key] for each in designs] for key in ("speed_m_s", "cost_of_transport"))
    right.plot(*stars, "*", color="#E69F00", markersize=10, label="push-off, optimised")
    dress(right, "Seed's walker; hollow: unstable", "speed (m/s)", "cost of transport (–)")
    right.set_yscale("log")
    legend_below(right, columns=3)
    return options.save(left.figure, "level_ground.png")


def draw_simplest(ax, pairs):
    angles, speeds, slopes, costs = (
        np.array([pair[key] for pair in pairs]) for key in ("angle_rad", "speed", "slope", "cost")
    )
    ax.plot(angles, np.sin(slopes), "s", color=COLOURS[1], label="gravity")
    ax.plot(angles, costs, "o", color=COLOURS[0], label="push-off")
    kuo = (speeds * np.tan(angles)) ** 2 / (4.0 * np.sin(angles))
    ax.plot(angles, kuo, color=COLOURS[0], linewidth=1.0, label="½ (v tan α)² a step")
    ax.set(xscale="log", yscale="log")
    ax.minorticks_off()
    ax.set_xticks([0.05, 0.1, 0.2, 0.3], ["0.05", "0.1", "0.2", "0.3"])
    words = "half of the angle between the legs (rad)", "cost of transport (–)"
    dress(ax, "Simplest walker", *words)
    legend_below(ax, columns=3)


if __name__ == "__main__":
    main()
