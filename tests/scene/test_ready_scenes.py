"""The ladder of models, and parameters set by name, against the scenes' leaves."""

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


def test_a_scene_without_the_seeds_friction_is_refused():
    scene = dataclasses.replace(jb.seed_scene(), friction=jb.laws.Frictionless())
    with pytest.raises(jb.ArgumentError, match=r"scene\.friction = Frictionless"):
        jb.ladder(scene)


def test_with_parameters_replaces_and_checks():
    scene = jb.with_parameters(jb.seed_scene(), {"K": 2e6, "slope": 0.03, "r": 0.05})
    assert float(scene.normal.K) == 2e6
    assert float(scene.ground.slope) == 0.03
    assert float(scene.walker.r) == 0.05
    assert float(scene.normal.c) == 1e7
    with pytest.raises(jb.ArgumentError, match="parameter = 'k'"):
        jb.with_parameters(scene, {"k": 1.0})
    with pytest.raises(jb.ArgumentError, match="K = -1"):
        jb.with_parameters(scene, {"K": -1.0})
