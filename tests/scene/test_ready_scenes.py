"""The ladder of models, against the scenes' leaves."""

import dataclasses

import pytest

import jaxbiped as jb


def test_rungs_model_one_walker():
    scene = jb.seed_scene(slope=0.015, r=0.1, mu_kinetic=0.3)
    rungs = jb.ladder(scene)
    assert list(rungs) == ["rigid", "creep", "stribeck", "bristles"]
    assert rungs["stribeck"] is scene
    for rung in rungs.values():
        assert float(rung.walker.r) == 0.1
        assert float(rung.ground.slope) == 0.015
    assert float(rungs["creep"].friction.mu) == 0.3
    assert float(rungs["bristles"].friction.mu_kinetic) == 0.3


def test_the_seeds_numbers_are_the_papers():
    paper = dict(
        slope=0.02, g=9.8, m=1.0, J=0.0096, l=0.4, d=0.1, r=0.08, hip_mass=0.0, n=1.5, K=1e6, c=1e7,
        mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1000.0,
    )  # fmt: skip
    values = jb.parameter_values(jb.seed_scene())
    assert {name: float(value) for name, value in values.items()} == paper
    for name in paper:
        changed = jb.parameter_values(jb.seed_scene(**{name: 1.01 * paper[name]}))
        others = {key: float(value) for key, value in changed.items() if key != name}
        assert float(changed[name]) == 1.01 * paper[name]
        assert others == {key: value for key, value in paper.items() if key != name}


def test_rungs_creep_at_a_millimetre_a_second_and_bend_by_a_hundredth_of_one():
    rungs = jb.ladder()
    assert float(rungs["creep"].friction.v_d) == 1e-3
    assert float(rungs["bristles"].friction.sigma_1) == 100.0
    law = rungs["bristles"].friction
    assert float(law.mu_static / law.sigma_0) == pytest.approx(1e-5)


def test_a_scene_without_the_seeds_friction_is_refused():
    scene = dataclasses.replace(jb.seed_scene(), friction=jb.laws.Frictionless())
    with pytest.raises(jb.ArgumentError, match=r"scene\.friction = Frictionless"):
        jb.ladder(scene)
