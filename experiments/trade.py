"""Work and precision: what each way of solving costs for the error that it has.

Writes trade.png: errors of state, step times, energies, gaits, multipliers and gradients against
CPU time and steps. Rows lie in trade.jsonl as they come: a run that was cut off goes on. Ways that
fail stay, in a band of their own.
"""

import _trade_walks
from _options import Options, parse
from _trade_store import Store
from tqdm import tqdm


def main() -> None:
    options = parse(__doc__ or "")
    options.out.mkdir(parents=True, exist_ok=True)
    store = Store(options.path("trade_quick.jsonl" if options.quick else "trade.jsonl"))
    groups = [_trade_walks]
    cases = [case for group in groups for case in group.cases(store, options.quick)]
    for case in tqdm([case for case in cases if not store.measured(case)], unit="cases"):
        row = store.measure(case)
        tqdm.write(f"{case.group}: {case.way}, {case.setting}: {row['outcome']} {row['errors']} {row['cpu_s']}")


if __name__ == "__main__":
    main()
