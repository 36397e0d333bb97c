"""Operations of compiled vector fields, against scenes with less in them."""

import dataclasses
import re
from collections import Counter

import jax
import pytest

import jaxbiped as jb

SEED = jb.seed_scene()
BRISTLES = jb.laws.LuGre(mu_static=0.5, mu_kinetic=0.4, v_s=1e-3, sigma_0=5e4, sigma_1=100.0)


def scene(**parts):
    return dataclasses.replace(SEED, **parts)


def compiled(scene):
    """Operations of the vector field as XLA compiles it: those within its fusions."""
    field = jax.jit(lambda y, args: jb.dynamics.vector_field(0.0, y, args))
    text = field.lower(jb.seed_state(), scene).compile().as_text()
    return Counter(re.findall(r"= \S+ (\w+[-\w]*)\(", text))


def test_an_exponential_only_with_stribeck_or_a_power():
    linear = jb.laws.KelvinVoigt(K=3e4, D=5e3)
    peaked, flat, none, viscous, coulomb = (
        compiled(scene(normal=linear, friction=law))
        for law in (
            SEED.friction,
            jb.laws.Threlfall(mu=0.4, v0=1e-4),
            jb.laws.Frictionless(),
            jb.laws.Viscous(k=100.0),
            jb.laws.RegularisedCoulomb(mu=0.4, v_d=1e-4),
        )
    )
    assert peaked["exponential"] >= 2
    assert flat["exponential"] >= 2
    assert none["exponential"] == viscous["exponential"] == 0
    assert coulomb["tanh"] >= 2
    assert none["tanh"] == peaked["tanh"] == 0
    assert none["sign"] == 0


def test_one_foots_contact_where_only_one_can_touch():
    both = compiled(scene(clearance=jb.laws.AlwaysTouching()))
    one = compiled(scene(clearance=jb.laws.OneFoot(leg=2)))
    assert 0 < one["exponential"] <= both["exponential"] // 2
    one, both = (
        jb.measure.operation_counts(scene(clearance=rule))["libm log"]
        for rule in (jb.laws.OneFoot(leg=2), jb.laws.AlwaysTouching())
    )
    assert 0 < 2 * one == both


def test_operations_fall_as_scenes_use_less():
    def total(scene):
        return sum(jb.measure.operation_counts(scene).values())

    frictionless = scene(friction=jb.laws.Frictionless())
    assert total(jb.RigidScene(SEED.walker, SEED.ground)) < total(frictionless)
    assert total(frictionless) < total(scene(friction=jb.laws.Viscous(k=100.0))) < total(SEED)
    assert total(scene(clearance=jb.laws.AlwaysTouching())) < total(SEED)
    assert total(scene(clearance=jb.laws.OneFoot(leg=2))) < 0.75 * total(SEED)
    assert total(SEED) < total(scene(friction=BRISTLES))


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["lanes", pytest.param("xla", marks=pytest.mark.nightly)])
def test_a_foot_that_never_touches_falls_through_the_ground(engine):
    only_leg_1 = scene(clearance=jb.laws.OneFoot(leg=1))
    forces = jb.dynamics.foot_forces(only_leg_1, jb.seed_state())
    assert float(forces[1].normal) == float(forces[1].tangential) == 0.0
    assert float(jb.dynamics.foot_forces(SEED, jb.seed_state())[1].normal) > 0.0
    fall = jb.simulate(
        only_leg_1, jb.seed_state(), duration=1.0, save="end", engine=engine, watch=("fall",)
    )
    assert fall.outcome in (jb.Ending.FELL_FORWARD, jb.Ending.FELL_BACK)
    with pytest.raises(jb.ArgumentError, match="leg = 3"):
        jb.laws.OneFoot(leg=3)
