"""What gradients cost over the number of parameters: columns forwards, an adjoint, differences.

The seed's walker with a torque at the hip, a spline over phase whose coefficients are parameters.
CPU time of one return alone and with a column for each of them, from which the gradient of speed
comes; and of the gradient of the spectral radius, by the adjoint of the second variation beside
what central differences would take.
"""

import dataclasses
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from _options import parse
from _timing import seconds_of
from tqdm import tqdm

import jaxbiped as jb

COUNTS, QUICK_COUNTS = (16, 32, 64), (4,)
REPEATS = 15
PRECISION = {"rtol": 3e-7, "tangent_rtol": 3e-6}
"""That of a gait by the balanced accuracy."""


def driven(count: int, quick: bool) -> Any:
    """A scene whose hip has a torque of so many coefficients; a rigid one compiles soonest."""
    scene = jb.ladder()["rigid"] if quick else jb.seed_scene()
    torque = tuple(1e-3 * np.ones(count))
    return dataclasses.replace(scene, actuation=(jb.actuation.HipSpline(torque),))


def cpu_ms(run: Callable[[], Any]) -> float:
    """Median CPU time of all threads, compiled before [ms]."""
    return 1e3 * seconds_of({0: run}, REPEATS, clock=time.process_time)[0]


def costs(count: int, quick: bool) -> dict[str, float]:
    """Of a scene with so many coefficients."""
    scene = driven(count, quick)
    names = tuple(f"torque_{k + 1}" for k in range(count))
    gait = jb.find_gait(scene, parameters=(), radius_sensitivities=False, engine="lanes")
    state = gait.measures.state

    def one_return(parameters: tuple[str, ...]) -> Any:
        return jb.gait.linearise_return_map(
            scene, state, parameters=parameters, engine="lanes", **PRECISION
        ).period_row

    def found(radius: bool) -> Any:
        return jb.find_gait(
            scene, state, parameters=names, radius_sensitivities=radius, engine="lanes"
        ).sensitivities

    alone = cpu_ms(lambda: one_return(()))
    with_columns = cpu_ms(lambda: one_return(names))
    return {
        "parameters": count,
        "return_ms": alone,
        "return_with_columns_ms": with_columns,
        "radius_by_adjoint_ms": cpu_ms(lambda: found(True)) - cpu_ms(lambda: found(False)),
        "radius_by_differences_ms": 2.0 * count * alone,
    }


def main() -> None:
    options = parse(__doc__ or "")
    rows = [costs(n, options.quick) for n in tqdm(QUICK_COUNTS if options.quick else COUNTS)]
    options.table(rows, parameters="d", **dict.fromkeys(list(rows[0])[1:], ".1f"))
    options.finish({"rows": rows})


if __name__ == "__main__":
    main()
