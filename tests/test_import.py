"""What importing jaxbiped costs: a gait waits for no library that only sweeps and pictures need."""

import subprocess
import sys

import pytest

_LATER = (
    "dask",
    "matplotlib",
    "pandas",
    "scipy.ndimage",
    "scipy.optimize",
    "scipy.stats",
    "xarray",
    "zarr",
)
_LOADED = "import sys; print(*sys.modules)"


@pytest.mark.parametrize("module", ["jaxbiped", "jaxbiped.cli"])
def test_what_is_only_sometimes_used_is_imported_then(module):
    command = [sys.executable, "-c", f"import {module}; {_LOADED}"]
    loaded = set(subprocess.run(command, capture_output=True, text=True, check=True).stdout.split())
    assert module in loaded
    assert not loaded & set(_LATER)
