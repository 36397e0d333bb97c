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


def test_a_scene_without_the_seeds_friction_is_refused():
    scene = dataclasses.replace(jb.seed_scene(), friction=jb.laws.Frictionless())
    with pytest.raises(jb.ArgumentError, match=r"scene\.friction = Frictionless"):
        jb.ladder(scene)
