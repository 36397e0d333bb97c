"""Reading and writing at places in host programs, held against XLA's."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.compiler.host_code.host_runs import check_against_xla

X = np.arange(24.0).reshape(4, 6) ** 1.5
PLACES = np.array([3, 0, 2])

CASES = {
    "rows": lambda x, i: x[i],
    "columns": lambda x, i: x[:, i],
    "entries": lambda x, i: x[i, i + 1],
    "one entry": lambda x, i: x[i[0], i[1]],
    "one row": lambda x, i: x[i[2]],
    "from the end": lambda x, i: (x[-i], x[-1]),
    "beyond the end": lambda x, i: x.at[i + 2].get(mode="fill", fill_value=-1.0),
    "beyond, not a number": lambda x, i: x.at[i + 2].get(mode="fill"),
    "beyond, of other types": lambda x, i: [
        x.astype(kind).at[i + 2].get(mode="fill") for kind in ("bool", "int32", "float32")
    ],
    "moved inwards": lambda x, i: x.at[i + 2].get(mode="clip"),
    "a window": lambda x, i: jax.lax.dynamic_slice(x, (i[0], i[1]), (2, 3)),
    "each row its own": lambda x, i: jax.vmap(lambda row, k: row[k])(x[:3], i),
    "each row a window": lambda x, i: jax.vmap(
        lambda row, k: jax.lax.dynamic_slice(row, (k,), (2,))
    )(x[:3], i),
    "along an axis": lambda x, i: jnp.take_along_axis(x[:3], i[:, None], axis=1),
    "transposed rows": lambda x, i: jax.vmap(lambda column: column[i], in_axes=1)(x),
    "set: rows": lambda x, i: x.at[i].set(1.0),
    "set: entries": lambda x, i: x.at[i, i].set(x[0, :3]),
    "set: one entry": lambda x, i: x.at[i[0], i[1]].set(-1.0),
    "set: one sum": lambda x, i: x.at[i[0], i[1]].add(-1.0),
    "set: no sum": lambda x, i: x.at[i[0] + 9, i[1]].add(-1.0),
    "set: one of a row": lambda x, i: x[0].at[i[0]].set(jnp.nan),
    "set: none": lambda x, i: x[0].at[i[0] + 20].set(-1.0),
    "set: beyond the end": lambda x, i: x.at[i + 2].set(-1.0),
    "set: moved inwards": lambda x, i: x.at[i[0] + 9].set(-1.0, mode="clip"),
    "set: sums": lambda x, i: x.at[i - i].add(x[:3]),
    "set: columns": lambda x, i: x.at[:, i].set(x[:, :3]),
    "set: each row its own": lambda x, i: jax.vmap(lambda row, k: row.at[k].set(0.5))(x[:3], i),
}


@pytest.mark.parametrize("known", [True, False], ids=["known places", "told places"])
@pytest.mark.parametrize("name", CASES)
def test_reading_and_writing(name, known):
    if known:
        check_against_xla(lambda x: CASES[name](x, jnp.asarray(PLACES)), X)
    else:
        check_against_xla(CASES[name], X, PLACES)
