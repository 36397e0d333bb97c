"""Designs of the seed's rigid walker that push off on level ground at the least cost."""

from typing import NamedTuple

from _options import Options
from matplotlib.axes import Axes

import jaxbiped as jb

SPEEDS, QUICK_SPEEDS = (0.2, 0.28, 0.4), (0.28,)
"""That are asked for [m/s]."""
VARY = {"impulse": (0.02, 0.4), "d": (0.05, 0.2), "J": (0.003, 0.02)}


class Design(NamedTuple):
    """The cheapest design at a speed, found from a scene alone.

    Attributes:
        speed_m_s: that was asked for, and is kept.
        outcome: of the optimiser.
        variables: by name, SI units.
        cost_of_transport: of the design [–]; `error` its estimated error.
        seed_cost: of the seed's own walker at the same speed, by its impulse alone [–].
        residual: of the conditions of Karush, Kuhn and Tucker.
        spectral_radius: of its gait.
    """

    speed_m_s: float
    outcome: str
    variables: dict[str, float]
    cost_of_transport: float
    error: float
    seed_cost: float
    residual: float
    spectral_radius: float


def cheapest(speed: float) -> Design:
    """The cheapest design at a speed."""
    seed = jb.seed_scene(slope=0.0)
    level = jb.RigidScene(seed.walker, seed.ground, jb.actuation.PushOff(0.1))
    kept = {"speed": (speed, speed)}
    best = jb.optimise_gait(level, vary=VARY, minimise="cost_of_transport", subject_to=kept)
    own = jb.optimise_gait(
        level,
        vary={"impulse": VARY["impulse"]},
        minimise="cost_of_transport",
        subject_to=kept,
    )
    return Design(
        speed_m_s=float(best.known.values["speed"]),
        outcome=str(best.outcome),
        variables={name: float(value) for name, value in best.variables.items()},
        cost_of_transport=float(best.objective),
        error=float(best.known.errors["cost_of_transport"]),
        seed_cost=float(own.objective),
        residual=float(best.optimality.residual),
        spectral_radius=float(best.gait.measures.spectral_radius),
    )


def say_designs(options: Options, designs: list[Design]) -> None:
    options.say("\ncheapest designs that push off")
    rows = [each._asdict() | each.variables for each in designs]
    formats = dict(speed_m_s=".5f", cost_of_transport=".6f", seed_cost=".6f", outcome="")
    options.table(rows, **formats, **dict.fromkeys(VARY, ".5g"))


def draw_designs(ax: Axes, designs: list[Design]) -> None:
    """A star for each, at its speed and cost."""
    costs = [each.cost_of_transport for each in designs]
    ax.plot(
        [each.speed_m_s for each in designs], costs, "*", color="#E69F00", markersize=10,
        label="push-off, optimised",
    )  # fmt: skip
