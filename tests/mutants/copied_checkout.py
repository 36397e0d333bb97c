"""Copied checkout: a copy of the project in a temporary folder, in which tests are run."""

import importlib.util
import json
import math
import multiprocessing
import os
import re
import resource
import shutil
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from tests.mutants.executed_blocks import note_blocks
from tests.mutants.mutations import ROOT

LONGEST = 1800.0
"""Seconds after which a run of tests counts as hung."""
_NOT_COPIED = shutil.ignore_patterns(
    ".git", ".venv", "out", "dist", "build", "*.egg-info", "__pycache__", ".*_cache", ".hypothesis"
)
_OWN = ("jaxbiped", "tests")
_SERVER = multiprocessing.get_context("forkserver")
# Half of the time of a short run of tests goes into these imports: they are done once.
_SERVER.set_forkserver_preload(
    ["jax", "diffrax", "optimistix", "scipy.optimize", "scipy.integrate", "hypothesis", "pytest"]
)


class CopiedCheckout:
    """A copy of the checkout, made with it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        shutil.copytree(ROOT, folder, ignore=_NOT_COPIED)

    def write(self, module: str, source: str) -> str:
        """Writes a module of the package, given below `jaxbiped/`; what was there before."""
        path = self.folder / "jaxbiped" / module
        before = path.read_text()
        path.write_text(source)
        # Python tells bytecode that is out of date by seconds and size only.
        Path(importlib.util.cache_from_source(str(path))).unlink(missing_ok=True)
        return before

    def first_failure(
        self, paths: Sequence[str], cache: Path, *, tier: str, longest: float | None = None
    ) -> str | None:
        """The first test under these paths that fails; None if all pass.

        Args:
            paths: files, folders or single tests.
            cache: pytest's folder, in which programs are kept.
            tier: the tests to run, an expression of pytest's markers; "" for all.
            longest: processor time that they may take [s].

        Raises:
            OutOfTime: they take longer.
        """
        markers = ["-m", tier] if tier else []
        arguments = ["-x", "-vv", "-rfE", "--tb=no", "--ignore=tests/mutants",
                     f"--rootdir={self.folder}", "--hypothesis-profile=mutants",
                     "-o", f"cache_dir={cache}"]  # fmt: skip
        output = self.folder / "output"
        run = _SERVER.Process(
            target=_run_pytest,
            args=(str(self.folder), output, [*arguments, *markers, *paths], longest),
        )
        run.start()
        run.join(LONGEST)
        if run.exitcode is None:
            run.kill()
            return f"no end within {LONGEST:g} s: {' '.join(paths)}"
        if run.exitcode in (0, 5):  # 5: no test of the tier is there
            return None
        said = output.read_text(errors="replace")
        if longest is not None and run.exitcode == -signal.SIGXCPU:
            raise OutOfTime(said.rpartition("\n")[2].strip())  # its result is not there yet
        collected = not re.search(r"while loading conftest|\d errors? in ", said)
        if run.exitcode == 4 and collected:
            raise RuntimeError(f"pytest did not take {' '.join(paths)}: {said[-300:]}")
        for line in said.splitlines():
            if line.startswith(("FAILED ", "ERROR ")):
                return line.split(" ", 1)[1].split(" - ")[0]
        return f"pytest ended with {run.exitcode}: {said[-300:]}"

    def note_blocks(self) -> None:
        """Makes each block of the package note its number (`executed_blocks`)."""
        self._names.write_text(json.dumps(note_blocks(self.folder / "jaxbiped")))

    def observe(self, paths: Sequence[str], to: Path) -> int:
        """Runs unit tests and adds which noted blocks each executes to a file; pytest's code."""
        arguments = ["-n0", "-m", "not slow", "--ignore=tests/mutants", "--tb=no",
                     f"--rootdir={self.folder}", "--hypothesis-profile=mutants",
                     "-p", "tests.mutants.executed_blocks", f"--executed-blocks={to}",
                     f"--block-names={self._names}",
                     "-o", f"cache_dir={self.folder}/cache"]  # fmt: skip
        run = _SERVER.Process(
            target=_run_pytest,
            args=(str(self.folder), self.folder / "output", [*arguments, *paths]),
        )
        run.start()
        run.join()
        return run.exitcode or 0

    @property
    def _names(self) -> Path:
        return self.folder / "names.json"


class OutOfTime(Exception):  # noqa: N818
    """Tests took more processor time than they may; its argument is the test that was running."""


def _run_pytest(
    folder: str, output: Path, arguments: list[str], longest: float | None = None
) -> None:
    """In a process of its own: pytest in a folder, whose package and tests are imported there."""
    if longest is not None:
        used = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(used + longest), resource.RLIM_INFINITY))
    for name in list(sys.modules):
        if name.split(".")[0] in _OWN:
            del sys.modules[name]
    os.chdir(folder)
    sys.path[:] = [folder, *(path for path in sys.path if path not in ("", str(ROOT)))]
    os.environ["PYTHONPATH"] = folder
    sys.dont_write_bytecode = False  # a server is started with the flags of its parent
    os.environ.pop("CI", None)  # it would make a new cache of programs each time
    with output.open("w") as file:
        for stream in (1, 2):
            os.dup2(file.fileno(), stream)
    import pytest

    code = int(pytest.main(arguments))
    sys.stdout.flush()
    os._exit(code)
