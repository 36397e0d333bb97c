"""Truth of gradients by every simulator that is installed: a bouncing ball and a footstep.

Runs gradient_truth.py and footstep_truth.py, writes the numbers of each beside their pictures, and
prints one table: error of the state and of the gradient, CPU time, and what each tool says.
"""

import footstep_truth
import gradient_truth
from _experiment import Options, experiment
from _gradient_ways import versions

from jaxbiped.cli import Report


@experiment
def main(options: Options):
    found = {
        "gradient_truth": gradient_truth.measured(options),
        "footstep_truth": footstep_truth.measured(options),
    }
    for name, numbers in found.items():
        Report(options.path(f"{name}.json")).finish(numbers)
    rows = [row for numbers in found.values() for row in numbers["rows"]]
    pictures = [numbers["picture"] for numbers in found.values()]
    return {"versions": versions(), "rows": rows, "pictures": pictures}


if __name__ == "__main__":
    main()
