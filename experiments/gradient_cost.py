"""What gradients cost over the number of parameters: columns forwards, an adjoint, differences.

The seed's walker with a torque at the hip, a spline over phase whose coefficients are parameters.
CPU time of one return alone and with a column for each of them, from which the gradient of speed
comes; and of the gradient of the spectral radius, by the adjoint of the second variation beside
what central differences would take.
"""

import dataclasses
import time

import numpy as np
from _experiment import Options, experiment
from _scenes import rigid_seed
from _timing import seconds_of
from tqdm import tqdm

import jaxbiped as jb

COUNTS, QUICK_COUNTS = (16, 32, 64), (4,)
REPEATS = 15
PRECISION = {"rtol": 3e-7, "tangent_rtol": 3e-6}
"""That of a gait by the balanced accuracy."""


@experiment
def main(options: Options):
    # A rigid walker compiles soonest.
    scene = options.sized(jb.seed_scene(), rigid_seed())
    return {"rows": [costs(scene, n) for n in tqdm(options.sized(COUNTS, QUICK_COUNTS))]}


def costs(scene, count):
    """Of a scene whose hip has a torque of so many coefficients [ms]."""
    spline = jb.actuation.HipSpline(tuple(1e-3 * np.ones(count)))
    scene = dataclasses.replace(scene, actuation=(spline,))
    names = tuple(f"torque_{k + 1}" for k in range(count))
    how = dict(engine="lanes")
    gait = jb.find_gait(scene, parameters=(), radius_sensitivities=False, **how)
    state = gait.measures.state

    def one_return(parameters):
        how_ = dict(parameters=parameters, **how, **PRECISION)
        return lambda: jb.gait.linearise_return_map(scene, state, **how_).period_row

    def found(radius):
        how_ = dict(parameters=names, radius_sensitivities=radius, **how)
        return lambda: jb.find_gait(scene, state, **how_).sensitivities

    work = [one_return(()), one_return(names), found(True), found(False)]
    alone, with_columns, radius, without = (
        1e3 * seconds_of({0: run}, REPEATS, clock=time.process_time)[0] for run in work
    )
    return {
        "parameters": count,
        "return_ms": alone,
        "return_with_columns_ms": with_columns,
        "radius_by_adjoint_ms": radius - without,
        "radius_by_differences_ms": 2.0 * count * alone,
    }


if __name__ == "__main__":
    main()
