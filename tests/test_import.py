"""What importing jaxbiped costs, against what it does without: no JAX, no backend."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import jaxbiped as jb

_LATER = (
    "dask",
    "matplotlib",
    "optax",
    "pandas",
    "scipy.integrate",
    "scipy.ndimage",
    "scipy.optimize",
    "scipy.stats",
    "xarray",
    "zarr",
)
_NAMES = "for name in jaxbiped.__all__: name == 'plot' or getattr(jaxbiped, name)"


def _python(*lines):
    """What a new process prints as JSON at the end of these lines."""
    command = [sys.executable, "-c", "\n".join(("import json, sys", *lines))]
    ran = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(ran.stdout.splitlines()[-1])


def test_importing_waits_not_even_for_jax():
    loaded = _python("import jaxbiped", "print(json.dumps(list(sys.modules)))")
    assert "jaxbiped" in loaded
    assert not {"jax", "numpy", *_LATER} & set(loaded)


@pytest.mark.parametrize(
    "lines", [("import jaxbiped", _NAMES), ("import jaxbiped.gait._find_gait",)]
)
def test_what_is_only_sometimes_used_is_imported_then(lines):
    loaded = _python(*lines, "print(json.dumps(list(sys.modules)))")
    assert "jaxbiped.gait._find_gait" in loaded
    assert not set(loaded) & set(_LATER)


def test_importing_starts_no_backend():
    """An array made at import would: then flags and threads could no longer be chosen."""
    started = "from jax._src import xla_bridge; print(json.dumps(list(xla_bridge._backends)))"
    assert _python("import jaxbiped", _NAMES, started) == []


@pytest.mark.parametrize(
    "lines",
    [
        ("import jaxbiped", "import jax.numpy as jnp"),
        ("import jax.numpy as jnp", "import jaxbiped"),
        ("import jax.numpy as jnp", "jnp.ones(3)", "import jaxbiped"),
        ("import jaxbiped.scene._ground", "import jax.numpy as jnp"),
    ],
)
def test_64_bits_in_any_order_of_imports(lines):
    assert _python(*lines, "print(json.dumps(str(jnp.ones(3).dtype)))") == "float64"


def test_the_map_is_the_stub_line_by_line():
    stub = ast.parse(Path(jb.__file__).with_suffix(".pyi").read_text())
    *lines, version = [node for node in stub.body if not isinstance(node, ast.Expr)]
    assert ast.unparse(version) == "__version__: str"
    assert all(isinstance(node, ast.ImportFrom) and len(node.names) == 1 for node in lines)
    names = [node.names[0] for node in lines]
    assert all(each.name == each.asname for each in names)
    assert [each.name for each in names] == jb.__all__
    assert set(jb.__all__) <= set(dir(jb))


def test_functions_go_before_the_packages_of_their_name():
    """Importing a package puts it into the one above, by its name."""
    lines = ("import jaxbiped.sweep._store, jaxbiped.simulate._start", "import jaxbiped as jb")
    kinds = "[type(each).__name__ for each in (jb.sweep, jb.simulate, jb.gait)]"
    assert _python(*lines, f"print(json.dumps({kinds}))") == ["function", "function", "module"]

    assert jb.sweep.__module__ == "jaxbiped.sweep._sweep"


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="'jaxbiped' has no attribute 'simulated'"):
        _ = jb.simulated


@pytest.mark.slow
def test_a_walk_without_pictures_imports_nothing_for_pictures():
    walk = "main(['walk', '--duration', '0.05'])"
    loaded = _python(
        "from jaxbiped.cli import main",
        f"try: {walk}",
        "except SystemExit: print(json.dumps(list(sys.modules)))",
    )
    assert not {"netCDF4", "scipy", "tqdm", *_LATER} & set(loaded)
    packages = {name.split(".")[1] for name in loaded if name.startswith("jaxbiped.")}
    assert not {"gait", "sweep", "optimise", "continuation", "plot"} & packages


def test_modules_become_attributes_of_the_package():
    """Names of the package's own must not hide those of its modules."""
    code = (
        "import sys, jaxbiped as jb, jaxbiped.cli, jaxbiped.compiler; jb.simulate\n"
        "names = [n.split('.')[1] for n in sys.modules if n.startswith('jaxbiped._')]\n"
        "assert names and all(getattr(jb, n) is sys.modules['jaxbiped.' + n] for n in names)\n"
        "assert jb.compiler is sys.modules['jaxbiped.compiler'] and callable(jb.simulate)"
    )
    told = subprocess.run(
        [sys.executable, "-W", "error::ImportWarning", "-c", code], capture_output=True, text=True
    )
    assert told.returncode == 0, told.stderr
