"""Period doublings: of the rigid seed's walker, and the simplest walker's cascade to chaos.

The simplest walker (Garcia, Chatterjee, Ruina and Coleman 1998) on its slope of 0.009 has a long
and a short gait; the long one doubles its period again and again. Ratios of the intervals are held
beside Feigenbaum's 4.669, walks beside the branches, and gaits of three footsteps are found by
deflation, without a guess. Writes period_doubling.png.
"""

import jax
import jax.numpy as jnp
import numpy as np
from _experiment import Options, experiment
from _scenes import rigid_seed

import jaxbiped as jb
from jaxbiped import plot
from jaxbiped.plot.style import new_figure

PAIR_SLOPE = 0.009
BOUNDS = (0.0005, 0.019)
FEIGENBAUM = 4.669201609
DOUBLINGS, QUICK_DOUBLINGS = 6, 3
PERIOD_THREE = 0.0155
"""Slope at which gaits of three footsteps are sought."""
STARTS, QUICK_STARTS = 32, 8
WALKED, QUICK_WALKED = 300, 60
"""Slopes walked on, and footsteps: so many to settle, so many to look at."""
SETTLING, SHOWN = 600, 128
SAME = 1e-5


@experiment
def main(options: Options):
    seed = jb.continue_gait(rigid_seed(), "slope", bounds=(0.09, 0.11), accuracy="tight")
    doubled = jb.continuation.switch_branch(seed)
    # Both gaits on the slope of 0.009, found without a guess.
    pair = jb.continuation.find_isolated(jb.models.garcia(PAIR_SLOPE), accuracy="tight")
    pair = sorted(pair, key=lambda each: -float(each.state.theta_2))
    long, short = (branch_of(PAIR_SLOPE, gait) for gait in pair)
    cascade = jb.continuation.doubling_cascade(long, options.sized(DOUBLINGS, QUICK_DOUBLINGS))
    walks = settled(options.sized(WALKED, QUICK_WALKED), long)
    scene, starts = jb.models.garcia(PERIOD_THREE), options.sized(STARTS, QUICK_STARTS)
    how = dict(footsteps=3, accuracy="tight")
    three = jb.continuation.find_isolated(scene, starts=starts, **how)
    families = [branch_of(PERIOD_THREE, gait, footsteps=3) for gait in three[:1]]
    return {
        "rigid_seed": {"slope": seed.bifurcations[0].value, "doubled": points_of(doubled)},
        "pair": {
            name: gait_numbers(gait)
            | {
                "stable": gait.stable,
                "stable_slopes": stable_slopes(branch),
                "first_doubling": branch.bifurcations[0].value if branch.bifurcations else None,
            }
            for name, gait, branch in zip(("long", "short"), pair, (long, short), strict=True)
        },
        "cascade": {
            "footsteps": [branch.footsteps for branch in cascade.branches],
            "slopes": cascade.values.tolist(),
            "multipliers": [event.multiplier.real for event in cascade.doublings],
            "ratios": cascade.ratios.tolist(),
            "feigenbaum": FEIGENBAUM,
            "accumulation": cascade.accumulation,
        },
        "chaos": chaos(*walks),
        "period_three": {
            "gaits": [gait_numbers(gait) | {"residual": gait.point.residual} for gait in three],
            "branches": [points_of(branch) for branch in families],
        },
        "picture": draw(options, [short, *cascade.branches, *families], *walks),
    }


def branch_of(slope, gait, footsteps=1):
    """The simplest walker's branch along the slope through a gait."""
    how = dict(bounds=BOUNDS, guess=gait.state, footsteps=footsteps, accuracy="tight")
    return jb.continue_gait(jb.models.garcia(slope), "slope", **how)


def gait_numbers(gait):
    multipliers = [[value.real, value.imag] for value in gait.point.multipliers.tolist()]
    return {"theta": float(gait.state.theta_2), "multipliers": multipliers}


def stable_slopes(branch):
    """Least and largest slope with a stable gait."""
    stable = branch.values[[each is True for each in branch.stable]]
    return [stable.min(), stable.max()] if stable.size else None


def points_of(branch):
    return {
        "footsteps": branch.footsteps,
        "gaits": len(branch),
        "stable_slopes": stable_slopes(branch),
        "bifurcations": [[str(each.kind), each.value] for each in branch.bifurcations],
        "ends": [[str(stop.end), stop.cause, stop.value] for stop in branch.stops],
    }


def settled(count, long):
    """Slopes, stance angles at the strikes that walks settle on, and how many they are.

    Walks begin at the long gait; NaN where one falls. The count is 0 where no cycle was seen.
    """
    slopes = np.linspace(0.0145, 0.0191, count)
    starts = [long.state(int(np.argmin(np.abs(long.values - slope)))) for slope in slopes]
    how = dict(footsteps=SETTLING + SHOWN, max_arrivals=SETTLING + SHOWN, accuracy="tight")

    @jax.jit
    @jax.vmap
    def strikes(slope, start):
        walk = jb.rigid_walk(jb.models.garcia(slope), start, max_solver_steps=1 << 20, **how)
        return walk.arrivals.state.theta_2[SETTLING:]

    states = jax.tree.map(lambda *leaves: jnp.stack(leaves), *starts)
    angles = np.asarray(strikes(jnp.asarray(slopes), states))
    angles = np.where(np.isfinite(angles), angles, np.nan)
    return slopes, angles, np.array([cycle_of(row) for row in angles])


def cycle_of(row):
    """Footsteps after which a walk repeats itself, 0 where it does not, −1 where it fell."""
    if np.isnan(row).any():
        return -1
    lengths = range(1, len(row) // 2)
    return next((k for k in lengths if np.max(np.abs(row[k:] - row[:-k])) < SAME), 0)


def chaos(slopes, _, cycles):
    """The steepest slope on which walks repeat themselves in 2ᵏ footsteps, and the first beyond."""
    first = int(np.argmax(~np.isin(cycles, 2 ** np.arange(8))))
    fallen = slopes[cycles < 0]
    return {
        "last_cycle": float(slopes[first - 1]),
        "first_without": float(slopes[first]),
        "first_fall": float(fallen.min()) if fallen.size else None,
    }


def draw(options, branches, slopes, angles, _):
    left, right = new_figure(13.0, 5.6).subplots(1, 2)
    plot.branch(branches, "theta_2", ax=left)
    left.set_title("The simplest walker: stance angle after a strike")
    look = dict(color="#999999", markersize=1.2, label="strikes of walks", zorder=0)
    right.plot(np.repeat(slopes, angles.shape[1]), angles.ravel(), ".", **look)
    plot.branch(branches[1:], "theta_2", ax=right)
    right.set_xlim(slopes[0], slopes[-1])
    right.set_ylim(np.nanmin(angles) - 0.01, np.nanmax(angles) + 0.01)
    right.set_title("The cascade, and where walks settle (grey)")
    return options.save(left.figure, "period_doubling.png")


if __name__ == "__main__":
    main()
