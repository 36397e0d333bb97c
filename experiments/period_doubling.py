"""Period doublings: of the rigid seed's walker, and the simplest walker's cascade to chaos.

The simplest walker (Garcia, Chatterjee, Ruina and Coleman 1998) on its slope of 0.009 has a long
and a short gait; the long one doubles its period again and again. Ratios of the intervals are held
beside Feigenbaum's 4.669, walks beside the branches, and gaits of three footsteps are found by
deflation, without a guess. Writes period_doubling.png.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from _basin_thin import scene_of
from _options import Options, parse

import jaxbiped as jb
from jaxbiped import plot
from jaxbiped.plot.style import new_figure

PAIR_SLOPE = 0.009
BOUNDS = (0.0005, 0.019)
FEIGENBAUM = 4.669201609
DOUBLINGS, QUICK_DOUBLINGS = 6, 3
PERIOD_THREE = 0.0155
"""Slope at which gaits of three footsteps are sought."""
WALKED, QUICK_WALKED = 300, 60
"""Slopes walked on, and footsteps: so many to settle, so many to look at."""
SETTLING, SHOWN = 600, 128
SAME = 1e-5


def main() -> None:
    options = parse(__doc__ or "")
    seed = jb.continue_gait(jb.ladder()["rigid"], "slope", bounds=(0.09, 0.11), accuracy="tight")
    doubled = jb.continuation.switch_branch(seed)
    options.say(f"rigid seed: {seed!r}")
    options.say(f"            {doubled!r}")
    pair = pair_at(options)
    long, short = pair.pop("branches")
    count = QUICK_DOUBLINGS if options.quick else DOUBLINGS
    cascade = jb.continuation.doubling_cascade(long, count)
    ratios = said(options, cascade)
    walks = settled(QUICK_WALKED if options.quick else WALKED, long)
    onset = chaos(options, walks)
    three, family = period_three(options)
    picture = draw(options, [short, *cascade.branches, *three], walks)
    options.finish(
        {
            "rigid_seed": {"slope": seed.bifurcations[0].value, "doubled": points_of(doubled)},
            "pair": pair,
            "cascade": ratios,
            "chaos": onset,
            "period_three": family,
            "picture": picture,
        }
    )


def pair_at(options: Options) -> dict[str, Any]:
    """Both gaits on the slope of 0.009, found without a guess, and their branches."""
    scene = scene_of(PAIR_SLOPE)
    gaits = jb.continuation.find_isolated(scene, accuracy="tight")
    gaits = tuple(sorted(gaits, key=lambda each: -float(each.state.theta_2)))
    rows, branches = {}, []
    for name, gait in zip(("long", "short"), gaits, strict=True):
        branch = jb.continue_gait(scene, "slope", bounds=BOUNDS, guess=gait.state, accuracy="tight")
        branches.append(branch)
        stable = branch.values[[each is True for each in branch.stable]]
        rows[name] = {
            "theta": float(gait.state.theta_2),
            "multipliers": [[v.real, v.imag] for v in gait.point.multipliers.tolist()],
            "stable": gait.stable,
            "stable_slopes": [stable.min(), stable.max()] if stable.size else None,
            "first_doubling": branch.bifurcations[0].value if branch.bifurcations else None,
        }
        values = ", ".join(f"{v:.6f}" for v in gait.point.multipliers[:2])
        options.say(
            f"{name:<5} gait at {PAIR_SLOPE:g}: θ = {gait.state.theta_2:.14f}, λ = {values}"
        )
    low, doubling = rows["long"]["stable_slopes"][0], rows["long"]["first_doubling"]
    options.say(f"long gait stable from {low:g}, where the branch begins, to {doubling:.9f}")
    return {**rows, "branches": branches}


def said(options: Options, cascade: Any) -> dict[str, Any]:
    """The cascade's slopes and ratios."""
    for event, branch in zip(cascade.doublings, cascade.branches, strict=False):
        options.say(
            f"{branch.footsteps:>3} footsteps double at {event.value:.12f}, "
            f"multiplier {event.multiplier.real:.10f}"
        )
    shown = ", ".join(f"{ratio:.4f}" for ratio in cascade.ratios)
    options.say(f"ratios of intervals {shown} beside Feigenbaum's {FEIGENBAUM:.4f}")
    options.say(f"they accumulate at {cascade.accumulation:.8f}")
    return {
        "footsteps": [branch.footsteps for branch in cascade.branches],
        "slopes": cascade.values.tolist(),
        "multipliers": [event.multiplier.real for event in cascade.doublings],
        "ratios": cascade.ratios.tolist(),
        "feigenbaum": FEIGENBAUM,
        "accumulation": cascade.accumulation,
    }


def settled(count: int, long: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Slopes, stance angles at the strikes that walks settle on, and how many they are.

    Walks begin at the long gait; NaN where one falls. The count is 0 where no cycle was seen.
    """
    slopes = np.linspace(0.0145, 0.0191, count)
    places = [int(np.argmin(np.abs(long.values - slope))) for slope in slopes]
    starts = [long.state(place) for place in places]
    states = jax.tree.map(lambda *leaves: jnp.stack(leaves), *starts)

    @jax.jit
    @jax.vmap
    def strikes(slope: jax.Array, start: jb.dynamics.RigidState) -> Any:
        walk = jb.rigid_walk(
            scene_of(slope), start, footsteps=SETTLING + SHOWN, accuracy="tight",
            max_arrivals=SETTLING + SHOWN, max_solver_steps=1 << 20,
        )  # fmt: skip
        return walk.arrivals.state.theta_2[SETTLING:]

    angles = np.asarray(strikes(jnp.asarray(slopes), states))
    angles = np.where(np.isfinite(angles), angles, np.nan)
    return slopes, angles, np.array([cycle_of(row) for row in angles])


def cycle_of(row: np.ndarray) -> int:
    """Footsteps after which a walk repeats itself, 0 where it does not, −1 where it fell."""
    if np.isnan(row).any():
        return -1
    for k in range(1, len(row) // 2):
        if np.max(np.abs(row[k:] - row[:-k])) < SAME:
            return k
    return 0


def chaos(options: Options, walks: tuple[np.ndarray, ...]) -> dict[str, Any]:
    """The steepest slope on which walks repeat themselves in 2ᵏ footsteps, and the first beyond."""
    slopes, _, cycles = walks
    doubled = np.isin(cycles, 2 ** np.arange(8))
    first = int(np.argmax(~doubled))
    fallen = slopes[cycles < 0]
    row = {
        "last_cycle": float(slopes[first - 1]),
        "first_without": float(slopes[first]),
        "first_fall": float(fallen.min()) if fallen.size else None,
    }
    options.say(
        f"walks: cycles of 2ᵏ footsteps up to {row['last_cycle']:.5f}, none from "
        f"{row['first_without']:.5f}; the first falls at {row['first_fall']}"
    )
    return row


def period_three(options: Options) -> tuple[list[Any], dict[str, Any]]:
    """The branches of gaits of three footsteps that deflation finds, and what is known of them."""
    scene = scene_of(PERIOD_THREE)
    starts = 8 if options.quick else 32
    gaits = jb.continuation.find_isolated(scene, footsteps=3, starts=starts, accuracy="tight")
    rows, branches = [], []
    for gait in gaits:
        options.say(
            f"3 footsteps at {PERIOD_THREE:g}: θ = {gait.state.theta_2:.12f}, "
            f"λ = {gait.point.multipliers[0].real:.6f}"
        )
        rows.append(
            {
                "theta": float(gait.state.theta_2),
                "multipliers": [[v.real, v.imag] for v in gait.point.multipliers.tolist()],
                "residual": gait.point.residual,
            }
        )
    if gaits:
        branch = jb.continue_gait(
            scene, "slope", bounds=BOUNDS, guess=gaits[0].state, footsteps=3, accuracy="tight"
        )
        branches.append(branch)
        options.say(f"their branch: {branch!r}")
    return branches, {"gaits": rows, "branches": [points_of(branch) for branch in branches]}


def points_of(branch: Any) -> dict[str, Any]:
    stable = branch.values[[each is True for each in branch.stable]]
    return {
        "footsteps": branch.footsteps,
        "gaits": len(branch),
        "stable_slopes": [stable.min(), stable.max()] if stable.size else None,
        "bifurcations": [[str(each.kind), each.value] for each in branch.bifurcations],
        "ends": [[str(stop.end), stop.cause, stop.value] for stop in branch.stops],
    }


def draw(options: Options, branches: list[Any], walks: tuple[np.ndarray, ...]) -> str:
    figure = new_figure(13.0, 5.6)
    left, right = figure.subplots(1, 2)
    plot.branch(branches, "theta_2", ax=left)
    left.set_title("The simplest walker: stance angle after a strike", loc="left")
    slopes, angles, _ = walks
    right.plot(
        np.repeat(slopes, angles.shape[1]), angles.ravel(), ".", color="#999999", markersize=1.2,
        label="strikes of walks", zorder=0,
    )  # fmt: skip
    plot.branch(branches[1:], "theta_2", ax=right)
    right.set_xlim(slopes[0], slopes[-1])
    low, high = np.nanmin(angles), np.nanmax(angles)
    right.set_ylim(low - 0.01, high + 0.01)
    right.set_title("The cascade, and where walks settle (grey)", loc="left")
    return options.save(figure, "period_doubling.png")


if __name__ == "__main__":
    main()
