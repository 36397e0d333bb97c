"""Coverage of basin fractions: how often their intervals hold the fraction of all draws together.

Starts are drawn over slices of the seed's walker, compliant and on rigid feet, again and again:
independently, for which the intervals are made, and by sequences that spread more evenly. Draws lie
in fraction_coverage.jsonl as they come: a run that was cut off goes on.
"""

import collections
import functools

import numpy as np
from _batches import labelled, starts_of
from _experiment import Options, experiment
from _row_store import RowStore
from _scenes import rigid_seed
from tqdm import tqdm

import jaxbiped as jb

SCENES = {"rigid": rigid_seed(), "compliant": jb.seed_scene()}
METHODS = ("uniform", "sobol")
STARTS = 300
DRAWS, QUICK_DRAWS = 1000, 5


@experiment
def main(options: Options):
    store = options.path(f"fraction_coverage{'_quick' if options.quick else ''}.jsonl")
    rows, draws = RowStore(store, starts=STARTS), options.sized(DRAWS, QUICK_DRAWS)
    return {
        "starts": STARTS,
        "draws": draws,
        **{
            name: {method: coverage(rows, name, method, draws) for method in METHODS}
            for name in SCENES
        },
    }


def coverage(rows, name, method, draws):
    """By label: its fraction in all draws, and in how many draws its interval holds that.

    `scatter`: of the fractions, as a share of what independent starts have.
    """

    def counts(seed):
        starts = starts_of(SCENES[name], STARTS, method=method, seed=seed)
        found = jb.basins.fractions(labelled(name, starts, look=False)["label"].values)
        return {label: fraction.count for label, fraction in found.items()}

    each = tqdm(range(draws), unit="draws", desc=f"{name} {method}")
    counted = [rows.row(f"{name} {method} {k}", functools.partial(counts, k)) for k in each]
    told = {}
    for label, total in sum(map(collections.Counter, counted), collections.Counter()).items():
        truth = total / (draws * STARTS)
        own = np.array([one.get(label, 0) for one in counted])
        low, high = jb.basins.wilson_interval(own, STARTS)
        binomial = np.sqrt(truth * (1.0 - truth) / STARTS)
        told[label] = {
            "fraction": truth,
            "inside_95": float(np.mean((low <= truth) & (truth <= high))),
            "scatter": float(np.std(own / STARTS) / binomial),
        }
    return told


if __name__ == "__main__":
    main()
