"""What functions of the user's read, after it changed, against functions that never read others."""

import dataclasses
import functools
import sys
import types

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.caching._user_code import users_code, versions_of
from tests.mechanisms import FEET, LEGS, PAIR, TORSO
from tests.systems import Plain

NORMAL = {"torso": 1, "normal": -1}
gain, table, settings = 1.0, np.ones(2), types.SimpleNamespace(gain=1.0)


def scene_of(law):
    """A torso on rigid feet, which a motor holds upright."""
    walker = jb.Mechanism(
        bodies=(*LEGS, TORSO),
        feet=FEET,
        joints=(jb.Motor({"torso": 1, "leg_2": -1}, law),),
        mirror=PAIR,
    )
    return jb.RigidScene(walker, jb.Ground(slope=0.03))


def rates(scene):
    start = scene.state(theta_leg_1=0.2, theta_leg_2=-0.2, omega_leg_2=-1.2, theta_torso=0.1)
    return np.array(jax.tree.leaves(jb.dynamics.rolling(scene, start)))


def proportional(k):
    return lambda motion: -k * motion.of(NORMAL)[0]


def helper(angle):
    return -gain * angle


class Controller:
    """Reads its own gain."""

    def __init__(self):
        self.gain, self.history = 1.0, []

    @property
    def factor(self):
        return self.gain

    def __call__(self, motion):
        return self.torque(motion)

    def torque(self, motion):
        return -self.factor * motion.of(NORMAL)[0]


class Slotted:
    """Has no dictionary."""

    __slots__ = ("gain",)


class Law(eqx.Module):
    """Its leaf is a parameter; the global is not."""

    k: float

    def __call__(self, motion):
        return -gain * self.k * motion.of(NORMAL)[0]


def by_global():
    def change(value):
        globals()["gain"] = value

    return lambda motion: -gain * motion.of(NORMAL)[0], change


def by_helper():
    def change(value):
        exec(f"def helper(angle):\n    return -{value} * angle", globals())

    return lambda motion: helper(motion.of(NORMAL)[0]), change


def by_attribute():
    return (
        lambda motion: -settings.gain * motion.of(NORMAL)[0],
        lambda value: setattr(settings, "gain", value),
    )


def by_array():
    return lambda motion: -table[0] * motion.of(NORMAL)[0], lambda value: table.fill(value)


def by_default():
    def law(motion, k=1.0):
        return -k * motion.of(NORMAL)[0]

    return law, lambda value: setattr(law, "__defaults__", (value,))


def by_cell():
    k = 1.0

    def change(value):
        nonlocal k
        k = value

    return lambda motion: -k * motion.of(NORMAL)[0], change


def by_partial():
    numbers = [1.0]
    law = functools.partial(lambda k, motion: -k[0] * motion.of(NORMAL)[0], numbers)
    return law, lambda value: numbers.__setitem__(0, value)


def by_object():
    controller = Controller()
    return controller, lambda value: setattr(controller, "gain", value)


def by_bound_method():
    controller = Controller()
    return controller.torque, lambda value: setattr(controller, "gain", value)


def by_slot():
    slotted = Slotted()
    slotted.gain = 1.0
    return (
        lambda motion: -slotted.gain * motion.of(NORMAL)[0],
        lambda value: setattr(slotted, "gain", value),
    )


def by_method_of_a_module():
    def change(value):
        Law.__call__ = lambda self, motion: -value * motion.of(NORMAL)[0]

    return Law(jnp.asarray(1.0)), change


def by_class_defined_anew():
    def change(value):
        globals()["Slotted"] = type("Slotted", (), {"gain": value})

    change(1.0)
    return lambda motion: -Slotted.gain * motion.of(NORMAL)[0], change


def by_module():
    module = sys.modules["gains"] = types.ModuleType("gains")
    module.gain = 1.0
    return lambda motion: -module.gain * motion.of(NORMAL)[0], lambda v: setattr(module, "gain", v)


def by_the_users_jit():
    k = 1.0

    @jax.jit
    def torque(angle):
        return -k * angle

    def change(value):
        nonlocal k
        k = value

    return lambda motion: torque(motion.of(NORMAL)[0]), change


READINGS = (
    by_global, by_helper, by_attribute, by_array, by_default, by_cell, by_partial, by_object,
    by_bound_method, by_slot, by_method_of_a_module, by_class_defined_anew, by_module,
    by_the_users_jit,
)  # fmt: skip


@pytest.fixture(autouse=True)
def _globals_stay_as_they_were():
    before = {name: globals()[name] for name in ("gain", "helper", "Slotted")}
    call = Law.__call__
    yield
    globals().update(before)
    Law.__call__, settings.gain = call, 1.0
    table.fill(1.0)


@functools.cache
def rates_at(k):
    return rates(scene_of(proportional(k)))


@pytest.mark.parametrize("reading", READINGS)
def test_a_motors_law(reading):
    law, change = reading()
    scene = scene_of(law)
    np.testing.assert_allclose(rates(scene), rates_at(1.0), rtol=1e-12)
    change(3.0)
    for each in (scene, scene_of(law)):
        np.testing.assert_allclose(rates(each), rates_at(3.0), rtol=1e-12)


def test_what_a_function_does_not_read_compiles_nothing_again():
    controller = Controller()
    code = users_code(scene_of(controller))
    before = versions_of(code)
    controller.history.append(gain)
    controller.unread = 2.0
    assert versions_of(code) == before
    controller.gain = 2.0
    assert versions_of(code) != before


def test_the_packages_own_scenes_have_no_code_of_the_users():
    assert users_code(jb.seed_scene(), jb.MidStance(), jb.solvers.Rodas4()) == ()


class Oscillator(Plain):
    """ÿ = −(gain k)² y."""

    def vector_field(self, t, y, args):
        return y[1], -((gain * args) ** 2) * y[0]


@pytest.mark.nightly
def test_a_system_and_a_section():
    section = jb.Section(lambda args, y: y[0] - settings.gain + 1.0)
    start = (jnp.asarray(-1.0), jnp.asarray(0.0))

    def quarter():
        return float(jb.return_map(2.0, start, system=Oscillator(), section=section).time)

    assert quarter() == pytest.approx(np.pi / 4.0, rel=1e-6)
    globals()["gain"], settings.gain = 3.0, 1.5  # half the amplitude beyond the middle
    assert quarter() == pytest.approx(np.pi / 9.0, rel=1e-6)


class Walker(eqx.Module):
    """A walker of the user's, whose mechanism has a global in it."""

    def mechanism(self):
        legs = (dataclasses.replace(leg, mass=jnp.asarray(gain)) for leg in LEGS)
        return jb.Mechanism(bodies=tuple(legs), feet=FEET, mirror=PAIR)


class Pulse(jb.actuation.AbstractPhaseTorque):
    """Its shape is a function outside."""

    torque: float = jb.laws.parameter("torque", unit="N m")
    reaction: str = eqx.field(static=True, default="swing")

    def torque_at(self, phase):
        return -self.torque * helper(phase)

    def idle(self):
        return dataclasses.replace(self, torque=0.0 * self.torque)


def test_a_walker_and_an_actuator():
    driven = jb.RigidScene(Walker(), jb.Ground(slope=0.03), Pulse(0.1))
    start = driven.state(theta_leg_1=0.2, theta_leg_2=-0.2, omega_leg_2=-1.2)

    def motion():
        masses = float(driven.mechanism.total_mass)
        return masses, np.array(jax.tree.leaves(jb.dynamics.rolling(driven, start)))

    (light, first), (globals()["gain"]) = motion(), 2.0
    heavy, after = motion()
    assert (light, heavy) == (2.0, 4.0)
    twice = dataclasses.replace(driven, actuation=jb.actuation.HipTorque(0.1 * 2.0 * 0.2))
    np.testing.assert_allclose(
        after, jax.tree.leaves(jb.dynamics.rolling(twice, start)), rtol=1e-12
    )
    assert not np.allclose(after, first)


def test_a_walk():
    scene = scene_of(by_global()[0])
    start = scene.state(theta_torso=0.1, omega_leg_2=-1.2)

    def end(scene):
        return float(jb.rigid_walk(scene, start, duration=0.05).final.theta_torso)

    first, (globals()["gain"]) = end(scene), 3.0
    assert end(scene) == end(scene_of(proportional(3.0))) != first


@pytest.mark.parametrize("transform", [jax.jit, jax.grad, jax.jacfwd])
def test_a_closure_over_what_is_traced_gets_a_sentence(transform):
    def end(k):
        scene = scene_of(proportional(k))
        return jb.rigid_walk(scene, scene.state(omega_leg_2=-1.2), duration=0.1).final.theta_torso

    with pytest.raises(jb.ArgumentError, match=r"proportional.* that JAX traces from a closure"):
        transform(end)(1.0)
    with pytest.raises(jb.ArgumentError, match="pass it as a leaf, of an equinox"):
        transform(lambda k: jb.return_map(
            2.0, (jnp.asarray(-1.0), jnp.asarray(0.0)),
            system=Oscillator(), section=jb.Section(lambda args, y: y[0] - k),
        ).time)(0.1)  # fmt: skip
