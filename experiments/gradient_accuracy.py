"""Errors of a footstep and of its derivatives against tolerance, for four ways of stepping.

Writes gradient_accuracy.png. The steps are chosen for the state alone ("plain"), or end just past
every switch of the vector field ("landing"), or are chosen for the derivatives as well ("norm"), or
both. Derivatives are always those of the solver's own steps. Laws: the seed's, and smoothed ones.

Then what gradients cost over the number of parameters, the coefficients of a torque at the hip that
is a spline over phase: CPU time of one return alone and with a column for each of them, from which
the gradient of speed comes; and of the gradient of the spectral radius, by the adjoint of the
second variation beside what central differences would take.
"""

import dataclasses
import time
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from _experiment import Options, experiment
from _scenes import SMOOTH, rigid_seed, seed_with
from _timing import seconds_of
from tqdm import tqdm

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

TOLERANCES, QUICK_TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8), (1e-5, 1e-6)
REFERENCE, QUICK_REFERENCE = 1e-10, 1e-9
"""Tolerance of the state and of its columns, with both precautions, that counts as exact."""
TANGENT_SHARE = 10.0
"""Tolerance of the columns, in units of the state's."""
UNHEARD = 1e30
"""Tolerance of the columns where they have no say in the steps."""
COUNTS, QUICK_COUNTS = (16, 32, 64), (4,)
REPEATS = 15
PRECISION = {"rtol": 3e-7, "tangent_rtol": 3e-6}
"""That of a gait by the balanced accuracy."""
STEPPINGS = {
    "plain": (False, False),
    "landing": (True, False),
    "norm": (False, True),
    "both": (True, True),
}
"""Whether steps end at switches, and whether columns enter the norm."""
ERRORS = {
    "state": "state (m, rad, m/s, rad/s)",
    "period_s": "period (s)",
    "unit_multiplier": "multiplier that is exactly 1",
    "period_slope": "d period / d log K (relative)",
}


class Stepping(NamedTuple):
    """A scene and how to step.

    Attributes:
        scene: the walker.
        lands: 1.0 where steps end just past every switch, 0.0 where they do not.
    """

    scene: jb.Scene
    lands: Any


class Stepped(jb.hybrid.AbstractSystem):
    """The walker, its switches hidden from the solver or not."""

    cyclic_coordinates = jb.hybrid.Walking.cyclic_coordinates

    def vector_field(self, t, y, args):
        """The walker's."""
        return jb.dynamics.vector_field(t, y, args.scene)

    def switches(self, args, y):
        """The walker's; where steps do not land, none is live."""
        lands = args.lands > 0.0
        found = jb.hybrid.switches(args.scene, y)
        return tuple(each._replace(live=each.live & lands) for each in found)

    def ending(self, args, y):
        """The walker's."""
        return jb.hybrid.Walking().ending(args.scene, y)

    def reset_map(self, args, y):
        """Legs exchanged."""
        return jb.dynamics.exchange_legs(args.scene, y)

    def load(self, args, y):
        """No largest load: no step is spent on it."""
        return None


STANCE = jb.Section(
    lambda args, y: jb.MidStance().value(args.scene, y),
    lambda args, y: jb.MidStance().counts(args.scene, y),
)
"""Mid-stance of leg 2."""


class Exact(NamedTuple):
    """A gait's state on the section, and the reference footstep from there."""

    start: jb.State
    orbit: jb.gait.LinearisedReturn


@experiment
def main(options: Options):
    levels = options.sized(TOLERANCES, QUICK_TOLERANCES)
    reference = options.sized(REFERENCE, QUICK_REFERENCE)
    scenes = {"exact laws": jb.seed_scene()}
    scenes |= options.sized({"smoothed laws": seed_with(**SMOOTH)}, {})
    exact = {law: exact_gait(scene, reference) for law, scene in scenes.items()}
    points = {
        law: {
            name: [measured(scene, exact[law], name, rtol) for rtol in levels] for name in STEPPINGS
        }
        for law, scene in scenes.items()
    }
    # A rigid walker compiles soonest.
    costed, counts = options.sized((jb.seed_scene(), COUNTS), (rigid_seed(), QUICK_COUNTS))
    return {
        "tangent_share": TANGENT_SHARE,
        "reference_tolerance": reference,
        "reference": {law: reference_numbers(scenes[law], each) for law, each in exact.items()},
        "points": points,
        "costs": {"rows": [costs(costed, n) for n in tqdm(counts, desc="costs")]},
        "picture": draw(options, points),
    }


def footstep(scene, start, lands, rtol, tangent_rtol):
    """One footstep from mid-stance, with derivatives with respect to the state and log K.

    Landing and tolerances are traced: all of them share one compiled program.
    """
    return jb.gait.linearise_return_map(
        Stepping(scene, jnp.asarray(float(lands))),
        start,
        rtol=rtol,
        tangent_rtol=tangent_rtol,
        parameters=("K",),
        system=Stepped(),
        section=STANCE,
        engine="xla",
    )


def footstep_by(stepping, scene, start, rtol):
    """A footstep by a way of choosing steps."""
    lands, heard = STEPPINGS[stepping]
    return footstep(scene, start, lands, rtol, TANGENT_SHARE * rtol if heard else UNHEARD)


def exact_gait(scene, rtol):
    """The gait by Newton's method on the return map, solved at the reference's own tolerance.

    `find_gait` would find the same; this needs no other program compiled.
    """
    y = jb.seed_state()
    x = footstep(scene, y, True, 1e-6, 1e-5).recurring
    for tolerance in (1e-6, rtol, rtol, rtol):
        y = jb.State(jnp.zeros(()), *x)
        last = footstep(scene, y, True, tolerance, tolerance)
        m, change = len(x), last.recurring - x
        found, x = x, x + jnp.linalg.solve(jnp.eye(m) - last.jacobian[:, :m], change)
        if jnp.max(jnp.abs(change)) < 1e-2 * rtol:
            break
    return Exact(jb.State(jnp.zeros(()), *found), last)


def slope_of(found):
    return float(jb.gait.slopes_of(found).period[0])


def measured(scene, exact, stepping, rtol):
    """Errors at one tolerance, as `ERRORS` says."""
    found = footstep_by(stepping, scene, exact.start, rtol)
    return {
        "rtol": rtol,
        "steps": int(found.attempted),
        "state": float(jnp.max(jnp.abs(found.recurring - exact.orbit.recurring))),
        "period_s": abs(float(found.period - exact.orbit.period)),
        "unit_multiplier": unit_error(scene, exact.start, found),
        "period_slope": abs(slope_of(found) / slope_of(exact.orbit) - 1.0),
    }


def reference_numbers(scene, exact):
    """The reference's own; `residual`: the largest change of the state over its footstep [SI]."""
    start, orbit = exact
    return {
        "period_s": float(orbit.period),
        "period_slope_s": slope_of(orbit),
        "steps": int(orbit.attempted),
        "unit_multiplier": unit_error(scene, start, orbit),
        "residual": float(jnp.max(jnp.abs(orbit.recurring - jnp.stack(start[1:])))),
    }


def unit_error(scene, start, found):
    """Distance from 1 of the multiplier of the direction along the orbit."""
    velocity = jnp.stack(jb.dynamics.vector_field(0.0, start, scene)[1:])
    square = found.monodromy[:, : len(velocity)]
    return float(jb.gait.stability_of(square, square, velocity, 1e-3).unit_error)


def costs(scene, count):
    """Of a scene whose hip has a torque of so many coefficients [ms]."""
    spline = jb.actuation.HipSpline(tuple(1e-3 * np.ones(count)))
    scene = dataclasses.replace(scene, actuation=(spline,))
    names = tuple(f"torque_{k + 1}" for k in range(count))
    how = dict(engine="lanes")
    gait = jb.find_gait(scene, parameters=(), radius_sensitivities=False, **how)
    state = gait.measures.state

    def one_return(parameters):
        how_ = dict(parameters=parameters, **how, **PRECISION)
        return lambda: jb.gait.linearise_return_map(scene, state, **how_).period_row

    def found(radius):
        how_ = dict(parameters=names, radius_sensitivities=radius, **how)
        return lambda: jb.find_gait(scene, state, **how_).sensitivities

    work = [one_return(()), one_return(names), found(True), found(False)]
    alone, with_columns, radius, without = (
        1e3 * seconds_of({0: run}, REPEATS, clock=time.process_time)[0] for run in work
    )
    return {
        "parameters": count,
        "return_ms": alone,
        "return_with_columns_ms": with_columns,
        "radius_by_adjoint_ms": radius - without,
        "radius_by_differences_ms": 2.0 * count * alone,
    }


def draw(options, found):
    figure = new_figure(14, 0.8 + 3.4 * len(found))
    grid = figure.subplots(len(found), 4, sharex=True, squeeze=False)
    for row, (law, points) in zip(grid, found.items(), strict=True):
        for axes, (key, words) in zip(row, ERRORS.items(), strict=True):
            for marker, (name, own) in zip("osd^", points.items(), strict=True):
                pairs = [point["steps"] for point in own], [point[key] for point in own]
                axes.loglog(*pairs, f"{marker}-", ms=4, label=name)
            axes.set_title(f"{law}: {words}", fontsize=9)
            axes.grid(alpha=0.3)
        row[0].set_ylabel("error")
    for axes in grid[-1]:
        axes.set_xlabel("attempted steps of a footstep")
    grid[0, 0].legend(fontsize=8)
    return options.save(figure, "gradient_accuracy.png")


if __name__ == "__main__":
    main()
