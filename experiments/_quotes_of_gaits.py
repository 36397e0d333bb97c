"""What the pages quote of gaits, their branches, designs and models."""

from collections.abc import Iterator
from typing import Any

from _quote_words import UNKNOWN, fixed, row, small, table


def of_identify(numbers: dict[str, Any]) -> Iterator[str]:
    """In how many fits the intervals hold the truth."""
    inside = {name: each["inside_95"] for name, each in numbers["parameters"].items()}
    yield f"{numbers['sets']} times over"
    yield (
        f"in {100 * inside['K']:g} % (K), {100 * inside['c']:g} % (c) and "
        f"{100 * inside['mu_kinetic']:g} % (friction) of the fits"
    )
    for name, setting in numbers["settings"].items():
        for found in setting["parameters"].values() if name != "precise" else ():
            share = f"{100 * found['inside_95']:.1f} %"
            yield row(UNKNOWN, found["undetermined"], found["one_sided"], share)


def of_mechanism_speed(numbers: dict[str, Any]) -> Iterator[str]:
    """A walker with five links beside numbalsoda and MuJoCo, and how a step's cost grows."""
    for each in numbers["rates"]["rows"]:
        how = each["rtol"] if "rtol" in each else each["step_s"]
        rate = round(each["simulated_s_per_cpu_s"])
        yield row(each["way"], small(how, 0), each["error_median"], rate)
    for each in numbers["chains"]:
        yield row(each["bodies"], each["operations"])
    yield f"n^{numbers['exponent']:.2f}"


def of_ladder(numbers: dict[str, Any]) -> Iterator[str]:
    """Measures and costs of the rungs, and the way to the rigid limit, also of one with knees."""
    for name, found in numbers["measures"].items():
        cost = numbers["costs"][name]
        timed = "batch_us" in cost
        single, batch = cost.get("single_us"), cost.get("batch_us")
        told = (
            f"{single:.{0 if single > 100 else 1}f} µs" if timed else UNKNOWN,
            f"{batch:.{1 if batch > 10 else 2}f} µs" if timed else UNKNOWN,
            cost["error"] if timed else UNKNOWN,
        )
        gait = *fixed(found, 5, "period", "step_length"), *fixed(found, 4, "spectral_radius")
        yield row(f"{name}{UNKNOWN}", *gait, *told)
    both, alone = (numbers["paths"][path]["rates"] for path in ("c with K", "c alone"))
    yield (
        f"the period differs from the rigid one by s^−{both['period']:.2f} and the step length by "
        f"s^−{both['step_length']:.2f}. If c alone grows, the period differs by "
        f"s^−{alone['period']:.1f}"
    )
    kneed = numbers["kneed"]
    steps = [(f"{each['factor']:.0f}", each) for each in kneed["paths"]["c with K^(3/2)"]]
    for words, found in [*steps, ("rigid", kneed["rigid"])]:
        pair = "{:.4f} ± {:.4f} i".format(*found["pair"])
        yield row(words, *fixed(found, 5, "period", "step_length"), pair, *fixed(found, 4, "third"))


def of_mechanism_matrix(numbers: dict[str, Any]) -> Iterator[str]:
    """What each capability gives on each mechanism, and the sentences that refuse it."""
    yield from filter(None, table(numbers["rows"]))


def of_force_models(numbers: dict[str, Any]) -> Iterator[str]:
    """How far the gait moves under other laws, and how accurate multipliers are with Tsuji's."""
    seed = numbers["normal"]["ristow-schafer"]["measures"]

    def moved(law: dict[str, Any], key: str) -> float:
        return float(law["measures"][key] / seed[key] - 1.0)

    damped = {name: law for name, law in numbers["normal"].items() if law["measures"]}
    keys = ("period_s", "step_length_m", "speed_m_s")
    most = max(abs(moved(law, key)) for law in damped.values() for key in keys)
    least = min(moved(law, "peak_normal_N") for law in damped.values())
    largest = max(moved(law, "peak_normal_N") for law in damped.values()) + 1.0
    yield f"period, step length and speed change by at most {100 * most:.1f} %"
    yield f"force changes by −{-100 * least:.0f} % (Hunt–Crossley) to {largest:.1f} times"
    error = numbers["normal"]["tsuji"]["unit_multiplier_error"]
    yield f"the unit multiplier is off by {small(error)}"


def of_level_ground(numbers: dict[str, Any]) -> Iterator[str]:
    """What the simplest walker's push-off saves, and what drives of the seed's walker cost."""
    pairs = numbers["simplest"]
    yield f"{pairs[0]['ratio']:.2f} times at a half-angle of {pairs[0]['angle_rad']:.2f} rad"
    yield f"{pairs[-1]['ratio']:.2f} times at {pairs[-1]['angle_rad']:.2f} rad"
    for name, curve in numbers["seed"].items():
        stable = [point for point in curve if point["stable"]]
        ends = [pick(stable, key=lambda point: point["speed_m_s"]) for pick in (min, max)]
        speeds = [f"{end['speed_m_s']:.3f}" for end in ends]
        yield row(name, *speeds, *[small(end["cost_of_transport"], 2) for end in ends])
    for each in numbers["designs"]:
        costs = fixed(each, 6, "seed_cost", "cost_of_transport")
        yield row(
            *fixed(each, 2, "speed_m_s"), *costs, *fixed(each["variables"], 4, "impulse", "d", "J")
        )


def of_driven_compass(numbers: dict[str, Any]) -> Iterator[str]:
    """The cheapest steps of the compass walker by law, and how far above the free torque's."""
    for each in numbers["rows"]:
        above = small(each["above_free"], 2)
        yield row(each["law"], each["formulation"], each["outcome"], *fixed(each, 6, "cost"), above)


def of_optimise_speed(numbers: dict[str, Any]) -> Iterator[str]:
    """Optimisers on one problem, designs at no loss of speed, and what descents took."""
    for name, each in numbers["fastest"].items():
        ended = each["outcome"], each["evaluations"]
        yield row(name, *fixed(each, 4, "objective"), *ended, *fixed(each, 1, "cpu_s"))
    for name, each in numbers["designs"].items():
        sizes, told = fixed(each["measures"], 4, "spectral_radius", "speed"), each["certificate"]
        yield row(name, *sizes, *fixed(told, 2, "sensitivity_norm"), f"{told['basin'][0]:.3f}")
    for name, each in numbers["descents"].items():
        yield row(name, each["iterations"], each["evaluations"], *fixed(each, 1, "warm_cpu_s"))


def of_published_walkers(numbers: dict[str, Any]) -> Iterator[str]:
    """What was printed of published walkers, ours, and the difference; rounding is not told."""
    for each in numbers["rows"]:
        off = each["difference"] if each["difference"] > 2e-12 else "below 2e-12"
        yield row(*(each[name] for name in ("walker", "quantity", "printed", "ours")), off)


def of_radius_map(numbers: dict[str, Any]) -> Iterator[str]:
    """What a map of gaits costs."""
    for each in numbers["rows"]:
        yield row(each["kind"], each["found"], *fixed(each, 1, "first_s", "then_s", "cpu_s"))


def of_search_robustness(numbers: dict[str, Any]) -> Iterator[str]:
    """How many scenes were searched, in how many walks settle, and how many were missed."""
    rows = [each for family in numbers.values() for each in family]
    settles = [each for each in rows if each["cycle"] >= 1]
    missed = [each for each in settles if each["verdict"] == "missed"]
    found = "all of them" if not missed else f"all but {len(missed)} of them"
    yield f"of {len(rows)} scenes"
    yield f"settle on a gait or a longer cycle in {len(settles)}, and the search finds {found}"


def of_slope_branch(numbers: dict[str, Any]) -> Iterator[str]:
    """Where each model loses its stability, by the branch and by bisection, and how that moves."""
    for name, found in numbers["scenes"].items():
        for loss in found["losses"]:
            kind, multiplier = loss["kind"].replace("-", " "), loss["multiplier"][0]
            yield row(
                name, kind, f"{loss['slope']:.9f}", f"{loss['bisection'][1]:.9f}",
                abs(abs(multiplier) - 1.0), loss["error"],
            )  # fmt: skip
    for name, found in numbers["cases"].items():
        known = (found["parameters"].get(each) for each in ("K", "c", "J", "d", "r"))
        cells = (each and f"{each['elasticity']:.4f}" for each in known)
        yield row(name, *fixed(found, 6, "slope_rad"), *cells)


def of_period_doubling(numbers: dict[str, Any]) -> Iterator[str]:
    """Doublings of the rigid seed and of the simplest walker, and its gaits of three footsteps."""
    yield f"at {numbers['rigid_seed']['slope']:.6f} rad"
    long, short = numbers["pair"]["long"], numbers["pair"]["short"]
    yield f"θ = {long['theta']:.12f} and {short['theta']:.12f}"
    first, second = (value for value, _ in short["multipliers"][:2])
    yield f"multipliers {first:.4f} and {second:.4f}"
    cascade = numbers["cascade"]
    for footsteps, slope in zip(cascade["footsteps"], cascade["slopes"], strict=True):
        yield row(footsteps, f"{slope:.9f}")
    yield ", ".join(f"{ratio:.3f}" for ratio in cascade["ratios"])
    chaos = numbers["chaos"]
    yield f"accumulate at {cascade['accumulation']:.5f} rad"
    yield f"up to {chaos['last_cycle']:.5f} rad, and none from {chaos['first_without']:.5f} on"
    (family,) = numbers["period_three"]["branches"]
    places = {kind: value for kind, value in family["bifurcations"]}
    yield f"fold at {places['fold']:.6f} rad"
    yield f"doubling at {places['period-doubling']:.6f}"
