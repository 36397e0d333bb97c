"""What the pages quote of the experiments' results.

`--keep` turns the numbers of a run into the file of results: without the paths of its pictures, and
with `--untimed`, for a machine that was not idle, without its timings; its pictures go, lighter, to
the site's gallery. Without it, all that the results say is printed as the pages must have it, which
tests/test_results.py asks for.
"""

import dataclasses
import datetime
import json
import os
import platform
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import tyro
from PIL import Image

RESULTS = Path(__file__).parent / "results"
GALLERY = Path(__file__).parents[1] / "docs" / "gallery"
COLOURS, WIDEST = 256, 1600
"""Of a picture in the gallery, and pixels: figures have few, and pages should load."""
PICTURES = {"picture", "pictures"}
TIMINGS = {
    "batch_ratio", "batch_us", "compile_s", "first_compile_s", "first_result_s", "gaits_s",
    "cheapest_by_cpu", "cold_cpu_s", "cold_wall_s", "cpu_s", "first_s", "seconds", "single_us",
    "then_s", "wall_ms", "wall_s", "wall_s_run", "warm_cpu_s", "warm_wall_s",
}  # fmt: skip
"""Keys of what an idle machine must measure."""
UNKNOWN = "…"
"""Stands for what the results do not hold: the pages may say anything there."""


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of keeping and quoting."""

    keep: Path | None = None
    """Numbers of a run; they are kept under the file's name."""
    untimed: bool = False
    """Leave timings out."""


def without(numbers: Any, keys: set[str]) -> Any:
    """The same numbers without the entries of these keys, at any depth."""
    if isinstance(numbers, dict):
        return {key: without(value, keys) for key, value in numbers.items() if key not in keys}
    if isinstance(numbers, list):
        return [without(value, keys) for value in numbers]
    return numbers


def machine() -> str:
    """What this machine is, as far as results depend on it."""
    known = hasattr(os, "sched_getaffinity")
    cores = len(os.sched_getaffinity(0)) if known else os.cpu_count()
    features = llvm.get_host_cpu_features()
    vectors = {"AVX-512": "avx512f", "AVX2": "avx2"}
    width = next((word for word, flag in vectors.items() if features.get(flag)), "")
    return f"{cores} cores, {width or platform.machine()}"


def pictures_of(numbers: dict[str, Any]) -> list[Path]:
    """Paths of the pictures that a run wrote."""
    named = numbers.get("pictures", [numbers["picture"]] if "picture" in numbers else [])
    found = named.values() if isinstance(named, dict) else named
    return [Path(each) for each in found if str(each).endswith(".png")]


def keep_picture(experiment: str, picture: Path) -> None:
    """Puts a picture into the gallery, under the name of its experiment."""
    own = picture.stem.removeprefix(experiment).strip("_-")
    drawn = Image.open(picture).convert("RGB")
    drawn.thumbnail((WIDEST, WIDEST * 4))
    few = drawn.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    GALLERY.mkdir(exist_ok=True)
    few.save(GALLERY / f"{'-'.join(filter(None, (experiment, own)))}.png", optimize=True)


def keep(path: Path, *, untimed: bool) -> Path:
    """Writes a run's numbers into the folder of results, a list of numbers on one line."""
    run = json.loads(path.read_text())
    numbers = without(run, PICTURES | (TIMINGS if untimed else set()))
    numbers["made"] = {"date": datetime.date.today().isoformat(), "machine": machine()}
    text = json.dumps(numbers, indent=1, ensure_ascii=False)
    text = re.sub(r"\[[^][{}]*\]", lambda found: " ".join(found[0].split()), text)
    RESULTS.mkdir(exist_ok=True)
    kept = RESULTS / path.name
    kept.write_text(text + "\n")
    return kept


def small(number: float | None, digits: int = 1) -> str:
    """A number as the pages write it: 1.7e-3, 2.1e-1, 1.6."""
    if number is None:
        return UNKNOWN
    mantissa, exponent = f"{number:.{digits}e}".split("e")
    return mantissa if int(exponent) == 0 else f"{mantissa}e{int(exponent)}"


def row(*cells: str) -> str:
    """A row of a table."""
    return f"| {' | '.join(cells)} |"


def percents(number: float) -> str:
    """A fraction as the pages write it."""
    return f"{100.0 * number:.1f}"


def of_basin_seed(numbers: dict[str, Any]) -> Iterator[str]:
    """How much of the slice walks, how folded boundaries are, and what changes the basin."""
    walks, boundary = numbers["fractions"]["walking period-1"], numbers["boundary"]
    interval = f"[{percents(walks['low'])}, {percents(walks['high'])}]"
    yield f"Of that slice {percents(walks['estimate'])} % {interval} walks"
    yield (
        f"the boundary of what walks has dimension {boundary['walking or not']['dimension']:.2f}, "
        f"that of all labels {boundary['all labels']['dimension']:.2f}"
    )
    for name, said in (("c", "falls with damping"), ("K", "grows with stiffness")):
        (first, *_), *_, (last, *_) = numbers["along"][name]["walking"]
        yield f"{said} ({percents(first)} to {percents(last)} %"
    yield f"{min(row['distance'] for row in numbers['pushes']):.4f} (units of"
    yield f"rays alone find {numbers['pushes'][0]['distance']:.4f}"


def of_basin_simplest(numbers: dict[str, Any]) -> Iterator[str]:
    """How thin the simplest walker's basin is."""
    shares = {slope: found["fractions"][-1] for slope, found in numbers["slopes"].items()}
    (low, first), (high, second) = shares.items()
    yield (
        f"{100.0 * first['estimate']:.2f} % of a square at a slope of {low} and "
        f"{100.0 * second['estimate']:.2f} % at {high}"
    )


def of_gradient_accuracy(numbers: dict[str, Any]) -> Iterator[str]:
    """The unit multiplier's error against tolerance, stepping for the state and ours."""
    points = numbers["points"]["exact laws"]
    for plain, both in zip(points["plain"], points["both"], strict=True):
        yield row(
            small(plain["rtol"], 0),
            str(plain["steps"]),
            small(plain["unit_multiplier"]),
            str(both["steps"]),
            small(both["unit_multiplier"]),
        )


def of_bifurcation_elasticities(numbers: dict[str, Any]) -> Iterator[str]:
    """How the critical slopes move with the contact's stiffness and the feet's radius."""
    for name, found in numbers["cases"].items():
        cells = [f"{found['slope_rad']:.6f}"]
        for parameter in ("K", "c", "J", "d", "r"):
            known = found["parameters"].get(parameter)
            cells.append("–" if known is None else f"{known['elasticity']:.4f}")
        yield row(name, *cells)


def of_gradient_cost(numbers: dict[str, Any]) -> Iterator[str]:
    """CPU time over the number of parameters."""
    costs = ("return_ms", "return_with_columns_ms", "radius_by_adjoint_ms")
    for each in numbers["rows"]:
        times = (f"{each[name]:.1f}" for name in costs)
        yield row(str(each["parameters"]), *times, f"{each['radius_by_differences_ms']:.0f}")


def of_gradient_truth(numbers: dict[str, Any]) -> Iterator[str]:
    """Errors of state and gradient of each way and setting, and what it says of them."""
    for each in numbers["rows"]:
        if each["outcome"] == "answered":
            said = "nothing" if each["said"] is None else small(each["said"])
            setting = f"{each['setting']} = {small(each['value'], 0)}"
            errors = small(each["state_error"]), small(each["gradient_error"])
            yield row(each["problem"], each["way"], setting, *errors, said)
    damped = {
        (each["way"], each["value"]): each
        for each in numbers["rows"]
        if each["problem"] == "spring and damper" and each["outcome"] == "answered"
    }
    ours, tsit5 = damped["jaxbiped", 1e-6], damped["diffrax Tsit5", 1e-6]
    warp = damped["Warp", 1e-5]
    yield f"{small(ours['gradient_error'])}, says {small(ours['said'])}"
    yield f"diffrax {small(tsit5['gradient_error'])}, Warp {small(warp['gradient_error'])}"


def of_footstep_truth(numbers: dict[str, Any]) -> Iterator[str]:
    """Errors of a footstep and its gradient by each way and setting, and what it says of them."""
    for each in numbers["rows"]:
        said = "nothing" if each["said"] is None else small(each["said"])
        setting = f"{each['setting']} = {small(each['value'], 0)}"
        yield row(
            each["way"], setting, small(each["state_error"]), small(each["gradient_error"]), said
        )
    yield f"changes by {small(numbers['problem']['coarser_collocation'])}"
    yield f"differs from our finest solve by {small(numbers['problem']['our_finest'])}"


def of_reproducibility(numbers: dict[str, Any]) -> Iterator[str]:
    """How walks, labels and the gait differ by widths, batches, threads and engines."""
    yield f"of {numbers['walks']} walks"
    for each in numbers["rows"]:
        labels, gait = each["labels"], each["gait"]
        yield row(
            each["name"], str(each["same_bits"]), small(each["median"]), small(each["largest"]),
            str(each["endings"]), "–" if labels is None else str(labels),
            "–" if gait is None else small(gait),
        )  # fmt: skip


def of_identify(numbers: dict[str, Any]) -> Iterator[str]:
    """In how many fits the intervals hold the truth."""
    inside = {name: each["inside_95"] for name, each in numbers["parameters"].items()}
    yield f"{numbers['sets']} times over"
    yield (
        f"in {100 * inside['K']:g} % (K), {100 * inside['c']:g} % (c) and "
        f"{100 * inside['mu_kinetic']:g} % (friction) of the fits"
    )


def of_ladder(numbers: dict[str, Any]) -> Iterator[str]:
    """Measures and costs of the rungs, and the rates of the way to the rigid limit."""
    for name, found in numbers["measures"].items():
        cost = numbers["costs"][name]
        timed = "batch_us" in cost
        single, batch = cost.get("single_us"), cost.get("batch_us")
        yield row(
            f"{name}{UNKNOWN}",
            f"{found['period']:.5f}",
            f"{found['step_length']:.5f}",
            f"{found['spectral_radius']:.4f}",
            f"{single:.{0 if single > 100 else 1}f} µs" if timed else UNKNOWN,
            f"{batch:.{1 if batch > 10 else 2}f} µs" if timed else UNKNOWN,
            small(cost["error"]) if timed else UNKNOWN,
        )
    both, alone = (numbers["paths"][path]["rates"] for path in ("c with K", "c alone"))
    yield (
        f"its period differs by s^−{both['period']:.2f} and its step length by "
        f"s^−{both['step_length']:.2f}, with c alone by s^−{alone['period']:.1f}"
    )


def of_force_models(numbers: dict[str, Any]) -> Iterator[str]:
    """How far the gait moves under other laws, and what tells that a law is not to be trusted."""
    seed = numbers["normal"]["ristow-schafer"]["measures"]

    def moved(law: dict[str, Any], key: str) -> float:
        return float(law["measures"][key] / seed[key] - 1.0)

    damped = {name: law for name, law in numbers["normal"].items() if law["measures"]}
    keys = ("period_s", "step_length_m", "speed_m_s")
    most = max(abs(moved(law, key)) for law in damped.values() for key in keys)
    least = min(moved(law, "peak_normal_N") for law in damped.values())
    largest = max(moved(law, "peak_normal_N") for law in damped.values()) + 1.0
    yield f"period, step length and speed move by at most {100 * most:.1f} %"
    yield f"the peak force by −{-100 * least:.0f} % (Hunt–Crossley) to {largest:.1f} times"
    yield f"(off by {numbers['normal']['tsuji']['unit_multiplier_error']:.2f})"


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
        costs = [f"{each[key]:.6f}" for key in ("seed_cost", "cost_of_transport")]
        variables = [f"{each['variables'][name]:.4f}" for name in ("impulse", "d", "J")]
        yield row(f"{each['speed_m_s']:.2f}", *costs, *variables)


def of_long_walks(numbers: dict[str, Any]) -> Iterator[str]:
    """How a long walk keeps to its gait."""
    period, spread = numbers["period_s"], numbers["window_std_s"]
    yield f"after {numbers['footsteps']:,} footsteps"
    yield f"differs from the period by {small(abs(numbers['mean_s'] / period - 1.0))} of it"
    yield f"the largest deviation is {small(numbers['largest_deviation_s'] / period)}"
    yield f"from {small(spread[0] / period)} in the first tenth to {small(spread[-1] / period)}"
    low, high = numbers["peak_MiB"]
    yield f"{low:.0f} MiB after a tenth and {high:.0f} MiB at the end"


def of_optimise_speed(numbers: dict[str, Any]) -> Iterator[str]:
    """Optimisers on one problem, designs at no loss of speed, and what descents took."""
    for name, each in numbers["fastest"].items():
        best, seconds = f"{each['objective']:.4f}", f"{each['wall_s']:.1f}"
        yield row(name, best, each["outcome"], str(each["evaluations"]), seconds)
    for name, each in numbers["designs"].items():
        measures, told = each["measures"], each["certificate"]
        sizes = (f"{measures['spectral_radius']:.4f}", f"{measures['speed']:.4f}")
        basin, norm = f"{told['basin'][0]:.3f}", f"{told['sensitivity_norm']:.2f}"
        yield row(name, *sizes, norm, basin)
    for name, each in numbers["descents"].items():
        seconds = (f"{each[key]:.1f}" for key in ("warm_wall_s", "warm_cpu_s"))
        yield row(name, str(each["iterations"]), str(each["evaluations"]), *seconds)


def of_radius_map(numbers: dict[str, Any]) -> Iterator[str]:
    """What a map of gaits costs."""
    for each in numbers["rows"]:
        seconds = (f"{each[key]:.1f}" for key in ("first_s", "then_s", "cpu_s"))
        yield row(each["kind"], str(each["found"]), *seconds)


def of_search_robustness(numbers: dict[str, Any]) -> Iterator[str]:
    """How many scenes were searched, in how many walks settle, and how many were missed."""
    rows = [each for family in numbers.values() for each in family]
    settles = [each for each in rows if each["cycle"] >= 1]
    missed = [each for each in settles if each["verdict"] == "missed"]
    found = "all of them" if not missed else f"all but {len(missed)} of them"
    yield f"of {len(rows)} scenes"
    yield f"settle on a gait or a longer cycle in {len(settles)}, and the search finds {found}"


def of_slope_branch(numbers: dict[str, Any]) -> Iterator[str]:
    """Where each model of the seed's walker loses its stability, by the branch and by bisection."""
    for name, found in numbers["scenes"].items():
        for loss in found["losses"]:
            kind, multiplier = loss["kind"].replace("-", " "), loss["multiplier"][0]
            yield row(
                name, kind, f"{loss['slope']:.9f}", f"{loss['bisection'][1]:.9f}",
                small(abs(abs(multiplier) - 1.0)), small(loss["error"]),
            )  # fmt: skip


def of_period_doubling(numbers: dict[str, Any]) -> Iterator[str]:
    """Doublings of the rigid seed and of the simplest walker, and its gaits of three footsteps."""
    yield f"at {numbers['rigid_seed']['slope']:.6f} rad"
    long, short = numbers["pair"]["long"], numbers["pair"]["short"]
    yield f"θ = {long['theta']:.12f} and {short['theta']:.12f}"
    first, second = (value for value, _ in short["multipliers"][:2])
    yield f"multipliers {first:.4f} and {second:.4f}"
    cascade = numbers["cascade"]
    for footsteps, slope in zip(cascade["footsteps"], cascade["slopes"], strict=True):
        yield row(str(footsteps), f"{slope:.9f}")
    yield ", ".join(f"{ratio:.3f}" for ratio in cascade["ratios"])
    chaos = numbers["chaos"]
    yield f"accumulate at {cascade['accumulation']:.5f} rad"
    yield f"up to {chaos['last_cycle']:.5f} rad, and none from {chaos['first_without']:.5f} on"
    (family,) = numbers["period_three"]["branches"]
    places = {kind: value for kind, value in family["bifurcations"]}
    yield f"fold at {places['fold']:.6f} rad"
    yield f"doubling at {places['period-doubling']:.6f}"


def of_accuracy_coverage(numbers: dict[str, Any]) -> Iterator[str]:
    """How many true errors lie within their bars."""
    walks, gaits = numbers["walks"], numbers["gaits"]
    rigid = numbers["rigid"]
    yield (
        f"{walks['met']} of {walks['run']} walks, {rigid['met']} of {rigid['run']} rigid ones and "
        f"{gaits['met']} of {gaits['run']} gaits"
    )
    for name, found in numbers["coverage"].items():
        # Zeros have no relative error.
        ratio = "–" if name == "multipliers of zero" else f"{found['median_ratio']:.1f}"
        counts = ("numbers", "resolved", "covered", "scenes", "scenes_all_covered")
        yield row(name, *(str(found[each]) for each in counts), ratio)


def of_label_accuracy(numbers: dict[str, Any]) -> Iterator[str]:
    """How many labels change with the tolerance, and what is known of those that do."""
    named, starts = numbers["named"], numbers["starts"]
    changed = {each["way"]: each for each in named["rows"]}
    yield f"Of {starts:,} starts"
    for name in ("draft", "balanced", "tight"):
        each = changed[name]
        yield row(
            f"`{name}`", str(each["changed"]), str(each["walking_changed"]),
            f"{each['attempted']:.0f}",
        )  # fmt: skip
    yield f"{named['between']['draft and tight']} labels differ between draft and tight"
    yield f"the two references differ in {named['references_differ']}"
    for model, found in numbers["by_number"].items():
        for each in found:
            yield row(
                model, f"{each['wanted']:g}", str(each["relabelled"]), str(each["changed"]),
                str(each["in_doubt"]), f"{each['wrong_before']} → {each['truly_wrong']}",
                small(each["wrong_share"]), small(each["estimated_share"]),
                f"{each['within_interval']} of {each['draws']}",
                f"{each['met']} of {each['draws']}", f"{each['steps_ratio']:.1f}",
            )  # fmt: skip


def of_trade(numbers: dict[str, Any]) -> Iterator[str]:
    """Floors, errors of the named accuracies, and what ways cost at equal errors."""
    floors, counts = numbers["floors"], numbers["counts"]
    yield f"{counts['rows']} rows, {counts['failed']} of them failures"
    for group, axis in (
        ("walk", "state"), ("walk", "step_time"), ("walk", "energy"), ("slopes", "slopes"),
        ("gait", "period"), ("gait", "multiplier"), ("gait", "gradient"),
    ):  # fmt: skip
        yield row(f"{UNKNOWN}", small(floors[group][axis]), *_named(numbers, group, axis))
    for group, axis in (
        ("walk", "state"), ("batch", "state"), ("slopes", "slopes"), ("gait", "multiplier"),
        ("gait", "gradient"),
    ):  # fmt: skip
        table = numbers["at_equal_error"][group][axis]
        for way, steps in table["steps"].items():
            times = table.get("cpu_s", {}).get(way, [UNKNOWN] * len(steps))
            if any(each is not None for each in times):
                yield row(way, *(_milliseconds(times[k]) for k in _COMPARED))
    for found in numbers["rows"].get("stepping", ()):
        if found["setting"] == "rtol=1e-06":
            yield row(
                found["way"], str(found["attempted"]),
                *(small(found["errors"][axis]) for axis in ("period", "gradient")),
            )  # fmt: skip
    laws = {"the seed's laws": "walk"} | {k: k for k in ("smoothed laws", "v0 ten times wider")}
    for name, group in laws.items():
        ours = (each for each in numbers["rows"][group] if each["way"] == "rodas4 by lanes")
        (found,) = (each for each in ours if each["setting"] == "rtol=1e-06")
        yield row(name, str(found["attempted"]), small(found["errors"]["state"]))


_COMPARED = (1, 2, 3, 4, 5)
"""Which of the errors at which ways are compared are quoted: 1e-3 to 1e-7."""


def _milliseconds(seconds: float | str | None) -> str:
    if seconds is None:
        return "–"
    if isinstance(seconds, str):
        return UNKNOWN
    return f"{1e3 * seconds:.{0 if seconds >= 1e-2 else 1}f}"


def _named(numbers: dict[str, Any], group: str, axis: str) -> list[str]:
    """Errors by the named accuracies, or by three tolerances where there are none."""
    rows = numbers["rows"].get(f"named {group}")
    if rows is None:
        settings = ("rtol=1e-05", "rtol=1e-06", "rtol=1e-08")
        ours = [each for each in numbers["rows"][group] if each["way"] == "rodas4 by lanes"]
        rows = [each for name in settings for each in ours if each["setting"] == name]
    return [small(each["errors"][axis]) for each in rows]


def of_extremes(numbers: dict[str, Any]) -> Iterator[str]:
    """How cases, gaits and derivatives about a graze came out."""
    verdicts = ("run", "accurate", "flagged", "refused", "silently_wrong", "unresolved")
    gaits = numbers["gaits"]
    for name, found in (("walks", numbers), ("gaits", gaits)):
        yield row(name, *(str(found[each]) for each in verdicts))
    yield f"{numbers['run']} of the {numbers['catalogue']} cases"
    yield f"{numbers['precise']} cases by a solve at 40 digits"
    errors = numbers["errors"]
    yield f"{errors['within_told']} of {errors['told']} lie within"
    yield f"at most {errors['most_beyond_told']:.1f} times"
    for name, median in gaits["median_error"].items():
        yield f"{name} {small(median)} (at most {small(gaits['largest_error'][name])})"
    for swept in numbers["grazing"]:
        counted = (str(swept[name]) for name in ("derivatives", *verdicts[1:3], "silently_wrong"))
        yield row(swept["law"], swept["accuracy"], *counted, small(swept["largest_accurate"]))


QUOTES: dict[str, Callable[[dict[str, Any]], Iterator[str]]] = {
    "accuracy_coverage": of_accuracy_coverage,
    "basin_seed": of_basin_seed,
    "basin_simplest": of_basin_simplest,
    "bifurcation_elasticities": of_bifurcation_elasticities,
    "extremes": of_extremes,
    "footstep_truth": of_footstep_truth,
    "force_models": of_force_models,
    "gradient_accuracy": of_gradient_accuracy,
    "gradient_cost": of_gradient_cost,
    "gradient_truth": of_gradient_truth,
    "identify": of_identify,
    "label_accuracy": of_label_accuracy,
    "ladder": of_ladder,
    "level_ground": of_level_ground,
    "long_walks": of_long_walks,
    "optimise_speed": of_optimise_speed,
    "period_doubling": of_period_doubling,
    "reproducibility": of_reproducibility,
    "radius_map": of_radius_map,
    "search_robustness": of_search_robustness,
    "slope_branch": of_slope_branch,
    "trade": of_trade,
}
"""Of each experiment: the phrases and rows that the pages quote."""


def quoted(name: str) -> list[str]:
    """What the pages must say of an experiment's results."""
    return list(QUOTES[name](json.loads((RESULTS / f"{name}.json").read_text())))


def main() -> None:
    options = tyro.cli(Options, description=__doc__)
    if options.keep is not None:
        for picture in pictures_of(json.loads(options.keep.read_text())):
            keep_picture(options.keep.stem, picture)
        known = options.keep.stem in QUOTES
        print(keep(options.keep, untimed=options.untimed) if known else "no page quotes this")
        return
    for path in sorted(RESULTS.glob("*.json")):
        print(path.stem)
        for phrase in quoted(path.stem):
            print(f"  {phrase}")


if __name__ == "__main__":
    main()
