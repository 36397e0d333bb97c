"""Work and precision: what each way of solving costs for the error that it has.

Writes trade.png: errors of state, step times, energies, gaits, multipliers and gradients against
CPU time and steps. Rows lie in trade.jsonl as they come: a run that was cut off goes on. Ways that
fail stay, in a band of their own.
"""

import _trade_batches
import _trade_gaits
import _trade_slopes
import _trade_walks
from _options import Options, parse
from _trade_store import Store
from tqdm import tqdm

GROUPS = (
    _trade_walks.cases,
    _trade_batches.cases,
    _trade_slopes.cases,
    _trade_gaits.cases,
    _trade_gaits.stepping_cases,
)


def main() -> None:
    options = parse(__doc__ or "")
    options.out.mkdir(parents=True, exist_ok=True)
    store = Store(options.path("trade_quick.jsonl" if options.quick else "trade.jsonl"))
    cases = [case for group in GROUPS for case in group(store, options.quick)]
    for case in tqdm([case for case in cases if not store.measured(case)], unit="cases"):
        row = store.measure(case)
        tqdm.write(f"{case.group}: {case.way}, {case.setting}: {row['outcome']} {row['errors']} {row['cpu_s']}")


if __name__ == "__main__":
    main()
