"""What all tests share."""

import contextlib
import ctypes
import gc
import os
import shutil
import signal
import tempfile
from pathlib import Path

import hypothesis
import jax
import pytest

import jaxbiped as jb
from jaxbiped.compiler.runtime import _machine_code
from tests.nightly import Share
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker

# What decides whether a change lands draws the same examples every time; elsewhere they are new.
hypothesis.settings.register_profile("landing", derandomize=True, print_blob=True)
# A mutation is caught by the first example that fails: a smaller one takes minutes to find.
hypothesis.settings.register_profile(
    "mutants", derandomize=True, phases=(hypothesis.Phase.explicit, hypothesis.Phase.generate)
)
if os.environ.get("CI"):
    hypothesis.settings.load_profile("landing")

# Tracing makes many objects and little garbage: looking for it as often as usual costs some 8 %.
gc.set_threshold(100_000, 10, 5)

jax.config.update("jax_numpy_dtype_promotion", "strict")

MANY_MAPPINGS = 12_000
"""Mappings of memory that programs may hold; Linux allows 65530 and XLA dies where it gets none."""
MUCH_MEMORY = 1 << 30
"""Bytes that a worker may grow by: what XLA compiled holds some ten kilobytes an operation."""


@pytest.fixture(scope="module", autouse=True)
def _few_programs_are_kept(_memory):
    """A worker lives through many files: programs of those behind it are dropped when they pile up.

    Not after every file, for what files share would be compiled again.
    """
    yield
    mappings = Path("/proc/self/maps")
    if not mappings.exists():
        return
    many = mappings.read_bytes().count(b"\n") > MANY_MAPPINGS
    if many or _resident() > _memory[-1] + MUCH_MEMORY:
        jax.clear_caches()
        jb.clear_caches()  # which collects: in a worker of gigabytes seconds each time
        with contextlib.suppress(AttributeError):  # another C library
            ctypes.CDLL(None).malloc_trim(0)
        gc.freeze()  # what is left stays, and need not be looked at again
        _memory.append(_resident())


@pytest.fixture(scope="session")
def _memory():
    """What the worker took where programs were last dropped [bytes]."""
    return [_resident() if Path("/proc/self/statm").exists() else 0]


def _resident():
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


QUICK_COMPILING = "--xla_backend_optimization_level=0"
"""XLA compiles walks and gaits in less than half the time, and runs them slower."""
if jax.__version_info__ < (0, 11, 1):  # which no longer has a choice of emitters
    # In parts, for which a worker has no second core, it takes a fifth longer.
    QUICK_COMPILING += (
        " --xla_cpu_use_fusion_emitters=false --xla_cpu_parallel_codegen_split_count=1"
    )


def pytest_addoption(parser):
    parser.addoption(
        "--nightly-share",
        metavar="I/N",
        help="of the nightly tests alone, the I-th modulo N of N parts, or with I,J/N two of them; "
        "compiled as for users",
    )


def pytest_configure(config):
    """One cache on disk for all workers: what one compiled others load. In CI it is new."""
    # Commands in the background of a script ignore interrupts, which tests raise.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if config.option.nightly_share is None:
        _machine_code.EFFORT = 0
    if "PYTEST_XDIST_WORKER" in os.environ:
        return
    if config.option.nightly_share is None:
        os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {QUICK_COMPILING}".strip()
    if os.environ.get("CI"):
        folder = tempfile.mkdtemp(prefix="jaxbiped-tests-")
        config.add_cleanup(lambda: shutil.rmtree(folder, ignore_errors=True))
    else:
        folder = str(config.cache.mkdir("jaxbiped"))
    os.environ["JAXBIPED_CACHE"] = folder


@pytest.fixture
def no_disk_cache(monkeypatch):
    """For a test that changes what a program does behind its fingerprint's back."""
    monkeypatch.setenv("JAXBIPED_CACHE", "")


@pytest.fixture
def stages_at_once(monkeypatch):
    """Stages show themselves at once, and not after two seconds."""
    monkeypatch.setattr("jaxbiped._progress._PATIENCE", 0.0)


@pytest.fixture(scope="session")
def _reported():
    """What JAX reports, while the session lasts."""
    events = []
    jax.monitoring.register_event_duration_secs_listener(
        lambda name, seconds, **_: events.append(name)
    )
    return events


@pytest.fixture
def made_by_xla(_reported):
    """Asked for, what JAX has lowered and what XLA has compiled since this was last asked."""

    def asked():
        names = [name.rpartition("/")[2] for name in _reported]
        _reported.clear()
        return [name for name in names if name.startswith(("jaxpr_to_mlir", "backend_compile"))]

    _reported.clear()
    return asked


def pytest_collection_finish():
    """What imports made stays: no collection has to look at it again."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Files with slow tests begin first, so that no worker is left alone with one at the end.

    Whatever is nightly is slow.
    """
    for item in items:
        if item.get_closest_marker("nightly"):
            item.add_marker("slow")
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)
    if config.option.nightly_share is not None:
        items[:], rest = Share.parse(config.option.nightly_share).split(items)
        config.hook.pytest_deselected(items=rest)


LONGEST_UNIT = 10.0
"""Seconds that a test of `make check` may take on an idle machine before it is called slow."""


def pytest_terminal_summary(terminalreporter, config):
    """Names tests that `make check` waits for too long, so that they can be marked."""
    if config.option.markexpr != "not slow":
        return
    seconds: dict[str, float] = {}
    for report in terminalreporter.getreports("passed") + terminalreporter.getreports(""):
        seconds[report.nodeid] = seconds.get(report.nodeid, 0.0) + report.duration
    for name, took in sorted(seconds.items(), key=lambda each: -each[1]):
        if took > LONGEST_UNIT:
            terminalreporter.write_line(f"{took:.0f} s, on an idle machine mark it slow: {name}")


@pytest.fixture(scope="session")
def seed_walk():
    """The seed's walker over two seconds at the tight accuracy: scene and trajectory."""
    scene = jb.seed_scene()
    return scene, jb.simulate(scene, jb.seed_state(), duration=2.0, accuracy="tight")


@pytest.fixture(scope="session")
def reference():
    """The seed's walk by an independent program and integrator: (times, states (n, 8))."""
    from reference.walks import reference_states  # numba takes a second

    return reference_states()


@pytest.fixture(scope="session")
def seed_gait():
    """The seed's gait with all its sensitivities, by lanes."""
    return jb.find_gait(jb.seed_scene())


@pytest.fixture(scope="session")
def simplest():
    """A labelling of the simplest walker on its slope of 0.009, with its gait."""
    guess = simplest_state(*STABLE)
    return jb.labelling(simplest_walker(0.009), guess=guess, accuracy="balanced")


@pytest.fixture(scope="session")
def seed():
    """A labelling of the seed's walker, with its gait."""
    return jb.labelling(jb.seed_scene())
