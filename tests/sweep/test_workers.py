"""Threads, processes and clusters, against one process; nothing is lost when they die."""

import concurrent.futures
import os
import pickle
import signal
import sys
import threading

import distributed
import jax.tree_util as jtu
import numpy as np
import pytest
import zarr

import jaxbiped as jb
from jaxbiped._files import THREADS_VARIABLE
from jaxbiped.compiler import default_threads
from jaxbiped.sweep._store import Layout
from jaxbiped.sweep._workers import _AHEAD, _told_if_lost, compute_chunks
from tests.compiler.fake_driver import install
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker
from tests.sweep.walkers import gaitless, same, same_results, simplest_grid, with_attractor

pytestmark = pytest.mark.slow

SCENE = simplest_walker(0.009)
LABELLING = gaitless(SCENE, simplest_state(*STABLE))
STARTS = simplest_grid(SCENE)


def _swept(labelling=LABELLING, starts=STARTS, **options):
    return jb.sweep(labelling, starts, chunk=8, look_for_gaits=False, **options)


@pytest.fixture(scope="module")
def expected():
    return _swept()


def test_threads(expected):
    with concurrent.futures.ThreadPoolExecutor(3) as pool:
        same_results(_swept(executor=pool, workers=3), expected)


def test_a_device_labels_the_next_chunk_while_one_is_written(monkeypatch, expected, tmp_path):
    fake = install(monkeypatch, lanes=4, multiprocessors=1)
    labelling = gaitless(SCENE, simplest_state(*STABLE), engine="cuda")
    found = _swept(labelling, store=tmp_path / "store")
    same_results(found.load(), expected)
    assert len(fake.launches) == 8
    # A store does not say by which engine it was filled: lanes go on with it.
    again = _swept(store=tmp_path / "store")
    assert again.attrs["labelled_in_this_run"] == 0


def test_labellings_and_layouts_travel():
    known = with_attractor(LABELLING)
    for thing in (known, Layout.of(STARTS, 8)):
        copy = pickle.loads(pickle.dumps(thing))
        assert jtu.tree_structure(copy) == jtu.tree_structure(thing)
        same(copy, thing)
    found = known(STARTS.batch(known, 0, 64).states)
    assert jb.basins.Label.WALKING in found.label
    same(pickle.loads(pickle.dumps(known))(STARTS.batch(known, 0, 64).states), found)


def _killing(scene, states):
    """Ends the worker that makes the start with the largest angle."""
    if states.theta_2[0] > 0.235:
        os.kill(os.getpid(), signal.SIGKILL)
    return states


def test_spawned_processes_and_one_that_dies(tmp_path, expected):
    killing = jb.starts.grid(SCENE, STARTS.values, follow=_killing)
    with jb.local_executor(2) as pool:
        assert pool.submit(os.getenv, THREADS_VARIABLE).result() == str(
            max(1, default_threads() // 2)
        )
        same_results(_swept(executor=pool, workers=2), expected)
        with pytest.raises(jb.ResourceError) as raised:
            _swept(starts=killing, store=tmp_path / "store", executor=pool, workers=2)
    sentence = str(raised.value)
    assert sentence.startswith("executor = ProcessPoolExecutor lost its workers (")
    assert sentence.endswith("run again; complete chunks remain in the store.")
    done = zarr.open_group(str(tmp_path / "store"), mode="r")["done"][:]
    assert 1 <= done.sum() < len(done)
    kept = zarr.open_group(str(tmp_path / "store"), mode="r")["time"][:][done == 1]
    np.testing.assert_array_equal(kept, expected.time.values[done == 1])


def test_what_cannot_be_sent_to_processes_is_refused():
    starts = jb.starts.grid(SCENE, {"theta_stance": [0.2]}, follow=lambda scene, states: states)
    with (
        jb.local_executor(1) as pool,
        pytest.raises(jb.ArgumentError, match="must be a module's own"),
    ):
        _swept(starts=starts, executor=pool)


def test_a_script_without_a_main_guard_is_refused_in_one_whole_sentence(tmp_path, monkeypatch):
    script = tmp_path / "script.py"
    script.write_text("import jaxbiped")
    monkeypatch.setattr(sys.modules["__main__"], "__file__", str(script), raising=False)
    below = 'below if __name__ == "__main__"'
    guard = f"workers import the script that makes them, which must do so {below}"
    with pytest.raises(jb.ArgumentError) as refused:
        jb.local_executor(2)
    assert str(refused.value) == f"workers = 2 is not allowed here: {guard}."
    pool = concurrent.futures.Executor()
    with pytest.raises(jb.ResourceError) as lost, _told_if_lost(pool, OSError):
        raise OSError("a process ended abruptly. " + 300 * "More. ")
    assert str(lost.value) == (
        f"executor = Executor lost its workers (a process ended abruptly): {guard}; complete "
        "chunks remain in the store."
    )
    script.write_text('if __name__ == "__main__":\n    pass')
    jb.local_executor(1).shutdown()


@pytest.mark.parametrize("workers", [0, 1.5, None])
def test_workers_are_counted(workers):
    with pytest.raises(jb.ArgumentError, match=f"workers = {workers} is not allowed"):
        jb.local_executor(workers)
    with pytest.raises(jb.ArgumentError, match=f"workers = {workers} is not allowed"):
        _swept(workers=workers)


class _Counting(concurrent.futures.Executor):
    """Runs at once what it is given, and counts what nobody has taken yet."""

    def __init__(self):
        self.open, self.most, self.sizes = 0, 0, []

    def submit(self, function, *arguments):
        self.open += 1
        self.most = max(self.most, self.open)
        self.sizes.append(len(pickle.dumps(arguments[1:])))
        future = concurrent.futures.Future()
        future.set_result(arguments[2])
        return future


def test_chunks_in_hand_are_bounded():
    executor = _Counting()
    layout = Layout.of(jb.starts.grid(SCENE, {"theta_stance": np.linspace(0.1, 0.2, 100)}), 1)
    for _ in compute_chunks(LABELLING, layout, np.arange(100), executor, 3):
        executor.open -= 1
    assert executor.most == 3 * _AHEAD
    assert len(executor.sizes) == 100


def test_given_starts_travel_in_parts():
    executor = _Counting()
    starts = jb.starts.GivenStarts(jb.dynamics.RigidState(*[np.zeros(10_000)] * 5))
    list(compute_chunks(LABELLING, Layout.of(starts, 10), np.arange(1000), executor, 1))
    assert max(executor.sizes) < 4000


class _Watch(threading.Thread):
    """Kills a process once some chunks of a store are complete."""

    def __init__(self, path, pid, chunks):
        super().__init__(daemon=True)
        self.path, self.pid, self.chunks, self.killed = path, pid, chunks, threading.Event()
        self.ended = threading.Event()

    def run(self):
        while not self.ended.wait(0.005):
            if self.path.exists():
                done = zarr.open_group(str(self.path), mode="r")["done"][:].sum()
                if self.chunks <= done < 80:
                    os.kill(self.pid, signal.SIGKILL)
                    self.killed.set()
                    return


@pytest.mark.nightly
def test_a_cluster_one_of_whose_workers_is_killed(tmp_path):
    """A scheduler and two worker processes over loopback; nothing is lost."""
    starts = simplest_grid(SCENE, 80)
    expected = jb.sweep(LABELLING, starts, look_for_gaits=False)
    cluster = distributed.LocalCluster(
        2, processes=True, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
    )
    with cluster:
        executor, threads = jb.cluster_executor(cluster.scheduler_address)
        assert threads == 2
        watch = _Watch(tmp_path / "store", cluster.workers[0].pid, 10)
        watch.start()
        found = jb.sweep(
            LABELLING,
            starts,
            store=tmp_path / "store",
            chunk=80,
            executor=executor,
            workers=threads,
            look_for_gaits=False,
        )
        watch.ended.set()
        executor.shutdown()
    assert watch.killed.is_set()
    assert found.done.values.all()
    assert found.attrs["labelled_in_this_run"] == 6400
    same_results(found, expected)


def test_a_cluster_without_workers_is_told():
    options = {"host": "127.0.0.1", "port": 0, "dashboard": False}
    scheduler = {"cls": distributed.Scheduler, "options": options}
    cluster = distributed.SpecCluster(workers={}, scheduler=scheduler)
    with cluster, pytest.raises(jb.ResourceError, match="has no workers: start at least one"):
        jb.cluster_executor(cluster.scheduler_address)


def test_a_cluster_that_is_not_there_is_told(monkeypatch):
    with pytest.raises(jb.ArgumentError) as raised:
        jb.cluster_executor("tcp://127.0.0.1:9", timeout=0.5)
    sentence = str(raised.value)
    assert sentence.startswith("scheduler = 'tcp://127.0.0.1:9' does not answer (")
    assert "\n" not in sentence
    with pytest.raises(jb.ArgumentError, match="scheduler = 'nowhere' does not answer"):
        jb.cluster_executor("nowhere", timeout=0.5)
    with pytest.raises(jb.ArgumentError, match="timeout = 0 is not allowed"):
        jb.cluster_executor("tcp://127.0.0.1:9", timeout=0)
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(jb.ResourceError, match=r"pip install jaxbiped\[sweep\]"):
        jb.cluster_executor("tcp://127.0.0.1:9")
