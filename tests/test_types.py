"""Arrays from NumPy, against JAX's own operations; no program is compiled for them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax._src import monitoring

from jaxbiped._types import as_array, as_float, by_numpy, in_parts


@pytest.fixture
def compiled():
    """Names of what is compiled meanwhile."""
    told = []

    def note(event, _, **about):
        if event.endswith("backend_compile_duration"):
            told.append(about.get("fun_name"))

    jax.monitoring.register_event_duration_secs_listener(note)
    yield told
    monitoring.unregister_event_duration_listener(note)


def _root(numpy, a, b):
    return numpy.sqrt(a / b)


def test_by_numpy_nothing_is_compiled(compiled):
    """Shapes that no other test has: what was compiled once is not told again."""
    a, b = as_array(np.linspace(1.0, 2.0, 41)), as_float(3.0)
    found = by_numpy(_root, a, b)
    assert compiled == []
    assert isinstance(found, jax.Array)
    np.testing.assert_allclose(found, jnp.sqrt(a / b), rtol=1e-15)
    assert compiled != []


@pytest.mark.parametrize(("count", "calls"), [(0, 1), (1, 1), (4, 1), (5, 2), (9, 3)])
def test_parts_are_of_one_size_and_no_more_than_needed(count, calls):
    """Rows are told once and in their order, however the last part is filled up."""
    sizes = []

    def doubled(tree):
        sizes.append(len(tree["a"]))
        return {"twice": 2.0 * tree["a"]}

    rows = np.arange(2.0 * count).reshape(count, 2)
    found = in_parts(doubled, {"a": rows}, 4)
    np.testing.assert_array_equal(found["twice"], 2.0 * rows)
    assert sizes == [4] * calls


def test_what_is_traced_stays_in_the_trace():
    found = jax.jit(lambda a: by_numpy(_root, a, 3.0))(jnp.linspace(1.0, 2.0, 5))
    np.testing.assert_allclose(found, np.sqrt(np.linspace(1.0, 2.0, 5) / 3.0), rtol=1e-15)
    assert jax.grad(lambda a: by_numpy(_root, a, 3.0))(3.0) == pytest.approx(1.0 / 6.0)


def test_plain_numbers_stay_plain():
    assert type(by_numpy(lambda _, a, b: a - b, 3.0, 1.0)) is float


def test_what_a_caller_changes_later_does_not_matter():
    own = np.ones(4096)
    kept = as_float(own)
    own[:] = 2.0
    np.testing.assert_array_equal(kept, np.ones(4096))
