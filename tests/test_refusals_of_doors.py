"""Refusals of doors to gaits, sweeps, branches, fits and scenes, against one sentence each."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.continuation import (
    Axis,
    BifurcationPoint,
    Branch,
    BranchEvent,
    BranchStop,
    bifurcation_curve,
    bifurcation_sensitivities,
    doubling_cascade,
    find_isolated,
    nearest_bifurcation,
    open_branch,
    resume_branch,
    switch_branch,
)
from jaxbiped.gait import BranchEnd
from jaxbiped.identify import MeasuredAngles, MeasuredGait
from tests.mechanisms import FEET, LAWS, LEGS, PAIR, TORSO, WALKERS

SEED, START = jb.seed_scene(), jb.seed_state()
RIGID, ROLLING = jb.ladder()["rigid"], jb.dynamics.rigid_state(START)
REDUNDANT = jb.RedundantScene(SEED)
GROUND = jb.Ground(slope=0.02)
PERIOD = MeasuredGait({"period": (0.44, 1e-4)})
BATCH = jb.with_parameters(RIGID, {"slope": jnp.array([0.01, 0.02])})
MANY = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), ROLLING)
UNLIKE = WALKERS["unequal"]
MASS_POINTS = jb.Mechanism(
    bodies=(*(jb.Body(f"leg_{i}", mass=1.0, inertia=0.0, centre=0.1) for i in (1, 2)), TORSO),
    feet=FEET,
    mirror=PAIR,
)
FIT = functools.partial(jb.fit_gait, RIGID)
BRANCH = functools.partial(jb.continue_gait, RIGID, "slope")
LABEL = functools.partial(jb.labelling, RIGID)
STOPS = (BranchStop(BranchEnd.REACHED, "the range ends", 0.01),) * 2
NONE = Branch(
    scene=RIGID, points=(), bifurcations=(), stops=STOPS, axis=Axis("slope", 0.01, 0.1, False,
    leaf=0), state_type=type(ROLLING), footsteps=1, accuracy="balanced", engine="auto",
)  # fmt: skip


def event(kind):
    point = jb.continuation.BranchPoint(*[0.02] * 12)
    return BifurcationPoint(kind, point, 1.0, 0.0)


DOUBLING, LIMIT = event(BranchEvent.PERIOD_DOUBLING), event(BranchEvent.LIMIT)
CURVE = functools.partial(bifurcation_curve, NONE, DOUBLING, "r", bounds=(0.06, 0.09))
FORWARD = functools.partial(jb.return_map, RIGID, ROLLING)
LINEARISED = functools.partial(
    jb.gait.linearise_return_map, RIGID, ROLLING, rtol=1e-6, tangent_rtol=1e-6
)


CASES = {
    # Gaits.
    "no scene": (lambda: jb.find_gait(3), "scene = 3"),
    "method": (lambda: jb.find_gait(RIGID, method="luck"), "method = 'luck'"),
    "accuracy": (lambda: jb.find_gait(RIGID, accuracy="best"), "accuracy = 'best'"),
    "several scenes": (lambda: jb.find_gait(BATCH), r"slope has the shape \(2,\): give one number"),
    "several guesses": (lambda: jb.find_gait(RIGID, MANY), "guess.hip_x .*give one state"),
    "evaluations": (lambda: jb.find_gait(RIGID, max_evaluations=0), "max_evaluations = 0"),
    "optimiser of an error": (
        lambda: jb.find_gait(RIGID, accuracy=1e-6, optimiser=3), "optimiser"
    ),
    "traced error": (
        lambda: jax.grad(lambda d: jb.find_gait(
            jb.with_parameters(RIGID, {"d": d}), accuracy=1e-6).measures.period)(0.1),
        "accuracy = 1e-06",
    ),
    "gaits of no scene": (lambda: jb.find_gaits(3, MANY), "scene = 3"),
    "gaits of redundant coordinates": (lambda: jb.find_gaits(REDUNDANT, MANY), "scene = "),
    "one start": (lambda: jb.find_gaits(RIGID, ROLLING), "starts has leaves of shapes"),
    "starts of shapes": (
        lambda: jb.find_gaits(RIGID, MANY._replace(hip_x=jnp.zeros(3))), "must all be"
    ),
    "no starts": (
        lambda: jb.find_gaits(RIGID, jax.tree.map(lambda x: x[:0], MANY)), "n at least 1"
    ),
    "gradient": (lambda: jb.gait_measures(RIGID, gradient=3), "gradient = 3"),
    "map's gradient": (lambda: FORWARD(gradient=3), "gradient = 3"),
    "map's implicit gradient": (
        lambda: FORWARD(gradient=jb.gait.Implicit()), "need not be periodic"
    ),
    "map's accuracy": (lambda: FORWARD(accuracy="best"), "accuracy = 'best'"),
    "map's state": (lambda: jb.return_map(RIGID, 3), "state = 3 is not allowed"),
    "map's scene": (lambda: jb.return_map(3, ROLLING), "scene = 3"),
    "map's solver": (lambda: FORWARD(solver="euler"), "solver = Euler"),
    "rtol": (lambda: LINEARISED(rtol=0.0), "^rtol = 0"),
    "tangent_rtol": (lambda: LINEARISED(tangent_rtol=-1.0), "tangent_rtol = -1"),
    "max_time": (lambda: LINEARISED(max_time=0.0), "max_time = 0"),
    "attempts": (lambda: LINEARISED(max_solver_steps=0), "max_solver_steps = 0"),
    "linearised redundantly": (
        lambda: jb.gait.linearise_return_map(REDUNDANT, START, rtol=1e-6, tangent_rtol=1e-6),
        "args = ",
    ),
    "rolling starts of no scene": (lambda: jb.gait.rolling_starts(REDUNDANT, 3), "scene = "),
    "half a stride": (
        lambda: jb.find_gait(jb.Scene(UNLIKE, GROUND, **LAWS), footsteps=3), "multiple of 2"
    ),
    # Branches.
    "along": (lambda: jb.continue_gait(RIGID, "slop", bounds=(0.0, 1.0)), "along = 'slop'"),
    "one bound": (lambda: BRANCH(bounds=(0.1,)), "give two numbers"),
    "NaN": (lambda: BRANCH(bounds=(0.1, np.nan)), r"bounds\[1\] = nan"),
    "one value": (lambda: BRANCH(bounds=(0.1, 0.1)), "the range is empty"),
    "factors from 0": (lambda: BRANCH(bounds=(0.0, 0.1), log=True), r"bounds\[0\] = 0"),
    "value of no scene": (lambda: jb.continue_gait(RIGID, "m", bounds=(-1.0, 0.1)), "m = -1"),
    "redundant branch": (
        lambda: jb.continue_gait(REDUNDANT, bounds=(0.01, 0.02)), "redundant coordinates"
    ),
    "branch of no scene": (lambda: jb.continue_gait(3, bounds=(0.01, 0.02)), "scene = 3"),
    "branch of several": (
        lambda: jb.continue_gait(BATCH, bounds=(0.01, 0.02)), r"slope has the shape \(2,\)"
    ),
    "branch's step": (
        lambda: jb.continue_gait(RIGID, bounds=(0.01, 0.02), largest_step=0), "largest_step = 0"
    ),
    "branch's points": (
        lambda: jb.continue_gait(RIGID, bounds=(0.01, 0.02), max_points=0), "max_points = 0"
    ),
    "branch's accuracy": (
        lambda: jb.continue_gait(RIGID, bounds=(0.01, 0.02), accuracy="x"), "accuracy = 'x'"
    ),
    "resumed nowhere": (lambda: resume_branch(3), "branch = 3"),
    "resumed at none": (lambda: resume_branch(NONE, 0), "the branch has 0 points"),
    "direction": (lambda: resume_branch(NONE, direction="up"), "direction = 'up'"),
    "resumed step": (lambda: resume_branch(NONE, largest_step=0), "largest_step = 0"),
    "resumed points": (lambda: resume_branch(NONE, max_points=0), "max_points = 0"),
    "opened for no scene": (lambda: open_branch(NONE.to_dataset(), 3), "scene = 3"),
    "opened for another scene": (
        lambda: open_branch(NONE.to_dataset(), jb.with_parameters(RIGID, {"r": 0.09})),
        "differs from the branch's own in",
    ),
    "switched nowhere": (lambda: switch_branch(3), "branch = 3"),
    "switched at none": (lambda: switch_branch(NONE), "must be a period doubling"),
    "switched at a limit": (lambda: switch_branch(NONE, LIMIT), "must be a period doubling"),
    "switched step": (lambda: switch_branch(NONE, largest_step=0), "largest_step = 0"),
    "switched points": (lambda: switch_branch(NONE, max_points=0), "max_points = 0"),
    "cascade of none": (lambda: doubling_cascade(NONE), "it has no period doubling"),
    "cascade nowhere": (lambda: doubling_cascade(3), "branch = 3"),
    "doublings": (lambda: doubling_cascade(NONE, 0), "doublings = 0"),
    "curve nowhere": (
        lambda: bifurcation_curve(3, DOUBLING, "r", bounds=(0.06, 0.09)), "branch = 3"
    ),
    "curve of none": (
        lambda: bifurcation_curve(NONE, 3, "r", bounds=(0.06, 0.09)), "bifurcation = 3"
    ),
    "curve of a limit": (
        lambda: bifurcation_curve(NONE, LIMIT, "r", bounds=(0.06, 0.09)), "limit at 0.02 is not a"
    ),
    "curve along itself": (
        lambda: bifurcation_curve(NONE, DOUBLING, "slope", bounds=(0.01, 0.1)), "itself follows it"
    ),
    "curve elsewhere": (lambda: CURVE(bounds=(0.01, 0.02)), "r = 0.08 is outside"),
    "curve's step": (lambda: CURVE(largest_step=0), "largest_step = 0"),
    "curve's points": (lambda: CURVE(max_points=0), "max_points = 0"),
    "curve's accuracy": (lambda: CURVE(accuracy="x"), "accuracy = 'x'"),
    "slopes nowhere": (lambda: bifurcation_sensitivities(3, DOUBLING), "branch = 3"),
    "slopes of none": (lambda: bifurcation_sensitivities(NONE, 3), "bifurcation = 3"),
    "slopes of a limit": (lambda: bifurcation_sensitivities(NONE, LIMIT), "has no derivative"),
    "slopes' accuracy": (
        lambda: bifurcation_sensitivities(NONE, DOUBLING, accuracy="x"), "accuracy = 'x'"
    ),
    "nearest of no scene": (lambda: nearest_bifurcation(REDUNDANT, None), "scene = "),
    "nearest along": (lambda: nearest_bifurcation(RIGID, None, "slop"), "along = 'slop'"),
    "nearest of none": (lambda: nearest_bifurcation(RIGID, None, "hip_mass"), "hip_mass is 0"),
    "nearest's factor": (lambda: nearest_bifurcation(RIGID, None, factor=1.0), "factor = 1"),
    "isolated of redundant": (lambda: find_isolated(REDUNDANT), "redundant coordinates"),
    "isolated starts": (lambda: find_isolated(RIGID, starts=0), "starts = 0"),
    "isolated accuracy": (lambda: find_isolated(RIGID, accuracy="x"), "accuracy = 'x'"),
    # Fits.
    "fit of no scene": (lambda: jb.fit_gait(REDUNDANT, ("J",), PERIOD), "scene = "),
    "nothing measured": (lambda: FIT(("J",), []), r"measured = \[\]"),
    "nothing varied": (lambda: FIT((), PERIOD), r"vary = \(\)"),
    "a word varied": (lambda: FIT("J", PERIOD), "vary = 'J'"),
    "unknown varied": (lambda: FIT(("Q",), PERIOD), "vary = 'Q'"),
    "zero varied": (lambda: FIT(("hip_mass",), PERIOD), "gives no scale"),
    "one bound varied": (lambda: FIT({"J": (1.0,)}, PERIOD), r"vary\['J'\] = \(1\.0,\)"),
    "bounds reversed": (lambda: FIT({"J": (1.0, 0.001)}, PERIOD), "the lower and the upper bound"),
    "equal bounds": (lambda: FIT({"J": (0.0096, 0.0096)}, PERIOD), "lower and the upper bound"),
    "infinite bound": (lambda: FIT({"J": (0.001, np.inf)}, PERIOD), r"vary\['J'\] = .*inf"),
    "bounds elsewhere": (lambda: FIT({"J": (1.0, 2.0)}, PERIOD), "where the fit begins"),
    "bounds below": (lambda: FIT({"J": (0.001, 0.002)}, PERIOD), "where the fit begins"),
    "bound of no scene": (lambda: FIT({"r": (-0.1, 0.1)}, PERIOD), "r = -0.1"),
    "known and varied": (
        lambda: FIT(("J",), MeasuredGait({"period": (0.44, 1e-4)}, {"J": 0.01})), "both known"
    ),
    "fit's accuracy": (lambda: FIT(("J",), PERIOD, accuracy="x"), "accuracy = 'x'"),
    "fit's evaluations": (lambda: FIT(("J",), PERIOD, max_evaluations=0), "max_evaluations = 0"),
    "fit of no angle": (
        lambda: FIT(("J",), MeasuredGait({}, angles=MeasuredAngles([0.1], 1e-4, theta_nose=[0.1]))),
        "an angle = 'theta_nose'",
    ),
    "half a cycle measured": (
        lambda: jb.fit_gait(
            jb.Scene(UNLIKE, GROUND, **LAWS), ("leg_2.mass",),
            MeasuredGait({"period": (0.44, 1e-4)}, footsteps=3),
        ), "multiple of 2",
    ),
    "conditions in words": (
        lambda: MeasuredGait({"period": (0.4, 1e-3)}, ["slope"]), "conditions = "
    ),
    "deviation": (lambda: MeasuredAngles([0.1], 0.0, [0.1]), "deviation = 0"),
    "endless angle": (lambda: MeasuredAngles([0.1], 1e-4, [np.inf]), "theta_1 = inf"),
    "degrees": (lambda: MeasuredAngles([0.1], 1e-4, [20.0]), "are these degrees"),
    "clock": (lambda: MeasuredAngles([0.1], 1e-4, [0.1], since="noon"), "since = 'noon'"),
    "measures' footsteps": (
        lambda: MeasuredGait({"period": (0.4, 1e-3)}, footsteps=0), "footsteps = 0"
    ),
    # Labels, starts and sweeps.
    "labelling of no scene": (lambda: jb.labelling(REDUNDANT), "scene = "),
    "labels' attempts": (lambda: LABEL(max_solver_steps=0), "max_solver_steps = 0"),
    "labels' footsteps": (lambda: LABEL(footsteps=0), "footsteps = 0"),
    "labels of several": (lambda: jb.labelling(BATCH), "parameters that are arrays"),
    "labels' rtol": (lambda: LABEL(rtol=0.0), "rtol = 0"),
    "labels' solver": (lambda: LABEL(solver="euler"), "takes rodas3p to rodas5p"),
    "label_of nothing": (lambda: jb.labels.label_at(3, ("omega_stance",)), "labelling = 3"),
    "failure of nothing": (lambda: jb.labels.nearest_failure(3), "labelling = 3"),
    "sweep of nothing": (lambda: jb.sweep(3, 3), "labelling = 3"),
    "sweep of gaits": (lambda: jb.gait_sweep(3, {"slope": [0.02]}), "scene = 3"),
    "workers": (lambda: jb.local_executor(0), "workers = 0"),
    "time-out": (lambda: jb.cluster_executor("tcp://127.0.0.1:1", timeout=0.0), "timeout = 0"),
    "coordinate": (lambda: jb.starts.grid(RIGID, {"omega_nose": [0.1]}), "coordinate = 'omega_no"),
    "coordinate twice": (
        lambda: jb.starts.grid(RIGID, {"omega_stance": [0.1], "omega_2": [0.1]}), "one coordinate"
    ),
    "no coordinates": (lambda: jb.starts.grid(RIGID, {}), "values = {} is empty"),
    "no bounds": (lambda: jb.starts.sample(RIGID, {}, 3), "bounds = {} is empty"),
    "sampled twice": (
        lambda: jb.starts.sample(RIGID, {"omega_stance": (0, 1), "omega_2": (0, 1)}, 3),
        "one coordinate",
    ),
    "seed": (lambda: jb.starts.sample(RIGID, {"omega_2": (0, 1)}, 3, seed=-1), "seed = -1"),
    "count": (lambda: jb.starts.sample(RIGID, {"omega_2": (0, 1)}, 0), "count = 0"),
    "empty axis": (lambda: jb.starts.grid(RIGID, {"omega_2": []}), "omega_2 has values of shape"),
    "parameter of no scene": (lambda: jb.starts.grid(RIGID, {"m": [1.0, -1.0]}), "m = "),
    "sampled of no scene": (lambda: jb.starts.sample(RIGID, {"m": (-1.0, 1.0)}, 3), "m = "),
    "several bases": (
        lambda: jb.starts.grid(RIGID, {"omega_2": [0.1]}, base=MANY), "give one state"
    ),
    "starts of numbers": (lambda: jb.starts.GivenStarts(3), "states = 3"),
    "sweep over words": (lambda: jb.gait_sweep(RIGID, ["slope"]), r"over = \['slope'\]"),
    # Basins.
    "confidence": (lambda: jb.basins.wilson_interval(1, 2, confidence=np.nan), "confidence = nan"),
    "total": (lambda: jb.basins.wilson_interval(0, -1), "total = -1"),
    "rays of NaN": (
        lambda: jb.basins.minimal_fatal_shock(
            lambda x: np.zeros(len(x), int), [0.0], scales=[1.0], max_distance=1.0,
            tolerance=1e-3, directions=[[np.nan]],
        ), "directions = ",
    ),
    "label": (
        lambda: jb.basins.fractions(np.array([0, 1, 1]))["running"], "label = 'running'"
    ),
    # Scenes.
    "ground": (lambda: jb.Scene(SEED.walker, 3, SEED.normal, SEED.friction), "ground = 3"),
    "rigid ground": (lambda: jb.RigidScene(SEED.walker, 3), "ground = 3"),
    "normal": (lambda: jb.Scene(SEED.walker, GROUND, 3, SEED.friction), "normal = 3"),
    "friction": (lambda: jb.Scene(SEED.walker, GROUND, SEED.normal, 3), "friction = 3"),
    "clearance": (
        lambda: jb.Scene(SEED.walker, GROUND, SEED.normal, SEED.friction, 3), "clearance = 3"
    ),
    "walker": (lambda: jb.RigidScene(3, GROUND), "walker = 3 is not allowed"),
    "redundant scene": (lambda: jb.RedundantScene(RIGID), "scene = "),
    "orientation": (lambda: jb.RedundantScene(SEED, orientation="up"), "orientation = 'up'"),
    "redundant mass point": (
        lambda: jb.RedundantScene(jb.Scene(MASS_POINTS, GROUND, **LAWS)), "has no inertia"
    ),
    "ladder of nothing": (lambda: jb.ladder(3), "scene = 3"),
    "motor's side": (
        lambda: jb.Motor("leg_1", jb.actuation.PD(kp=1.0), by="luck"), "by = 'luck'"
    ),
    "motor's law": (lambda: jb.Motor("leg_1", lambda: 0.0), "a function of the motion alone"),
    "stop's law": (lambda: jb.Stop("leg_1", upper=0.1, law=3), "law = 3"),
    "stop's hold": (lambda: jb.Stop("leg_1", upper=0.1, holds="never"), "holds = 'never'"),
    "part's name": (lambda: jb.Spring("leg_1", stiffness=1.0, name="a b"), "name = 'a b'"),
    "foot's leg": (lambda: jb.Foot("leg_1", centre=0.1, leg="a b"), "leg = 'a b'"),
    "bodies": (lambda: jb.Mechanism(bodies=LEGS[0], feet=FEET), "bodies = "),
    "turn": (lambda: jb.Mechanism(bodies=LEGS, feet=FEET, turn={}), "give one body and its count"),
    "mirror": (lambda: jb.Mechanism(bodies=LEGS, feet=FEET, mirror=("ab",)), "mirror has 'ab'"),
    "pairs": (
        lambda: jb.Mechanism(
            bodies=LEGS, feet=FEET, mirror=(("leg_1", "leg_2"), ("leg_2", "leg_1"))
        ), "stands in two pairs",
    ),
    "spline's end": (
        lambda: jb.actuation.HipSpline((1.0, 2.0), first=0.2, last=0.1), "last = 0.1"
    ),
    "spline's begin": (
        lambda: jb.actuation.HipSpline((1.0, 2.0), first=np.nan, last=0.1), "first = nan"
    ),
    "standing": (lambda: RIGID.state(standing=3), "standing = 3"),
    "shapes": (
        lambda: RIGID.state(omega_1=np.zeros(2), omega_2=np.zeros(3)), "broadcast to one shape"
    ),
    "stop held": (lambda: RIGID.state(held="knee"), "the walker has no stops"),
    "stops held": (lambda: RIGID.state(held=3), "give a stop's name, or several"),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_it_is_refused_in_one_sentence(name):
    call, words = CASES[name]
    with pytest.raises(jb.ArgumentError, match=words) as refused:
        call()
    assert "\n" not in str(refused.value)
