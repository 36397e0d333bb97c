"""Each option of each door that takes it, against a sentence that begins with its name."""

import functools
import inspect

import numpy as np
import pytest

import jaxbiped as jb

SCENE, START = jb.seed_scene(), jb.seed_state()
RIGID, ROLLING = jb.ladder()["rigid"], jb.dynamics.rigid_state(START)
STARTS = jb.starts.sample(RIGID, {"omega_swing": (-1.0, 1.0)}, 2)
PERIOD = jb.identify.MeasuredGait({"period": (0.44, 1e-4)})


@functools.cache
def _labelling():
    """Made by a test, because all workers import this file."""
    return jb.labelling(RIGID)


DOORS = {
    "simulate": (jb.simulate, (SCENE, START), dict(duration=0.1)),
    "rigid_walk": (jb.rigid_walk, (RIGID, ROLLING), dict(footsteps=1)),
    "find_gait": (jb.find_gait, (RIGID,), {}),
    "return_map": (jb.return_map, (RIGID, ROLLING), {}),
    "gait_measures": (jb.gait_measures, (RIGID,), {}),
    "labelling": (jb.labelling, (RIGID,), {}),
    "sweep": (jb.sweep, lambda: (_labelling(), STARTS), {}),
    "gait_sweep": (jb.gait_sweep, (RIGID, {"slope": [0.01, 0.02]}), {}),
    "continue_gait": (jb.continue_gait, (RIGID,), dict(bounds=(0.01, 0.02))),
    "fit_gait": (jb.fit_gait, (RIGID, ("J",), PERIOD), {}),
    "optimise_gait": (
        jb.optimise_gait,
        (RIGID,),
        dict(vary={"slope": (0.01, 0.03)}, maximise="speed", scatter={"J": 0.1}),
    ),
    "refine_boundary": (
        jb.basins.refine_boundary,
        (lambda x: np.zeros(len(x), int), (0.0, 0.0), (1.0, 1.0), (4, 4)),
        dict(levels=1),
    ),
    "minimal_fatal_shock": (
        jb.basins.minimal_fatal_shock,
        (lambda x: np.zeros(len(x), int), (0.0,)),
        dict(scales=(1.0,), max_distance=1.0, tolerance=0.1),
    ),
    "entropy": (jb.basins.entropy, (np.zeros((8, 8), int),), {}),
    "fractions": (jb.basins.fractions, (["a", "b"],), {}),
}
BAD = {
    "accuracy": ["exact", 0, -1e-9, None, ()],
    "engine": ["abacus", None, 3],
    "solver": ["abacus", 3],
    "criterion": ["worst of all", 3],
    "method": ["luck", None],
    "along": ["slpe", 3],
    "section": ["heel", 3],
    "gradient": ["forward", 3],
    "watch": ["fall", ("nothing",), 3],
    "save": ["nothing", 3],
    "footsteps": [0, -1, 1.5, "two"],
    "duration": [0.0, -1.0, np.nan, np.inf, "long"],
    "rtol": [0.0, -1e-9, np.nan, "fine"],
    "atol": [0.0, -1e-9, np.nan, "fine"],
    "dt": [0.0, -1e-3, np.nan, "short"],
    "max_time": [0.0, -1.0, np.nan, "long"],
    "max_solver_steps": [0, -1, 1.5, "many"],
    "max_evaluations": [0, -1, 1.5, "many"],
    "max_points": [0, -1, 1.5, "many"],
    "max_arrivals": [-1, 1.5, "many"],
    "largest_step": [0.0, -1.0, np.nan, "large"],
    "bounds": [(0.02,), (0.02, 0.02), (np.nan, 0.02), "all"],
    "parameters": [{"slpe": (0.01,)}, "slope"],
    "iterations": [0, -1, 1.5, "many"],
    "restarts": [-1, "many"],
    "members": [0, -1, 1.5, "many"],
    "workers": [0, -1, 1.5, "many"],
    "chunk": [0, -1, 1.5, "large"],
    "levels": [-1, 1.5, "many"],
    "batch": [0, -1, 1.5, "large"],
    "confidence": [0.0, 1.0, -0.5, np.nan, "sure"],
    "box": [0, -1, 1.5, "large"],
    "max_distance": [0.0, -1.0, np.nan, "far"],
    "tolerance": [0.0, -1.0, np.nan, "fine"],
    "directions": [0, -1, 1.5, "many"],
}
"""Values that are refused of each option, wherever it is taken."""
CASES = [
    (door, option, value)
    for door, (function, _, _) in DOORS.items()
    for option in inspect.signature(function).parameters.keys() & BAD.keys()
    for value in BAD[option]
]


@pytest.mark.parametrize(("door", "option"), sorted({case[:2] for case in CASES}))
def test_an_option_that_is_not_allowed_is_named(door, option):
    """Before anything is compiled: a program of either engine would take seconds."""
    function, given, options = DOORS[door]
    given = given() if callable(given) else given
    for value in BAD[option]:
        with pytest.raises(jb.ArgumentError, match=rf"^{option}\b"):
            function(*given, **options | {option: value})
