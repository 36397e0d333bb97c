"""Optima of driven steps by two discretisations: the package's, and collocation of high order.

The second begins at the first one's optimum and solves the conditions of an optimum by Newton's
method on states at Gauss points, with equations of motion of its own.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from _collocation import Body, Step, solve
from _experiment import Options, experiment
from driven_compass import compass
from scipy.integrate import solve_ivp

import jaxbiped as jb

GRIDS, QUICK_GRIDS = ((9, 6), (15, 8)), ((9, 6),)
"""Segments of the collocation, and points of each."""
GAINS = {"leg.hip.kp": (1.0, 200.0), "leg.hip.kd": (0.01, 20.0), "leg.hip.target": (0.05, 1.5)}
MOST = 300.0
"""Bound of a coefficient of the five links' torques [N m]."""
SPAN = 0.7
COMPASS = (Body(5.0, 0.0, 0.5, 1.0),) * 2
RABBIT = (
    Body(6.8, 1.08, 0.163, 0.4),
    Body(3.2, 0.93, 0.128, 0.4, parent=0),
    Body(6.8, 1.08, 0.163, 0.4),
    Body(3.2, 0.93, 0.128, 0.4, parent=2),
    Body(20.0, 2.22, -0.2, 0.625),
)
"""Swing thigh and shank, those that stand, and the torso: Chevallereau et al. (2003)."""
NAMES = ("thigh_1", "shank_1", "thigh_2", "shank_2", "torso")
ANGLES = {
    "stance_hip": {"torso": 1.0, "thigh_2": -1.0},
    "swing_hip": {"thigh_1": 1.0, "torso": -1.0},
    "stance_knee": {"shank_2": 1.0, "thigh_2": -1.0},
    "swing_knee": {"shank_1": 1.0, "thigh_1": -1.0},
}


@experiment
def main(options: Options):
    grids, every = options.sized(GRIDS, QUICK_GRIDS), problems()
    names = options.sized(tuple(every), tuple(every)[:1])
    return {"rows": [row for name in names for row in compared(name, *every[name], grids)]}


def problems():
    """Scenes, what varies, what must hold, and the same steps for the collocation."""
    pd = compass(jb.actuation.PD(20.0, 1.0, 0.4))
    hip = functools.partial(
        Step, COMPASS, 10.0, 0, 1, (1, 0), np.array([[1.0, -1.0]]), proportional
    )
    five = five_links()
    coefficients = [name for name in jb.parameter_names(five) if ".torque_" in name]
    knees = [
        jb.optimise.Along(
            lambda motion, i=i: motion.angle(f"shank_{i}"), high=0.0, name=f"knee {i}", unit="rad"
        )
        for i in (1, 2)
    ]
    links = Step(
        RABBIT,
        0.0,
        1,
        3,
        (2, 3, 0, 1, 4),
        np.array([[angle.get(name, 0.0) for name in NAMES] for angle in ANGLES.values()]),
        functools.partial(splines, len(coefficients) // len(ANGLES)),
        lambda length, period, _: jnp.stack([length - 0.5, period - SPAN]),
    )
    return {
        "PD, 0.4 m in 0.7 s": (
            pd,
            GAINS,
            ["step_length==0.4", "period==0.7"],
            hip(lambda length, period, _: jnp.stack([length - 0.4, period - 0.7])),
        ),
        "PD, 0.5 m/s": (
            pd,
            GAINS,
            ["speed==0.5"],
            hip(lambda length, period, _: length / period - 0.5),
        ),
        "five links, 0.5 m in 0.7 s": (
            five,
            dict.fromkeys(coefficients, (-MOST, MOST)),
            ["step_length==0.5", "period==0.7", *knees],
            links,
        ),
    }


def proportional(angles, rates, share, parameters):
    """The torque between the legs by gains and a target."""
    angle, rate = angles[0] - angles[1], rates[0] - rates[1]
    return -parameters[:1] * (angle - parameters[2]) - parameters[1] * rate


def splines(count, angles, rates, share, parameters):
    """Cubic B-splines of the share of the period, `count` coefficients a motor."""
    place = jnp.abs(share * (count - 3) - jnp.arange(count) + 1.0)
    near = 2.0 / 3.0 - place**2 + 0.5 * place**3
    basis = jnp.where(place < 1.0, near, jnp.maximum(2.0 - place, 0.0) ** 3 / 6.0)
    return parameters.reshape(-1, count) @ basis


def five_links():
    """RABBIT's links with a spline of time in each motor, from zero torque."""
    bodies = [
        jb.Body(
            name, mass=body.mass, inertia=body.inertia, centre=body.centre,
            **({"parent": NAMES[body.parent], "at": 0.4} if body.parent >= 0 else {}),
        )
        for name, body in zip(NAMES, RABBIT, strict=True)
    ]  # fmt: skip
    law = jb.actuation.TimeSpline((0.0,) * 6, SPAN)
    mechanism = jb.Mechanism(
        root="hip",
        root_mass=0.0,
        bodies=tuple(bodies),
        feet=tuple(jb.Foot(f"shank_{i}", centre=0.4) for i in (1, 2)),
        mirror=(("thigh_1", "thigh_2"), ("shank_1", "shank_2")),
        joints=tuple(jb.Motor(angle, law, name=name) for name, angle in ANGLES.items()),
    )
    return jb.RigidScene(mechanism, jb.Ground(slope=0.0, g=9.81))


def compared(name, scene, vary, subject_to, step, grids):
    """Costs of an optimum by both on each grid, and their relative difference."""
    best = jb.optimise_gait(
        scene,
        vary=vary,
        minimise="torque_squared",
        subject_to=subject_to,
        formulation="together",
        accuracy="tight",
    )
    state, period = best.gait.measures.state, float(best.gait.measures.period)
    names = NAMES if len(step.bodies) == len(NAMES) else ("leg_1", "leg_2")
    begin = [
        float(getattr(state, f"{kind}_{body}")) for kind in ("theta", "omega") for body in names
    ]
    values = np.array(list(best.variables.values()))
    rates = jax.jit(lambda time, x: step.rates(x, time / period, values))
    path = solve_ivp(
        lambda time, x: np.asarray(rates(time, x)),
        (0.0, period), begin, "DOP853", dense_output=True, rtol=1e-10, atol=1e-12,
    )  # fmt: skip
    for segments, points in grids:
        other = solve(
            step, lambda times: path.sol(times).T, period, values, segments=segments, points=points
        )
        yield {
            "problem": name,
            "outcome": str(best.outcome),
            "cost": best.objective,
            "error": best.error,
            "missed": best.optimality.excess,
            "segments": segments,
            "points": points,
            "collocation_cost": other.cost,
            "collocation_missed": other.missed,
            "is_minimum": other.is_minimum,
            "difference": best.objective / other.cost - 1.0,
        }


if __name__ == "__main__":
    main()
