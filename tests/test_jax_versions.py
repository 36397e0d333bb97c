"""What is used of JAX's private names, and primitives of single versions against their formulae."""

import ast

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped._jax_versions import called_program, scan_counts, tanh
from tests.compiler.host_code.host_runs import check_against_xla
from tests.compiler.one_shot import evaluate
from tests.import_graph import PACKAGE

PRIVATE = {
    ("_jax_versions.py", "jax._src.core.eval_context"),
    ("_jax_versions.py", "jax._src.core.top_axis_env"),
    ("_jax_versions.py", "jax._src.core.trace_ctx"),
    ("_jax_versions.py", "jax._src.core.trace_state_clean"),
    ("_jax_versions.py", "jax._src.interpreters.batching.BatchTracer"),
    ("_jax_versions.py", "jaxlib.lapack"),
    ("_jax_versions.py", "jaxlib.mlir.ir"),
    ("gait/_return_map.py", "equinox.internal"),
    ("compiler/_fusion_barrier.py", "equinox.internal"),
    ("solve/rosenbrock/_rosenbrock_solver.py", "equinox.internal.ω"),
    ("sweep/_label_recorders.py", "equinox.internal"),
}
"""Each name that no other package promises to keep, and where it is used."""


def _imported(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _is_private(name):
    parts = name.split(".")
    if parts[0] in ("jaxbiped", "__future__"):
        return False
    return parts[0] == "jaxlib" or any(p.startswith("_") or p == "internal" for p in parts)


def test_every_private_name_of_another_package_is_listed():
    used = {
        (str(path.relative_to(PACKAGE)), name)
        for path in PACKAGE.rglob("*.py")
        for name in _imported(path)
        if _is_private(name)
    }
    assert used == PRIVATE


def _equation(function, *arguments):
    (equation,) = jax.make_jaxpr(function)(*arguments).eqns
    return equation


def test_operands_of_a_scan_are_counted():
    def scan(a, b, c, items):
        return jax.lax.scan(lambda y, x: ((y[0] * a + x, 2.0 * y[1]), y[1]), (b, c), items)

    equation = _equation(scan, 2.0, 0.0, 1.0, jnp.arange(3.0))
    assert scan_counts(equation.params) == (1, 2)
    assert len(equation.invars) == 1 + 2 + 1


@jax.custom_jvp
def _with_own_derivative(x):
    return 3.0 * x


_with_own_derivative.defjvps(lambda dx, y, x: 3.0 * dx)


@pytest.mark.parametrize(
    "call",
    [jax.jit(lambda x: 3.0 * x), jax.checkpoint(lambda x: 3.0 * x), _with_own_derivative],
    ids=["jit", "checkpoint", "custom_jvp"],
)
def test_what_only_calls_is_looked_into(call):
    called = called_program(_equation(call, 1.0))
    assert [equation.primitive.name for equation in called[0].eqns] == ["mul"]
    assert called_program(_equation(lambda x: 3.0 * x, 1.0)) is None


POINTS = np.array([-0.75, -0.3, 1e-9, 0.3, 0.999999])


@pytest.mark.parametrize(
    ("function", "expected"),
    [
        (jax.grad(jnp.tanh), lambda x: 1.0 / np.cosh(x) ** 2),
        (jax.grad(tanh), lambda x: 1.0 / np.cosh(x) ** 2),
        (lambda x: jnp.log2(jnp.abs(x)), lambda x: np.log2(np.abs(x))),
        (lambda x: jnp.polyval(jnp.array([2.0, 3.0, 4.0]), x), lambda x: (2 * x + 3) * x + 4),
        (jax.grad(lambda x: jnp.hypot(x, 2.0)), lambda x: x / np.hypot(x, 2.0)),
        (jax.grad(lambda x: jnp.maximum(x, 0.25)), lambda x: 1.0 * (x > 0.25)),
        (jax.grad(lambda x: jnp.minimum(x, x * x)), lambda x: np.where(x < 0, 1.0, 2.0 * x)),
    ],
    ids=["tanh", "own tanh", "log2", "polynomial", "hypot", "max", "min"],
)
def test_primitives_of_single_versions(function, expected):
    np.testing.assert_allclose(evaluate(function, POINTS), expected(POINTS), rtol=2e-15)
    (on_host,) = check_against_xla(jax.vmap(function), POINTS)
    np.testing.assert_allclose(on_host, expected(POINTS), rtol=2e-15)
