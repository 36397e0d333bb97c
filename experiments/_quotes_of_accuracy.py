"""What the pages quote of errors, gradients, basins and costs."""

import itertools
from collections.abc import Iterator
from typing import Any

from _quote_words import UNKNOWN, fixed, percents, row, small

RARE = 1e-3
"""Fractions below this are of labels that the pages do not count."""


def of_basin_seed(numbers: dict[str, Any]) -> Iterator[str]:
    """How much of the slice walks, how folded boundaries are, and what changes the basin."""
    walks, boundary = numbers["fractions"]["walking period-1"], numbers["boundary"]
    interval = f"[{percents(walks['low'])}, {percents(walks['high'])}]"
    yield f"In that slice, {percents(walks['estimate'])} % {interval} of the starts walk"
    yield (
        f"of the walking basin has dimension {boundary['walking or not']['dimension']:.2f}; the "
        f"boundary between all labels has dimension {boundary['all labels']['dimension']:.2f}"
    )
    for name, said in (("c", "falls with damping"), ("K", "grows with stiffness")):
        (first, *_), *_, (last, *_) = numbers["along"][name]["walking"]
        yield f"{said} ({percents(first)} to {percents(last)} %"
    yield f"{min(row['distance'] for row in numbers['pushes']):.4f} (units of"
    yield f"rays alone finds {numbers['pushes'][0]['distance']:.4f}"


def of_basin_simplest(numbers: dict[str, Any]) -> Iterator[str]:
    """How thin the simplest walker's basin is."""
    shares = {slope: found["fractions"][-1] for slope, found in numbers["slopes"].items()}
    (low, first), (high, second) = shares.items()
    yield (
        f"{100.0 * first['estimate']:.2f} % of a square at a slope of {low} and "
        f"{100.0 * second['estimate']:.2f} % at {high}"
    )


def of_gradient_accuracy(numbers: dict[str, Any]) -> Iterator[str]:
    """The unit multiplier's error against tolerance, and CPU time over the number of parameters."""
    points = numbers["points"]["exact laws"]
    for plain, both in zip(points["plain"], points["both"], strict=True):
        pairs = ((each["steps"], each["unit_multiplier"]) for each in (plain, both))
        yield row(small(plain["rtol"], 0), *itertools.chain(*pairs))
    costs = ("return_ms", "return_with_columns_ms", "radius_by_adjoint_ms")
    for each in numbers["costs"]["rows"]:
        slow = fixed(each, 0, "radius_by_differences_ms")
        yield row(each["parameters"], *fixed(each, 1, *costs), *slow)


def of_gradient_truth(numbers: dict[str, Any]) -> Iterator[str]:
    """Errors of state and gradient of each way and setting, and what it says: ball, footstep."""
    answered = [each for each in numbers["rows"] if each["outcome"] == "answered"]
    for each in answered:
        yield row(each["problem"], each["way"], _setting(each), *_answer(each))
    damped = [each for each in answered if each["problem"] == "spring and damper"]
    ours, tsit5, warp = (
        next(each for each in damped if (each["way"], each["value"]) == way)
        for way in (("jaxbiped", 1e-6), ("diffrax Tsit5", 1e-6), ("Warp", 1e-5))
    )
    yield f"is {small(ours['gradient_error'])}, and its error bar is {small(ours['said'])}"
    others = small(tsit5["gradient_error"]), small(warp["gradient_error"])
    yield "{} with diffrax's Tsit5 and {} with Warp".format(*others)
    walked = numbers["footstep"]
    for each in walked["rows"]:
        known = each.get("outcome", "answered") == "answered"
        cells = _answer(each) if known else (UNKNOWN, each["outcome"], UNKNOWN, UNKNOWN)
        yield row(each["way"], _setting(each), *cells)
    yield f"changes by {small(walked['problem']['coarser_collocation'])}"
    yield f"differs from our finest solve by {small(walked['problem']['our_finest'])}"


def of_reproducibility(numbers: dict[str, Any]) -> Iterator[str]:
    """How walks, labels and the gait differ by widths, batches, threads and engines."""
    yield f"of {numbers['walks']} walks"
    for each in numbers["rows"]:
        told = ("name", "same_bits", "median", "largest", "endings", "labels", "gait")
        yield row(*(each[name] for name in told))


def of_long_walks(numbers: dict[str, Any]) -> Iterator[str]:
    """How a long walk keeps to its gait."""
    period, spread = numbers["period_s"], numbers["window_std_s"]
    yield f"after {numbers['footsteps']:,} footsteps"
    yield f"differs from the period by {small(abs(numbers['mean_s'] / period - 1.0))} of it"
    yield f"the largest deviation is {small(numbers['largest_deviation_s'] / period)}"
    yield f"from {small(spread[0] / period)} in the first tenth to {small(spread[-1] / period)}"
    low, high = numbers["peak_MiB"]
    yield f"{low:.0f} MiB after a tenth and {high:.0f} MiB at the end"


def of_accuracy_coverage(numbers: dict[str, Any]) -> Iterator[str]:
    """How many true errors lie within their bars."""
    walks, gaits, rigid = (numbers[name] for name in ("walks", "gaits", "rigid"))
    yield (
        f"{walks['met']} of {walks['run']} walks, {rigid['met']} of {rigid['run']} rigid ones and "
        f"{gaits['met']} of {gaits['run']} gaits"
    )
    for name, found in numbers["coverage"].items():
        # Zeros have no relative error.
        ratio = "–" if name == "multipliers of zero" else f"{found['median_ratio']:.1f}"
        counts = ("numbers", "resolved", "covered", "scenes", "scenes_all_covered")
        yield row(name, *(found[each] for each in counts), ratio)


def of_label_accuracy(numbers: dict[str, Any]) -> Iterator[str]:
    """How many labels change with the tolerance, what is known of those, and of fractions."""
    named, starts = numbers["named"], numbers["starts"]
    changed = {each["way"]: each for each in named["rows"]}
    yield f"Of {starts:,} starts"
    for name in ("draft", "balanced", "tight"):
        each = changed[name]
        counts = each["changed"], each["walking_changed"], round(each["attempted"])
        yield row(f"`{name}`", *counts)
    yield f"{named['between']['draft and tight']} labels differ between draft and tight"
    yield f"the two references differ in {named['references_differ']}"
    for model, found in numbers["by_number"].items():
        for each in found:
            yield row(
                model, f"{each['wanted']:g}", each["relabelled"], each["changed"], each["in_doubt"],
                f"{each['wrong_before']} → {each['truly_wrong']}", each["wrong_share"],
                each["estimated_share"], f"{each['within_interval']} of {each['draws']}",
                f"{each['met']} of {each['draws']}", *fixed(each, 1, "steps_ratio"),
            )  # fmt: skip
    fractions = numbers["fractions"]
    yield f"In {fractions['draws']:,} draws of {fractions['starts']} starts"

    def ends(method: str, measure: str, *names: str) -> tuple[float, float]:
        labels = (each for name in names for each in fractions[name][method].values())
        found = [each[measure] for each in labels if each["fraction"] > RARE]
        return min(found), max(found)

    for name in ("rigid", "compliant"):
        low, high = ends("uniform", "inside_95", name)
        yield f"{percents(low)} to {percents(high)} % for the {name} seed"
    both = "rigid", "compliant"
    low, high = ends("sobol", "scatter", *both)
    yield f"only {low:.1f} to {high:.1f} times as much"
    yield f"in {percents(ends('sobol', 'inside_95', *both)[0])} to 100.0 % of the draws"


def of_trade(numbers: dict[str, Any]) -> Iterator[str]:
    """Floors, errors of the named accuracies, and what ways cost at equal errors."""
    floors, counts = numbers["floors"], numbers["counts"]
    yield f"{counts['rows']} rows, {counts['failed']} of them failures"
    for group, axis in (
        ("walk", "state"), ("walk", "step_time"), ("walk", "energy"), ("slopes", "slopes"),
        ("gait", "period"), ("gait", "multiplier"), ("gait", "gradient"),
    ):  # fmt: skip
        yield row(UNKNOWN, floors[group][axis], *_named(numbers, group, axis))
    for group, axis in (
        ("walk", "state"), ("batch", "state"), ("slopes", "slopes"), ("gait", "multiplier"),
        ("gait", "gradient"),
    ):  # fmt: skip
        table = numbers["at_equal_error"][group][axis]
        for way, steps in table["steps"].items():
            times = table.get("cpu_s", {}).get(way, [UNKNOWN] * len(steps))
            if any(each is not None for each in times):
                yield row(way, *(_milliseconds(times[k]) for k in _COMPARED))
    for found in numbers["rows"]["basin"]:
        tolerance = f"{float(found['setting'].removeprefix('rtol=')):.0e}".replace("e-0", "e-")
        wrong = (found["errors"].get(name) for name in ("labels", "walking"))
        yield row(found["way"], tolerance, *wrong, _milliseconds(found["cpu_s"]))
    for found in numbers["rows"].get("stepping", ()):
        if found["setting"] == "rtol=1e-06":
            errors = (found["errors"][axis] for axis in ("period", "gradient"))
            yield row(found["way"], found["attempted"], *errors)
    laws = {"the seed's laws": "walk"} | {k: k for k in ("smoothed laws", "v0 ten times wider")}
    for name, group in laws.items():
        ours = (each for each in numbers["rows"][group] if each["way"] == "rodas4p (lanes)")
        (found,) = (each for each in ours if each["setting"] == "rtol=1e-06")
        yield row(name, found["attempted"], found["errors"]["state"])


def of_extremes(numbers: dict[str, Any]) -> Iterator[str]:
    """How cases, gaits and derivatives about a graze came out."""
    verdicts = ("run", "accurate", "flagged", "refused", "silently_wrong", "unresolved")
    gaits = numbers["gaits"]
    for name, found in (("walks", numbers), ("gaits", gaits)):
        yield row(name, *(found[each] for each in verdicts))
    yield f"{numbers['run']} of the {numbers['catalogue']} cases"
    yield f"{numbers['precise']} cases by a solve at 40 digits"
    errors = numbers["errors"]
    yield f"{errors['within_told']} of {errors['told']} lie within"
    yield f"at most {errors['most_beyond_told']:.1f} times"
    for name, median in gaits["median_error"].items():
        yield f"{name} {small(median)} (at most {small(gaits['largest_error'][name])})"
    for swept in numbers["grazing"]:
        counted = ("derivatives", *verdicts[1:3], "silently_wrong", "largest_accurate")
        yield row(swept["law"], swept["accuracy"], *(swept[name] for name in counted))


_COMPARED = (1, 2, 3, 4, 5)
"""Which of the errors at which ways are compared are quoted: 1e-3 to 1e-7."""


def _setting(found: dict[str, Any]) -> str:
    return f"{found['setting']} = {small(found['value'], 0)}"


def _answer(found: dict[str, Any]) -> tuple[Any, ...]:
    """Errors of state and gradient, CPU time [ms] where it was measured, and what is said."""
    spent = (_milliseconds(found["cpu_s"]),) if "cpu_s" in found else ()
    said = "nothing" if found["said"] is None else found["said"]
    return found["state_error"], found["gradient_error"], *spent, said


def of_gpu_speed(numbers: dict[str, Any]) -> Iterator[str]:
    """Of docs/gpu.md; what lanes were not asked is a dash."""
    for each in numbers["walks"]:
        rates = (each.get(f"{engine}_steps_per_s") for engine in ("cuda", "lanes"))
        yield row(f"{each['size']:,}", *rates)
    for each in numbers["labels"]:
        rates = (each.get(f"{engine}_starts_per_s") for engine in ("cuda", "lanes"))
        told = (rate and f"{round(rate, -2):,.0f}" for rate in rates)
        yield row(f"{each['size']:,}", *told, each.get("labels_that_differ"))
    yield f"{small(numbers['peak_flops'])} operations per second"
    yield f"take {100.0 * numbers['share_of_peak']:.0f} % of that"


def _milliseconds(seconds: float | str | None) -> str | None:
    if isinstance(seconds, str | None):
        return seconds
    return f"{1e3 * seconds:.{0 if seconds >= 1e-2 else 1}f}"


def _named(numbers: dict[str, Any], group: str, axis: str) -> list[float]:
    """Errors by the named accuracies, or by three tolerances where there are none."""
    rows = numbers["rows"].get(f"named {group}")
    if rows is None:
        settings = ("rtol=1e-05", "rtol=1e-06", "rtol=1e-08")
        ours = [each for each in numbers["rows"][group] if each["way"] == "rodas4p (lanes)"]
        rows = [each for name in settings for each in ours if each["setting"] == name]
    return [each["errors"][axis] for each in rows]
