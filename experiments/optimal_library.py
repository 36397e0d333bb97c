"""Optimal gaits over a grid, and fronts of cost: what an optimum's derivatives tell of others.

Writes optimal_library.png. Left the cost of the compass walker's cheapest steps over step length
at several periods, from one library; middle its cost against speed, right the cost of pushing off
against the sensitivity norm, with the tangents of both fronts. Derivatives of the costs along the
library's axes are compared with differences of its neighbours.
"""

import dataclasses
import time

import numpy as np
from _experiment import Options, experiment
from _scenes import rigid_seed

import jaxbiped as jb
from jaxbiped.plot.style import COLOURS, dress, new_figure

SIZE, QUICK_SIZE = (40, 25), (3, 3)
LENGTH, PERIOD = (0.4, 0.1 / 39), (0.7, 0.1 / 24)
"""First value and step of the axes [m, s]."""
SPEEDS, QUICK_SPEEDS = 5, 2
NORMS, QUICK_NORMS = (0.98, 0.94, 0.9, 0.86), (0.95,)
"""Bounds of the sensitivity norm, as shares of the cheapest design's."""
GAINS = {"leg.hip.kp": (1.0, 200.0), "leg.hip.kd": (0.01, 20.0), "leg.hip.target": (0.05, 1.0)}
PUSHED = dataclasses.replace(rigid_seed(0.0), actuation=jb.actuation.PushOff(0.1))
DESIGN = {"impulse": (0.02, 0.4), "d": (0.05, 0.2), "J": (0.003, 0.02)}


def compass():
    """Legs of 5 kg and 1 m with their mass at the middle, 10 kg at the hip, a PD motor there."""
    legs, law = ("leg_1", "leg_2"), jb.actuation.PD(20.0, 1.0, 0.4)
    mechanism = jb.Mechanism(
        root="hip",
        root_mass=10.0,
        bodies=tuple(jb.Body(leg, mass=5.0, inertia=0.0, centre=0.5) for leg in legs),
        feet=tuple(jb.Foot(leg, centre=1.0) for leg in legs),
        mirror=(legs,),
        joints=(jb.Motor({"leg_1": 1.0, "leg_2": -1.0}, law, name="hip"),),
    )
    return jb.RigidScene(mechanism, jb.Ground(slope=0.0, g=9.81))


@experiment
def main(options: Options):
    gaits, seconds = compass_library(*options.sized(SIZE, QUICK_SIZE))
    fronts = {
        "speed": speed_front(options.sized(SPEEDS, QUICK_SPEEDS)),
        "sensitivity_norm": norm_front(options.sized(NORMS, QUICK_NORMS)),
    }
    return {
        "library": told_of(gaits) | seconds,
        "fronts": {name: points_of(front) for name, front in fronts.items()},
        "picture": draw(options, gaits, fronts),
    }


def compass_library(lengths, periods):
    """The library, and the processor seconds of the first call and of one that is warm."""
    over = {
        name: first + step * np.arange(count)
        for name, (first, step), count in (
            ("step_length", LENGTH, lengths), ("period", PERIOD, periods)
        )
    }  # fmt: skip
    seconds = []
    for _ in range(2):
        began = time.process_time()
        gaits = jb.optimise.library(
            compass(), over=over, vary=GAINS, minimise="torque_squared", formulation="together"
        )
        seconds.append(time.process_time() - began)
    return gaits, {"cold_cpu_s": seconds[0], "warm_cpu_s": seconds[1]}


def told_of(gaits):
    """Outcomes, proofs, and how far slopes are from differences of the neighbours on both sides."""
    away = {}
    for axis in gaits.dims:
        inside = {axis: slice(1, -1)}
        difference = gaits.objective.differentiate(axis).isel(inside)
        slope = gaits[f"slope_{axis}"].isel(inside)
        off = np.abs(difference / slope - 1.0)
        away[axis] = {"median": float(off.median()), "largest": float(off.max())}
    converged = gaits.outcome == int(jb.optimise.Outcome.CONVERGED)
    return {
        "gaits": int(gaits.outcome.size),
        "converged": int(converged.sum()),
        "largest_residual": float(gaits.residual.max()),
        "least_curvature": float(gaits.curvature.min()),
        "without_derivatives": int(np.isnan(gaits.slope_period).sum()),
        "slopes_from_differences": away,
    }


def speed_front(count):
    """The least ∫u² per length of steps of .4 m under lower bounds of the speed."""
    return jb.optimise.pareto_front(
        compass(),
        vary=GAINS,
        minimise="torque_squared_per_length",
        subject_to="step_length==0.4",
        against="speed",
        bounds=np.linspace(0.5, 0.58, count),
        upper=False,
        formulation="together",
    )


def norm_front(shares):
    """The least cost of transport at 0.28 m/s under upper bounds of the sensitivity norm."""
    how = dict(
        vary=DESIGN,
        minimise="cost_of_transport",
        subject_to="speed==0.28",
        formulation="gait by gait",
    )
    cheapest = jb.optimise_gait(PUSHED, **how)
    norm = jb.optimise.certify(cheapest, starts=0, footsteps=0, bifurcations_along=())
    bounds = norm.sensitivity_norm[0] * np.array(shares)
    return jb.optimise.pareto_front(
        cheapest.scene, against="sensitivity_norm", bounds=bounds, guess=cheapest.gait, **how
    )


def points_of(front):
    columns = {
        "bound": front.bounds, "value": front.values(front.against), "cost": front.objectives[0],
        "error": front.objectives[1], "slope": front.slopes[0], "slope_error": front.slopes[1],
        "holds": front.holds, "proven": front.proven, "dominated": front.dominated,
    }  # fmt: skip
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    outcomes = ({"outcome": str(optimum.outcome)} for optimum in front.optima)
    pairs = zip(rows, outcomes, strict=True)
    return [dict(zip(columns, row, strict=True)) | outcome for row, outcome in pairs]


def draw(options, gaits, fronts):
    figure = new_figure(12.6, 4.0)
    left, *others = figure.subplots(1, 3)
    for place, colour in zip(
        range(0, gaits.period.size, max(gaits.period.size // 4, 1)), COLOURS, strict=False
    ):
        row = gaits.isel(period=place)
        label = f"{float(row.period):.3g} s"
        left.plot(row.step_length, row.objective, color=colour, linewidth=1.2, label=label)
    left.legend(title="period")
    dress(left, "Cheapest steps", "step length (m)", "∫u² (N² m² s)")
    words = {
        "speed": ("speed (m/s)", "∫u² per length (N² m s)"),
        "sensitivity_norm": ("sensitivity norm (–)", "cost of transport (–)"),
    }
    for ax, (name, front) in zip(others, fronts.items(), strict=True):
        values, costs, reach = front.values(name), front.objectives[0], 0.01 * front.bounds.mean()
        ax.plot(values, costs, "o", color=COLOURS[0], markersize=4)
        for value, cost, slope in zip(values, costs, front.slopes[0], strict=True):
            ends = np.array([-reach, reach])
            ax.plot(value + ends, cost + slope * ends, color=COLOURS[1], linewidth=1.2)
        dress(ax, "Front of cost", *words[name])
    return options.save(figure, "optimal_library.png")


if __name__ == "__main__":
    main()
