"""Actuators alone against splines of SciPy; torques are in `tests/dynamics/test_actuation.py`."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import BSpline

import jaxbiped as jb

A = jb.actuation
SEED = jb.seed_scene()
SPRING = A.HipSpring(k=0.3, b=0.02, theta_0=0.2)
SPLINE = A.HipSpline(torque=[0.1, -0.2, 0.3, 0.05], first=-0.3, last=0.15)
AT_HIP = [
    A.HipSpring(k=0.3, b=0.02),
    SPRING,
    A.HipTorque(0.1),
    A.HipTorque(0.1, reaction="trunk"),
    A.HipPulse(0.2, phase=0.05, width=0.1),
    SPLINE,
]
ALL = [*AT_HIP, A.PushOff(0.1), A.FootPreload(extension=2e-3)]
MOTION = A.HipMotion((-0.2, 0.1), (1.3, -1.1), (0.25, 0.7))


def _name(part):
    return type(part).__name__


def _scene(part):
    if isinstance(part, A.PushOff):
        return jb.RigidScene(SEED.walker, SEED.ground, part)
    return dataclasses.replace(SEED, actuation=part)


def test_passive_scenes_have_the_parameters_that_they_had():
    names = "K c xi m J l d r hip_mass slope g n mu_static mu_kinetic v0".split()  # noqa: SIM905
    assert list(jb.parameter_names(SEED)) == names
    rigid = jb.RigidScene(SEED.walker, SEED.ground)
    assert list(jb.parameter_names(rigid)) == "m J l d r hip_mass slope g".split()  # noqa: SIM905
    for scene in (SEED, rigid, dataclasses.replace(SEED, actuation=())):
        assert scene.actuation is None
    assert len(jax.tree_util.tree_leaves(rigid)) == 8


@pytest.mark.parametrize("part", ALL, ids=_name)
def test_an_actuators_numbers_are_parameters_of_its_scene(part):
    scene = _scene(part)
    passive = jb.parameter_names(dataclasses.replace(scene, actuation=None))
    own = [name for name in jb.parameter_names(scene) if name not in passive]
    assert len(own) == len(jax.tree_util.tree_leaves(part))
    for name in own:
        quantity = jb.parameter_quantities(scene)[name]
        assert quantity.words
        assert quantity.unit
        changed = jb.with_parameters(scene, {name: 0.12})
        assert float(jb.parameter_values(changed)[name]) == 0.12
        assert jax.tree_util.tree_structure(changed) == jax.tree_util.tree_structure(scene)
    assert A.ACTUATORS[part.name] is type(part)


def test_coefficients_of_a_spline_have_names_of_their_own():
    scene = _scene((SPLINE, SPRING))
    assert jb.parameter_names(scene)[-9:] == (
        "torque_1", "torque_2", "torque_3", "torque_4", "first", "last", "k", "b", "theta_0",
    )  # fmt: skip
    words = [jb.parameter_quantities(scene)[f"torque_{i}"].words for i in (1, 2)]
    assert words == ["hip torque 1", "hip torque 2"]
    changed = jb.with_parameters(scene, {"torque_2": 0.7, "k": 1.0})
    assert [float(each) for each in changed.actuation[0].torque] == [0.1, 0.7, 0.3, 0.05]
    assert float(changed.actuation[1].k) == 1.0


def test_two_of_one_kind_are_told_by_their_places():
    scene = _scene((A.HipTorque(0.1), A.HipTorque(0.2, reaction="trunk")))
    assert jb.parameter_names(scene)[-2:] == ("actuation_1.torque", "actuation_2.torque")
    changed = jb.with_parameters(scene, {"actuation_2.torque": 0.5})
    assert [float(part.torque) for part in changed.actuation] == [0.1, 0.5]


def test_a_spline_is_scipys():
    knots = -0.3 + 0.15 * np.arange(-2, 6)
    splines = [BSpline.basis_element(knots[i : i + 5], extrapolate=False) for i in range(4)]

    def reference(phase):
        values = [np.nan_to_num(spline(phase)) for spline in splines]
        return float(np.dot([0.1, -0.2, 0.3, 0.05], values))

    for phase in np.linspace(-0.59, 0.44, 23):
        assert float(SPLINE.torque_at(jnp.asarray(phase))) == pytest.approx(
            reference(phase), abs=1e-14
        )
    for outside in (-0.61, 0.46):
        assert abs(float(SPLINE.torque_at(jnp.asarray(outside)))) < 1e-13


@pytest.mark.parametrize("part", AT_HIP, ids=_name)
def test_the_legs_may_be_exchanged(part):
    swapped = A.HipMotion(*[pair[::-1] for pair in MOTION])
    np.testing.assert_allclose(part.torques(swapped), part.torques(MOTION)[::-1], rtol=1e-14)


@pytest.mark.parametrize("part", AT_HIP, ids=_name)
def test_idle_actuators_do_nothing(part):
    assert jax.tree_util.tree_structure(part.idle()) == jax.tree_util.tree_structure(part)
    np.testing.assert_array_equal(np.abs(part.idle().torques(MOTION)), [0.0, 0.0])


def test_idle_feet_do_nothing():
    assert float(A.PushOff(0.3).idle().impulse) == 0.0
    idle = A.FootPreload(extension=2e-3).idle()
    assert [float(x) for x in idle.set_point(jnp.asarray(-0.1), jnp.asarray(-1.0))] == [0.0, 0.0]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: A.HipSpring(k=-1.0), "k = -1"),
        (lambda: A.HipPulse(0.1, width=0.0), "width = 0"),
        (lambda: A.HipTorque(0.1, reaction="hand"), "reaction = 'hand'"),
        (lambda: A.HipSpline(torque=0.1), "torque has length 1"),
        (lambda: A.HipSpline(torque=[0.1, 0.2], first=0.3), "last = 0.2"),
        (lambda: A.PushOff(-0.1), "impulse = -0.1"),
        (lambda: A.FootPreload(extension=1e-3, span=0.0), "span = 0"),
        (lambda: _scene(3.0), "actuation = 3.0"),
        (lambda: _scene((SPRING, "motor")), "actuation = 'motor'"),
        (lambda: dataclasses.replace(SEED, actuation=A.PushOff(0.1)), "PushOff.*needs rigid"),
        (
            lambda: jb.RigidScene(SEED.walker, SEED.ground, A.FootPreload(1e-3)),
            "FootPreload.*needs compliant",
        ),
    ],
)
def test_refusals_are_one_sentence(make, message):
    with pytest.raises(jb.ArgumentError, match=message) as refused:
        make()
    assert str(refused.value).count("\n") == 0


def test_a_preload_rises_by_default_at_a_tenth_of_a_radian_within_a_twentieth():
    preload = A.FootPreload(extension=2e-3)
    for angle, share in ((-0.1, 0.0), (-0.15, np.tanh(1.0)), (-0.05, -np.tanh(1.0))):
        extension, rate = preload.set_point(angle, -1.0)
        assert float(extension) == pytest.approx(1e-3 * (1.0 + share), rel=1e-12)
        assert float(rate) == pytest.approx(1e-3 * (1.0 - share**2) / 0.05, rel=1e-12)
