"""Copied checkout: a copy of the project in a temporary folder, in which tests are run."""

import importlib.util
import multiprocessing
import os
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

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

    def first_failure(self, paths: Sequence[str], cache: Path, *, slow: bool) -> str | None:
        """The first test under these paths that fails; None if all pass.

        Args:
            paths: files, folders or single tests.
            cache: pytest's folder, in which programs are kept.
            slow: whether to run slow tests, too.
        """
        tier = [] if slow else ["-m", "not slow"]
        arguments = ["-x", "-rfE", "--tb=no", "--ignore=tests/mutants", f"--rootdir={self.folder}",
                     "--hypothesis-profile=mutants", "-o", f"cache_dir={cache}"]  # fmt: skip
        output = self.folder / "output"
        run = _SERVER.Process(
            target=_run_pytest, args=(str(self.folder), output, [*arguments, *tier, *paths])
        )
        run.start()
        run.join(LONGEST)
        if run.exitcode is None:
            run.kill()
            return f"no end within {LONGEST:g} s: {' '.join(paths)}"
        if run.exitcode in (0, 5):  # 5: every test there is slow
            return None
        said = output.read_text(errors="replace")
        if run.exitcode == 4 and "while loading conftest" not in said:
            raise RuntimeError(f"pytest did not take {' '.join(paths)}: {said[-300:]}")
        for line in said.splitlines():
            if line.startswith(("FAILED ", "ERROR ")):
                return line.split(" ", 1)[1].split(" - ")[0]
        return f"pytest ended with {run.exitcode}: {said[-300:]}"


def _run_pytest(folder: str, output: Path, arguments: list[str]) -> None:
    """In a process of its own: pytest in a folder, whose package and tests are imported there."""
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
