"""What tells two models apart, against models that differ in one thing."""

import functools
import json

import equinox as eqx
import pytest

import jaxbiped as jb
from jaxbiped._identity import code_digests, difference_of, identity
from jaxbiped.scene._parameter_access import scene_identity
from tests.sweep.walkers import gaitless

SEED = jb.seed_scene()


def _scene(**parts):
    kept = {name: getattr(SEED, name) for name in ("walker", "ground", "normal", "friction")}
    return jb.Scene(**{**kept, **parts})


def _settings(**parts):
    return gaitless(_scene(**parts), jb.seed_state()).settings()


class RistowSchafer(jb.laws.RistowSchafer):
    """A user's law of a name that is taken."""


class Wide(jb.laws.AlwaysTouching):
    """A user's rule with a choice that is no number."""

    how: str = eqx.field(static=True)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (dict(clearance=jb.laws.OneFoot(1)), dict(clearance=jb.laws.OneFoot(2))),
        (dict(clearance=jb.laws.OneFoot(1)), dict(clearance=jb.laws.AlwaysTouching())),
        (dict(clearance=Wide("left")), dict(clearance=Wide("right"))),
        (
            dict(normal=jb.laws.RistowSchafer(K=1e6, c=1e7, n=1.5)),
            dict(normal=RistowSchafer(K=1e6, c=1e7, n=1.5)),
        ),
    ],
)
def test_models_that_differ_in_no_number_have_other_settings(one, other):
    assert _settings(**one) == _settings(**one)
    assert json.dumps(_settings(**one)) != json.dumps(_settings(**other))


def test_numbers_are_told_once_and_by_name():
    settings = _settings()
    assert settings["scene"]["K"] == 1e6
    assert "K" not in settings["models"]["scene"]["normal"]
    assert identity(SEED)["normal"]["class"] == "jaxbiped.RistowSchafer"


@pytest.mark.parametrize("module", ["scene.laws.normal._ristow_schafer", "scene._moved"])
def test_a_class_that_moved_within_the_package_is_the_same_model(module):
    def told(name):
        return {"class": "jaxbiped.Scene", "normal": {"class": name}}

    older = told(f"jaxbiped.{module}.RistowSchafer")
    assert difference_of(older, told("jaxbiped.RistowSchafer")) is None
    assert difference_of(older, told("jaxbiped.Tsuji")) is not None
    assert difference_of(older, told("mylaws._normal.RistowSchafer")) is not None


def test_what_counts_as_alike_is_asked_of_both_values_and_their_name():
    asked = []

    def alike(old, new, name):
        asked.append((old, new, name))
        return name == "scene.slope"

    old = {"scene": {"slope": 0.02, "K": [1, 2]}}
    assert difference_of(old, {"scene": {"slope": 0.021, "K": [1, 2]}}, "", alike) is None
    assert asked == [(0.02, 0.021, "scene.slope")]
    told = difference_of(old, {"scene": {"slope": 0.02, "K": [1, 3]}}, "", alike)
    assert told == "scene.K[1] = 2 there, 3 here"
    assert difference_of({}, {"a": 1}) == "a is not in the store"
    assert difference_of({"a": 1}, {}) == "a is only in the store"


def test_functions_are_known_by_module_name_and_what_is_bound():
    def of(k):
        return identity(functools.partial(max, k))

    assert of(1) != of(2)
    assert identity(test_numbers_are_told_once_and_by_name).startswith("tests.test_identity")


def test_functions_are_known_by_what_they_were_made_with():
    def power(exponent):
        return lambda x, scale=2.0: scale * x**exponent

    def again(count):
        return count and again(count - 1)

    assert identity(power(1)) == identity(power(1)) != identity(power(2))
    assert "again" in identity(again)


def test_constants_of_a_constraint_method_tell_scenes_apart():
    def of(**constants):
        method = jb.constraints.Baumgarte(**constants)
        return scene_identity(jb.RedundantScene(SEED, method))

    assert of() == of() != of(a=7.0)
    assert of()["scene"]["K"] == 1e6


def test_only_the_code_of_a_user_is_digested():
    assert code_digests(SEED, jb.starts.grid(SEED, {"theta_swing": [0.0]})) == {}
    found = code_digests(_scene(normal=RistowSchafer(K=1e6, c=1e7, n=1.5), clearance=Wide("a")))
    assert [name.rpartition(".")[2] for name in found] == ["RistowSchafer", "Wide"]
    assert all(len(digest) == 16 for digest in found.values())
    follow = code_digests(jb.starts.grid(SEED, {"theta_swing": [0.0]}, follow=_kept))
    assert list(follow) == [f"{__name__}._kept"]


def _kept(scene, states):
    return states
