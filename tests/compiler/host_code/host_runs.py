"""What NumPy gives of a function of JAX, and what XLA gives."""

import jax
import numpy as np

from jaxbiped.compiler.host_code._host_jit import write_host_program


def written(function, given):
    """A host program of a function of several arrays, which takes them in a list."""
    return write_host_program(lambda leaves: function(*leaves), given)


def check_against_xla(function, *arrays, rtol=1e-14):
    """The results of a host program, held against XLA's: shapes, types and entries."""
    given = [np.asarray(each) for each in arrays]
    program = written(function, given)
    found = jax.tree.leaves(program(given))
    wanted = jax.tree.leaves(jax.jit(function)(*given))
    assert len(found) == len(wanted)
    for ours, theirs in zip(found, wanted, strict=True):
        assert np.shape(ours) == theirs.shape
        assert np.asarray(ours).dtype == theirs.dtype
        np.testing.assert_allclose(ours, theirs, rtol=rtol, atol=rtol)
    return found
