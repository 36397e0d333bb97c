"""Programs on this machine's own CUDA device, where there is one, against the lanes' bits."""

import ctypes
import threading
import time

import jax
import jax.tree_util as jtu
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.compiler import CUDA, DEVICES, LANES
from tests.compiler.fake_driver import limit_room
from tests.compiler.runtime.test_cuda_device import run_counting
from tests.compiler.runtime.test_device_programs import CASES
from tests.sweep.walkers import gaitless, same, with_attractor

_MISSING = DEVICES.hindrance()
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(_MISSING is not None, reason=f"no device: {_MISSING}"),
]


@pytest.mark.parametrize("name", list(CASES))
def test_lanes_bits(name):
    found, expected = CASES[name]("cuda"), CASES[name]("lanes")
    for a, b in zip(jtu.tree_leaves(found), jtu.tree_leaves(expected), strict=True):
        np.testing.assert_array_equal(a, b)


def test_many_starts_get_the_lanes_labels():
    """Enough for every multiprocessor, among them one that is no number."""
    scene, state = jb.seed_scene(), jb.seed_state()
    random = np.random.default_rng(1)
    starts = jtu.tree_map(lambda leaf: np.full(60_000, float(leaf)), state)
    rates = random.uniform(-4.0, 5.0, 60_000)
    rates[777] = np.nan
    starts = starts._replace(omega_2=rates, theta_2=random.uniform(-0.5, 0.8, 60_000))
    found, expected = (
        with_attractor(gaitless(scene, state, engine=engine, footsteps=3, accuracy="draft"))(starts)
        for engine in ("cuda", "lanes")
    )
    assert len(np.unique(expected.label)) > 2
    same([*found][:-1], [*expected][:-1])


def test_counts_of_unlike_lengths(monkeypatch):
    lengths = 1 + np.arange(100_000) % 1237
    same(run_counting(CUDA, lengths), run_counting(LANES, lengths))
    limit_room(monkeypatch, 400_000)
    same(run_counting(CUDA, lengths[:20_000]), run_counting(LANES, lengths[:20_000]))


def test_an_interrupt_stops_the_kernel():
    run_counting(CUDA, [1.0])
    began = time.perf_counter()
    threading.Timer(0.3, lambda: ctypes.pythonapi.PyErr_SetInterrupt()).start()
    with pytest.raises(KeyboardInterrupt):
        run_counting(CUDA, [1e15, 1e15])
    assert time.perf_counter() - began < 5.0
    lengths = [3.0, 5.0, 2.0]
    same(run_counting(CUDA, lengths), run_counting(LANES, lengths))


def test_under_jit():
    def run(engine):
        return jax.jit(lambda rate: jb.simulate(
            jb.seed_scene(), jb.seed_state()._replace(omega_2=rate), duration=0.1, save="end",
            engine=engine,
        ).final)(-1.2)  # fmt: skip

    same(run("cuda"), run("lanes"))
