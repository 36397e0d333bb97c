"""Truth of gradients by every simulator that is installed: a bouncing ball and a footstep.

Runs gradient_truth.py and footstep_truth.py, writes the numbers of each beside their pictures, and
prints one table: error of the state and of the gradient, CPU time, and what each tool says.
"""

import footstep_truth
import gradient_truth
from _options import parse
from _truth_table import say_rows, versions

from jaxbiped.cli import Report


def main() -> None:
    options = parse(__doc__ or "")
    found = {
        "gradient_truth": gradient_truth.measured(options),
        "footstep_truth": footstep_truth.measured(options),
    }
    for name, numbers in found.items():
        Report(options.path(f"{name}.json")).finish(numbers)
    rows = [row for numbers in found.values() for row in numbers["rows"]]
    installed = versions()
    options.say("\nversions: " + ", ".join(f"{name} {each}" for name, each in installed.items()))
    say_rows(options, rows)
    pictures = [numbers["picture"] for numbers in found.values()]
    options.finish({"versions": installed, "rows": rows, "pictures": pictures})


if __name__ == "__main__":
    main()
