"""Every option of the doors, against what no option takes: one sentence that names it."""

import functools
import inspect

import jax
import jax.numpy as jnp
import pytest

import jaxbiped as jb

COMPLIANT, START = jb.seed_scene(), jb.seed_state()
RIGID, ROLLING = jb.ladder()["rigid"], jb.dynamics.rigid_state(START)
MANY = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), ROLLING)
PERIOD = jb.identify.MeasuredGait({"period": (0.44, 1e-4)})


@functools.cache
def _labelling():
    """Made by a test, because all workers import this file."""
    return jb.labelling(RIGID)


DOORS = {
    "simulate": (jb.simulate, (COMPLIANT, START), dict(duration=0.05)),
    "simulate, rigid": (jb.simulate, (RIGID, ROLLING), dict(footsteps=1)),
    "return_map": (jb.return_map, (COMPLIANT, START), {}),
    "find_gait": (jb.find_gait, (RIGID, ROLLING), {}),
    "find_gaits": (jb.find_gaits, (RIGID, MANY), {}),
    "gait_measures": (jb.gait_measures, (RIGID, ROLLING), {}),
    "continue_gait": (jb.continue_gait, (RIGID, "slope"), dict(bounds=(0.0199, 0.0201))),
    "gait_sweep": (jb.gait_sweep, (RIGID, {"slope": [0.02]}), {}),
    "labelling": (jb.labelling, (RIGID,), {}),
    "sweep": (
        jb.sweep, lambda: (_labelling(), jb.starts.grid(RIGID, {"omega_swing": [1.0]})), {},
    ),
    "optimise_gait": (
        jb.optimise_gait, (RIGID,), dict(vary={"d": (0.09, 0.11)}, maximise="speed"),
    ),
    "fit_gait": (jb.fit_gait, (RIGID, ("d",), PERIOD), {}),
}  # fmt: skip


OPTIONS = [
    (door, each.name)
    for door, (function, _, _) in DOORS.items()
    for each in inspect.signature(function).parameters.values()
    if "bool" not in str(each.annotation) and each.kind is not each.VAR_KEYWORD
]
"""But those that are asked whether they are true, which everything answers."""


@pytest.mark.parametrize(("door", "name"), OPTIONS)
def test_what_no_option_takes_is_one_sentence(door, name):
    function, given, named = DOORS[door]
    given = given() if callable(given) else given
    place = list(inspect.signature(function).parameters).index(name)
    for wrong in (object(), [object()]):
        arguments = list(given)
        arguments[place : place + 1] = [wrong] if place < len(given) else []
        keywords = named if place < len(given) else named | {name: wrong}
        with pytest.raises(jb.ArgumentError) as refused:
            function(*arguments, **keywords)
        assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "ask",
    [
        lambda other: jb.starts.coordinate_names(other),
        lambda other: jb.starts.grid(other, {"m": [1.0]}),
        lambda other: jb.starts.sample(other, {"m": (1.0, 2.0)}, 4),
        lambda other: jb.optimise.bifurcation_distance(other, other),
        lambda other: jb.continuation.resume_branch(other),
        lambda other: jb.continuation.doubling_cascade(other),
        lambda other: jb.measure.cost_of_transport(other, other),
        lambda other: jb.measure.operation_counts(other),
        lambda other: jb.dynamics.energies(other, START),
        lambda other: jb.dynamics.powers(other, START),
    ],
)
def test_a_walker_is_no_scene(ask):
    with pytest.raises(jb.ArgumentError, match=r"(scene|branch) .*(is|which is) not allowed"):
        ask(RIGID.walker)
