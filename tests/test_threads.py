"""Several threads at once, against the bits of single calls, whatever another one clears."""

import concurrent.futures
import threading

import pytest

import jaxbiped as jb
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker
from tests.sweep.walkers import gaitless, same, simplest_grid

pytestmark = pytest.mark.slow

THREADS = 4


def _end(name, **options):
    scene = jb.ladder()[name]
    settings = dict(duration=0.2, save="end", engine="lanes") | options
    return lambda: jb.simulate(scene, jb.seed_state(), **settings).state


def _gait(slope):
    start = simplest_state(*STABLE)
    plain = dict(parameters=(), radius_sensitivities=False)

    def find():
        gait = jb.find_gait(simplest_walker(slope), start, engine="lanes", **plain)
        return gait.measures, gait.multipliers

    return find


def _labels(scene, starts):
    labelling = gaitless(scene, simplest_state(*STABLE))
    states = starts.batch(labelling, 0, starts.size).states

    def label():
        found = labelling(states)
        return found.label, found.time, found.final

    return label


CALLS = {
    "end": _end("stribeck"),
    "end of another law": _end("creep"),
    "end at another accuracy": _end("stribeck", accuracy="tight"),
    "saved times": _end("stribeck", save=[0.05, 0.1, 0.2]),
    "gait": _gait(0.009),
    "gait of another slope": _gait(0.0095),
    "labels": _labels(simplest_walker(0.009), simplest_grid(simplest_walker(0.009), 4)),
}


@pytest.fixture(scope="module")
def expected():
    """What each call gives by itself."""
    return {name: call() for name, call in CALLS.items()}


def _all_at_once(rounds):
    """Every call in several rounds, in another order in each, as names and results."""
    names = [name for k in range(rounds) for name in [*CALLS][k:] + [*CALLS][:k]]
    with concurrent.futures.ThreadPoolExecutor(THREADS) as pool:
        return list(zip(names, pool.map(lambda name: CALLS[name](), names), strict=True))


def test_threads_that_find_everything_compiled(expected):
    for name, found in _all_at_once(4):
        same(found, expected[name])


def test_threads_that_compile_at_once(expected, no_disk_cache):
    jb.clear_caches()
    for name, found in _all_at_once(2):
        same(found, expected[name])


def test_threads_while_another_one_clears(expected):
    over, cleared, results = threading.Event(), [], []

    def clear():
        while not over.wait(1.0 if cleared else 0.0):
            jb.clear_caches()
            cleared.append(True)

    clearing = threading.Thread(target=clear)
    clearing.start()
    try:
        while len(cleared) < 4:
            results += _all_at_once(1)
    finally:
        over.set()
        clearing.join()
    for name, found in results:
        same(found, expected[name])
