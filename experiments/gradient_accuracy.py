"""Errors of a footstep and of its derivatives against tolerance, for four ways of stepping.

Writes gradient_accuracy.png. The steps are chosen for the state alone ("plain"), or end just past
every switch of the vector field ("landing"), or are chosen for the derivatives as well ("norm"), or
both. Derivatives are always those of the solver's own steps. Laws: the seed's, and smoothed ones.
"""

import time
from typing import Any, NamedTuple

import jax.numpy as jnp
import matplotlib.pyplot as plt
from _options import Options, parse
from _smoothed_laws import smoothed_seed

import jaxbiped as jb

TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
QUICK_TOLERANCES = (1e-5, 1e-6)
REFERENCE, QUICK_REFERENCE = 1e-10, 1e-9
"""Tolerance of the state and of its columns, with both precautions, that counts as exact."""
TANGENT_SHARE = 10.0
"""Tolerance of the columns, in units of the state's."""
UNHEARD = 1e30
"""Tolerance of the columns where they have no say in the steps."""
STEPPINGS = {
    "plain": (False, False),
    "landing": (True, False),
    "norm": (False, True),
    "both": (True, True),
}
"""Whether steps end at switches, and whether columns enter the norm."""
ERRORS = {
    "state": "state [m, rad, m/s, rad/s]",
    "period_s": "period [s]",
    "unit_multiplier": "multiplier that is exactly 1",
    "period_slope": "d period / d log K [relative]",
}


class Stepping(NamedTuple):
    """A scene and how to step.

    Attributes:
        scene: the walker.
        lands: 1.0 where steps end just past every switch, 0.0 where they do not.
    """

    scene: jb.Scene
    lands: Any


class Stepped(jb.gait.AbstractSystem):
    """The walker, its switches hidden from the solver or not."""

    cyclic_coordinates = jb.gait.Walking.cyclic_coordinates

    def vector_field(self, t: Any, y: jb.State, args: Stepping) -> jb.State:
        """The walker's."""
        return jb.dynamics.vector_field(t, y, args.scene)

    def switches(self, args: Stepping, y: jb.State) -> tuple[jb.dynamics.Switch, ...]:
        """The walker's; where steps do not land, none is live."""
        lands = args.lands > 0.0
        found = jb.dynamics.switches(args.scene, y)
        return tuple(each._replace(live=each.live & lands) for each in found)

    def ending(self, args: Stepping, y: jb.State) -> Any:
        """The walker's."""
        return jb.gait.Walking().ending(args.scene, y)

    def reset_map(self, args: Stepping, y: jb.State) -> jb.State:
        """Legs exchanged."""
        return jb.dynamics.exchange_legs(y)

    def load(self, args: Stepping, y: jb.State) -> None:
        """No largest load: no step is spent on it."""
        return None


class Stance(jb.dynamics.AbstractSection):
    """Mid-stance."""

    def value(self, args: Stepping, y: jb.State) -> Any:
        """That of the scene."""
        return jb.MidStance().value(args.scene, y)

    def counts(self, args: Stepping, y: jb.State) -> Any:
        """Whether leg 2 stands."""
        return jb.MidStance().counts(args.scene, y)


class Point(NamedTuple):
    """What was measured at one tolerance; errors as `ERRORS` says."""

    rtol: float
    steps: int
    state: float
    period_s: float
    unit_multiplier: float
    period_slope: float


class Exact(NamedTuple):
    """A gait's state on the section, and the reference footstep from there."""

    start: jb.State
    orbit: jb.gait.LinearisedReturn


def laws(quick: bool) -> dict[str, jb.Scene]:
    """The scenes by the name of their laws."""
    seed = jb.seed_scene()
    return {"exact laws": seed} if quick else {"exact laws": seed, "smoothed laws": smoothed_seed()}


def footstep(
    scene: jb.Scene, start: jb.State, lands: bool, rtol: float, tangent_rtol: float
) -> jb.gait.LinearisedReturn:
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
        section=Stance(),
        engine="xla",
    )


def exact_gait(scene: jb.Scene, rtol: float) -> Exact:
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


def measured(scene: jb.Scene, exact: Exact, stepping: str, rtol: float) -> Point:
    lands, heard = STEPPINGS[stepping]
    tangent_rtol = TANGENT_SHARE * rtol if heard else UNHEARD
    found = footstep(scene, exact.start, lands, rtol, tangent_rtol)
    slope, true_slope = (float(jb.gait.slopes_of(each).period[0]) for each in (found, exact.orbit))
    return Point(
        rtol=rtol,
        steps=int(found.attempted),
        state=float(jnp.max(jnp.abs(found.recurring - exact.orbit.recurring))),
        period_s=abs(float(found.period - exact.orbit.period)),
        unit_multiplier=unit_error(scene, exact.start, found),
        period_slope=abs(slope / true_slope - 1.0),
    )


def unit_error(scene: jb.Scene, start: jb.State, found: jb.gait.LinearisedReturn) -> float:
    """Distance from 1 of the multiplier of the direction along the orbit."""
    velocity = jnp.stack(jb.dynamics.vector_field(0.0, start, scene)[1:])
    square = found.monodromy[:, : len(velocity)]
    return float(jb.gait.stability_of(square, square, velocity, 1e-3).unit_error)


def residual(exact: Exact) -> float:
    """Largest change of a component of the state over the reference footstep, SI units."""
    return float(jnp.max(jnp.abs(exact.orbit.recurring - jnp.stack(exact.start[1:]))))


def picture(options: Options, found: dict[str, dict[str, list[Point]]]) -> None:
    rows = len(found)
    figure, grid = plt.subplots(
        rows, 4, figsize=(14, 0.8 + 3.4 * rows), layout="constrained", sharex=True, squeeze=False
    )
    for axes_row, (law, points) in zip(grid, found.items(), strict=True):
        for axes, (key, label) in zip(axes_row, ERRORS.items(), strict=True):
            for marker, (name, row) in zip("osd^", points.items(), strict=True):
                errors = [getattr(p, key) for p in row]
                axes.loglog([p.steps for p in row], errors, f"{marker}-", ms=4, label=name)
            axes.set_title(f"{law}: {label}", fontsize=9)
            axes.grid(alpha=0.3)
        axes_row[0].set_ylabel("error")
    for axes in grid[-1]:
        axes.set_xlabel("attempted steps of a footstep")
    grid[0, 0].legend(fontsize=8)
    options.save(figure, "gradient_accuracy.png")


def main() -> None:
    options = parse(__doc__ or "")
    levels = QUICK_TOLERANCES if options.quick else TOLERANCES
    reference = QUICK_REFERENCE if options.quick else REFERENCE
    found: dict[str, dict[str, list[Point]]] = {}
    references: dict[str, Any] = {}
    for law, scene in laws(options.quick).items():
        began = time.perf_counter()
        exact = exact_gait(scene, reference)
        found[law] = {
            name: [measured(scene, exact, name, rtol) for rtol in levels] for name in STEPPINGS
        }
        references[law] = {
            "period_s": float(exact.orbit.period),
            "period_slope_s": float(jb.gait.slopes_of(exact.orbit).period[0]),
            "steps": int(exact.orbit.attempted),
            "unit_multiplier": unit_error(scene, exact.start, exact.orbit),
            "residual": residual(exact),
        }
        options.say(f"\n{law}, in {time.perf_counter() - began:.0f} s")
        options.say(f"reference: {references[law]}")
        rows = ({"stepping": name} | p._asdict() for name in STEPPINGS for p in found[law][name])
        options.table(rows, stepping="", rtol=".0e", steps="d", **dict.fromkeys(ERRORS, ".1e"))
    picture(options, found)
    options.finish(
        {
            "tangent_share": TANGENT_SHARE,
            "reference_tolerance": reference,
            "reference": references,
            "points": {
                law: {name: [p._asdict() for p in row] for name, row in points.items()}
                for law, points in found.items()
            },
        }
    )


if __name__ == "__main__":
    main()
