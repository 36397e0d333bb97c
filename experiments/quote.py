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

import _quotes_of_accuracy as accuracy
import _quotes_of_gaits as gaits
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


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of keeping and quoting."""

    keep: Path | None = None
    """Numbers of a run; they are kept under the file's name."""
    untimed: bool = False
    """Leave timings out."""


_LINE = re.compile(r"\[[^][{}]*\]|\{(?:[^][{}]|\{[^][{}]*\})*\}")
"""What is written on one line: numbers, and rows of them."""


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
    how = dict(method=Image.Quantize.MAXCOVERAGE, kmeans=1, dither=Image.Dither.NONE)
    few = drawn.quantize(COLOURS, **how)
    GALLERY.mkdir(exist_ok=True)
    few.save(GALLERY / f"{'-'.join(filter(None, (experiment, own)))}.png", optimize=True)


def keep(path: Path, *, untimed: bool) -> Path:
    """Writes a run's numbers into the folder of results, a list of numbers on one line."""
    run = json.loads(path.read_text())
    numbers = without(run, PICTURES | (TIMINGS if untimed else set()))
    numbers["made"] = {"date": datetime.date.today().isoformat(), "machine": machine()}
    text = json.dumps(numbers, indent=1, ensure_ascii=False)
    text = _LINE.sub(lambda found: " ".join(found[0].split()), text)
    RESULTS.mkdir(exist_ok=True)
    kept = RESULTS / path.name
    kept.write_text(text + "\n")
    return kept


QUOTES: dict[str, Callable[[dict[str, Any]], Iterator[str]]] = {
    name.removeprefix("of_"): function
    for name, function in (vars(accuracy) | vars(gaits)).items()
    if name.startswith("of_")
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
