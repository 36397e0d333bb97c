"""Engines by name, against what is refused, and in which words."""

import diffrax
import jax
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.compiler import BY_NAME, CUDA, LANES, XLA
from tests.compiler.fake_driver import install
from tests.sweep.walkers import gaitless

SCENE, STATE = jb.seed_scene(), jb.seed_state()


def by_device(state=STATE, **how):
    return jb.simulate(SCENE, state, duration=0.1, engine="cuda", **how)


def test_names():
    assert [BY_NAME[name] for name in jb.ENGINES[1:]] == [XLA, LANES, CUDA]


def test_devices_are_refused_where_there_is_none(monkeypatch):
    install(monkeypatch, devices=0)
    sentence = (
        r'^engine = "cuda" is not allowed here: there is no CUDA device; use engine="lanes"\.$'
    )
    for ask in (
        by_device,
        lambda: by_device(save=jb.MidStance()),
        lambda: jb.labelling(SCENE, engine="cuda"),
    ):
        with pytest.raises(jb.ArgumentError, match=sentence):
            ask()


@pytest.mark.parametrize(
    ("ask", "why"),
    [
        (lambda: jb.find_gait(SCENE, engine="cuda"), "run walks and labels, no searches"),
        (lambda: by_device(adjoint=diffrax.ForwardMode()), "an adjoint is diffrax's"),
        (
            lambda: jb.simulate(
                SCENE, jax.tree.map(np.float32, STATE), duration=0.1, engine="cuda"
            ),
            'in 64 bits; use engine="xla"',
        ),
    ],
)
def test_what_devices_cannot_do(monkeypatch, ask, why):
    install(monkeypatch)
    with pytest.raises(jb.ArgumentError, match=why):
        ask()


def test_auto_takes_a_device_for_labels_that_keep_it_busy(monkeypatch):
    def engines(**options):
        effort = gaitless(SCENE, STATE, **{"engine": "auto"} | options).effort
        return [effort.engine_of(count) for count in (1, 100_000)]

    install(monkeypatch, multiprocessors=132)
    assert engines() == ["lanes", "cuda"]
    assert engines(engine="cuda") == ["cuda", "cuda"]
    assert engines(engine="lanes") == ["lanes", "lanes"]
    assert jb.Simulation.prepare(SCENE, STATE, duration=0.1).engine == "lanes"
    install(monkeypatch, devices=0)
    assert engines() == ["lanes", "lanes"]
