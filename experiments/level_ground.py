"""Walking on level ground: what it costs to push off, to turn the hip or to press the feet down.

Writes level_ground.png. Left the simplest walker (Kuo 2002), driven by push-off on level ground or
by gravity on the slope where its steps are as long. Right the seed's walker, each way to drive it
along its own strength, and the cheapest rigid designs. Every first gait is found without a guess.
"""

from typing import Any, NamedTuple

import numpy as np
from _level_designs import QUICK_SPEEDS, SPEEDS, Design, cheapest, draw_designs, say_designs
from _options import Options, parse
from matplotlib.axes import Axes

import jaxbiped as jb
from jaxbiped.plot.style import dress, legend_below, new_figure

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000")
MARKERS = ("o", "s", "^", "D", "v")
IMPULSES, QUICK_IMPULSES = 9, 3
"""Push-offs of the simplest walker."""
CUBE, SQUARE = 1.0929, 0.62
"""Slope of the simplest walker's long gait with the stance angle α after a strike, near enough to
begin a search with: CUBE α³ (1 + SQUARE α²), which is 0.009 at 0.2003 rad (Garcia, Chatterjee,
Ruina and Coleman 1998)."""


class Point(NamedTuple):
    """A gait at one strength of what drives it.

    Attributes:
        value: the strength, in its own SI unit.
        found: whether a periodic gait was found; the rest is None where none was.
        stable: whether it attracts.
        speed_m_s, step_length_m, period_s, spectral_radius: of the gait.
        cost_of_transport: [–].
        motor_work_J: positive work of motors in a footstep.
    """

    value: float
    found: bool
    stable: bool | None = None
    speed_m_s: float | None = None
    step_length_m: float | None = None
    period_s: float | None = None
    spectral_radius: float | None = None
    cost_of_transport: float | None = None
    motor_work_J: float | None = None  # noqa: N815 (joule)


class Pair(NamedTuple):
    """The simplest walker on level ground, and on a slope with steps of the same angle.

    Attributes:
        angle_rad: α, half of the angle between the legs at heel strike.
        impulse, speed: of the push-off and of the hip at it, in units of mass, √(l g).
        impulse_over_speed_tan: P/(v tan α), which Kuo's relation has as 1.
        work_over_half_square: push-off's work over ½ P².
        cost: of transport on level ground.
        slope: on which gravity makes steps of the same angle [rad]; its sine is the cost there.
        ratio: of that cost to the level one.
        spectral_radius: of the level gait.
    """

    angle_rad: float
    impulse: float
    speed: float
    impulse_over_speed_tan: float
    work_over_half_square: float
    cost: float
    slope: float
    ratio: float
    spectral_radius: float


def main() -> None:
    options = parse(__doc__ or "")
    pairs, lost = simplest_pairs(QUICK_IMPULSES if options.quick else IMPULSES)
    curves = {
        name: along(scene, parameter, values)
        for name, (scene, parameter, values) in seeds(options.quick).items()
    }
    designs = [cheapest(speed) for speed in (QUICK_SPEEDS if options.quick else SPEEDS)]
    say(options, pairs, lost, curves)
    say_designs(options, designs)
    options.finish(
        {
            "simplest": [pair._asdict() for pair in pairs],
            "simplest_without_gait": lost,
            "seed": {name: [p._asdict() for p in curve] for name, curve in curves.items()},
            "designs": [design._asdict() for design in designs],
            "picture": draw(options, pairs, curves, designs),
        }
    )


def seeds(quick: bool) -> dict[str, tuple[Any, str, list[np.ndarray]]]:
    """Scene, parameter and its values both ways from where the search has no guess."""
    level = jb.seed_scene(slope=0.0)
    walker, ground = level.walker, level.ground

    def both(first: float, low: float, high: float, count: int) -> list[np.ndarray]:
        if quick:
            return [np.array([first, 0.9 * first]), np.array([first, 1.2 * first])]
        return [np.linspace(first, low, count), np.linspace(first, high, count)]

    push = jb.RigidScene(walker, ground, jb.actuation.PushOff(0.1))
    press = jb.Scene(*_parts(level), actuation=jb.actuation.FootPreload(3e-3))
    found = {
        "push-off, rigid": (push, "impulse", both(0.1, 0.02, 0.5, 9)),
        "foot preload": (press, "extension", both(3e-3, 1.2e-3, 1.2e-2, 10)),
    }
    if quick:
        return found
    turn = jb.Scene(*_parts(level), actuation=jb.actuation.HipTorque(0.1))
    return found | {
        "hip torque": (turn, "torque", both(0.1, 0.06, 0.2, 11)),
        "gravity, rigid": (jb.RigidScene(walker, ground), "slope", both(0.02, 2e-3, 0.1, 33)),
        "gravity": (level, "slope", both(0.02, 8e-3, 0.08, 13)),
    }


def _parts(scene: jb.Scene) -> tuple[Any, ...]:
    return scene.walker, scene.ground, scene.normal, scene.friction, scene.clearance


def along(scene: Any, parameter: str, ways: list[np.ndarray]) -> list[Point]:
    """Gaits along a parameter, each searched from its neighbour, the first from nothing."""
    points: dict[float, Point] = {}
    first = None
    for values in ways:
        state = first
        for value in map(float, values):
            if value in points:
                continue
            found = jb.with_parameters(scene, {parameter: value})
            gait = jb.find_gait(found, state, parameters=())
            if gait.outcome is not jb.gait.Search.FOUND or not bool(gait.sound):
                points[value] = Point(value, False)
                break
            state = gait.measures.state
            first = state if first is None else first
            points[value] = point(found, gait, value)
    return [points[value] for value in sorted(points)]


def point(scene: Any, gait: jb.Gait, value: float) -> Point:
    cost = cost_of(scene, gait)
    return Point(
        value=value,
        found=True,
        stable=bool(gait.stable),
        speed_m_s=float(gait.measures.speed),
        step_length_m=float(gait.measures.step_length),
        period_s=float(gait.measures.period),
        spectral_radius=float(gait.measures.spectral_radius),
        cost_of_transport=float(cost.cost[0]),
        motor_work_J=float(cost.motor_work[0]),
    )


def cost_of(scene: Any, gait: jb.Gait) -> jb.measure.CostOfTransport:
    """Cost of transport between the first two heel strikes of a gait."""
    state = gait.measures.state
    if isinstance(scene, jb.RigidScene):
        walk = jb.rigid_walk(scene, state, footsteps=2, max_arrivals=2, accuracy="tight")
        return jb.measure.cost_of_transport(scene, walk)
    return jb.measure.cost_of_transport(scene, jb.simulate(scene, state, footsteps=2))


def simplest(slope: float, impulse: float | None = None) -> jb.RigidScene:
    """A hip of mass one on massless legs, gravity and leg length one."""
    walker = jb.Walker(m=1e-13, J=0.0, l=1.0, d=1.0, r=0.0, hip_mass=1.0)
    push = None if impulse is None else jb.actuation.PushOff(impulse)
    return jb.RigidScene(walker, jb.Ground(slope=slope, g=1.0), push)


def simplest_pairs(count: int) -> tuple[list[Pair], list[float]]:
    """Level gaits from nothing, with steps of about 0.05 to 0.3 rad; impulses that have none."""
    pairs, lost = [], []
    for impulse in map(float, 1.05 * np.linspace(0.05, 0.3, count) ** 2):
        scene = simplest(0.0, impulse)
        gait = jb.find_gait(scene, accuracy="tight", parameters=())
        if gait.outcome is not jb.gait.Search.FOUND:
            lost.append(impulse)
            continue
        state = gait.measures.state
        alpha, speed = float(state.theta_2), -float(state.omega_2)
        slope = passive_of(state)
        cost = cost_of(scene, gait)
        pairs.append(
            Pair(
                angle_rad=alpha,
                impulse=impulse,
                speed=speed,
                impulse_over_speed_tan=impulse / (speed * np.tan(alpha)),
                work_over_half_square=float(cost.motor_work[0]) / (0.5 * impulse**2),
                cost=float(cost.cost[0]),
                slope=slope,
                ratio=float(np.sin(slope) / cost.cost[0]),
                spectral_radius=float(gait.measures.spectral_radius),
            )
        )
    return pairs, lost


def passive_of(level: Any) -> float:
    """The slope on which gravity makes steps as long as a level gait's, by Newton's method.

    Its hip begins a step as fast as makes up for the impact: it gains gravity's work.
    """
    alpha = float(level.theta_2)
    slope = CUBE * alpha**3 * (1.0 + SQUARE * alpha**2)
    rate = -np.sqrt(4.0 * slope * np.sin(alpha)) / np.tan(2.0 * alpha)
    guess = level._replace(omega_1=np.cos(2.0 * alpha) * rate, omega_2=rate)
    for _ in range(8):
        gait = jb.find_gait(simplest(slope), guess, accuracy="tight", parameters=("slope",))
        if gait.outcome is not jb.gait.Search.FOUND:
            raise RuntimeError(f"no passive gait with steps of {alpha:g} rad: {gait.outcome}")
        guess = gait.measures.state
        step = (alpha - float(guess.theta_2)) / float(gait.sensitivities.state.theta_2[0])
        slope += step
        if abs(step) < 1e-10 * slope:
            break
    return slope


def say(
    options: Options, pairs: list[Pair], lost: list[float], curves: dict[str, list[Point]]
) -> None:
    options.say("simplest walker on level ground, against gravity's slope for equal steps")
    options.table(
        pairs, angle_rad=".5f", impulse=".6f", impulse_over_speed_tan=".9f",
        work_over_half_square=".9f", cost=".6f", slope=".6f", ratio=".3f", spectral_radius=".3f",
    )  # fmt: skip
    for impulse in lost:
        options.say(f"no gait found at the impulse {impulse:.6f}")
    for name, curve in curves.items():
        options.say(f"\nseed's walker by {name}")
        formats = dict(value=".5f", found="", speed_m_s=".5f", step_length_m=".5f")
        options.table(curve, **formats, cost_of_transport=".6f", spectral_radius=".4f")


def draw(
    options: Options, pairs: list[Pair], curves: dict[str, list[Point]], designs: list[Design]
) -> str:
    figure = new_figure(9.6, 4.6)
    left, right = figure.subplots(1, 2)
    draw_simplest(left, pairs)
    for k, (name, curve) in enumerate(curves.items()):
        known = [p for p in curve if p.found]
        speed = np.array([p.speed_m_s for p in known])
        cost = np.array([p.cost_of_transport for p in known])
        stable = np.array([bool(p.stable) for p in known])
        right.plot(speed, cost, color=COLOURS[k], linewidth=1.0, label=name)
        for rows, fill in ((stable, COLOURS[k]), (~stable, "white")):
            right.plot(
                speed[rows], cost[rows], MARKERS[k], color=COLOURS[k], markerfacecolor=fill,
                markersize=4,
            )  # fmt: skip
    draw_designs(right, designs)
    dress(right, "Seed's walker; hollow: unstable", "speed (m/s)", "cost of transport (–)")
    right.set_yscale("log")
    legend_below(right, columns=3)
    return options.save(figure, "level_ground.png")


def draw_simplest(ax: Axes, pairs: list[Pair]) -> None:
    angles = np.array([p.angle_rad for p in pairs])
    ax.plot(angles, np.sin([p.slope for p in pairs]), "s", color=COLOURS[1], label="gravity")
    ax.plot(angles, [p.cost for p in pairs], "o", color=COLOURS[0], label="push-off")
    speeds = np.array([p.speed for p in pairs])
    kuo = (speeds * np.tan(angles)) ** 2 / (4.0 * np.sin(angles))
    ax.plot(angles, kuo, color=COLOURS[0], linewidth=1.0, label="½ (v tan α)² a step")
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.minorticks_off()
    ax.set_xticks([0.05, 0.1, 0.2, 0.3], ["0.05", "0.1", "0.2", "0.3"])
    dress(
        ax, "Simplest walker", "half of the angle between the legs (rad)", "cost of transport (–)"
    )
    legend_below(ax, columns=3)


if __name__ == "__main__":
    main()
