"""Host arrays: operations of JAX on arrays that NumPy lacks, or has under other rules."""

import operator
from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxbiped.compiler.ir._elementary_functions import whole_power
from jaxbiped.compiler.ir._primitives import padded as padded


def divide_whole(a: Any, b: Any) -> Any:
    """Quotient of whole numbers, rounded towards zero; −1 by zero."""
    quotient = np.abs(a) // np.where(b == 0, 1, np.abs(b))
    return np.where(b == 0, -1, np.sign(a) * np.sign(b) * quotient).astype(np.result_type(a))[()]


def power_of(a: Any, exponent: int) -> Any:
    """A whole power; see `whole_power`."""
    return whole_power(a, exponent, operator.mul, operator.truediv, np.ones_like)[()]


def dynamic_slice(operand: np.ndarray, sizes: tuple[int, ...], *starts: Any) -> np.ndarray:
    """A part from these places, moved inwards where it would reach beyond the end."""
    return operand[
        tuple(
            slice(low := min(max(int(start), 0), n - size), low + size)
            for start, size, n in zip(starts, sizes, operand.shape, strict=True)
        )
    ]


def gather(
    operand: np.ndarray, indices: np.ndarray, numbers: Any, sizes: tuple[int, ...], fill: Any
) -> np.ndarray:
    """JAX's gather; `fill` beyond the end, or None to be moved inwards there."""
    dropped = (*numbers.collapsed_slice_dims, *numbers.operand_batching_dims)
    batch = indices.shape[:-1]
    count = len(batch) + len(numbers.offset_dims)
    axes = [i for i in range(count) if i not in numbers.offset_dims]
    where, inside = _places(
        operand.shape,
        indices,
        sizes,
        dropped=dropped,
        mapped=numbers.start_index_map,
        operand_batch=numbers.operand_batching_dims,
        indices_batch=numbers.start_indices_batching_dims,
        clips=fill is None,
    )
    found = operand[where]
    if fill is not None:
        found = np.where(inside, found, np.asarray(fill, operand.dtype))
    return np.moveaxis(found, range(count), [*axes, *numbers.offset_dims])


def replaced(operand: np.ndarray, place: Any, value: Any) -> np.ndarray:
    """An array with one entry replaced, unless there is none at this place."""
    whole = operand.copy()
    places = tuple(map(int, place))
    if all(0 <= i < n for i, n in zip(places, operand.shape, strict=True)):
        whole[places] = value
    return whole


def scatter(
    operand: np.ndarray,
    indices: np.ndarray,
    updates: np.ndarray,
    numbers: Any,
    *,
    clips: bool,
    adds: bool,
) -> np.ndarray:
    """JAX's scatter; what lies beyond the end is dropped, or moved inwards where it `clips`."""
    dropped = (*numbers.inserted_window_dims, *numbers.operand_batching_dims)
    window = list(numbers.update_window_dims)
    batch = [i for i in range(np.ndim(updates)) if i not in window]
    given = np.transpose(updates, batch + window)
    kept = [i for i in range(operand.ndim) if i not in dropped]
    sizes = [1] * operand.ndim
    for axis, size in zip(kept, given.shape[len(batch) :], strict=True):
        sizes[axis] = size
    where, inside = _places(
        operand.shape,
        indices,
        tuple(sizes),
        dropped=dropped,
        mapped=numbers.scatter_dims_to_operand_dims,
        operand_batch=numbers.operand_batching_dims,
        indices_batch=numbers.scatter_indices_batching_dims,
        clips=clips,
    )
    whole = operand.copy()
    taken = tuple(np.broadcast_to(each, given.shape)[inside] for each in where)
    if adds:
        np.add.at(whole, taken, given[inside])
    else:
        whole[taken] = given[inside]
    return whole


def _places(
    shape: tuple[int, ...],
    indices: np.ndarray,
    sizes: tuple[int, ...],
    *,
    dropped: Sequence[int],
    mapped: Sequence[int],
    operand_batch: Sequence[int],
    indices_batch: Sequence[int],
    clips: bool,
) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
    """Of every entry of windows, batch axes first, its place in the operand, and if it has one."""
    batch = indices.shape[:-1]
    kept = [axis for axis in range(len(shape)) if axis not in dropped]
    whole = (*batch, *(sizes[axis] for axis in kept))
    where, inside = [], np.ones(whole, bool)
    for axis, (n, size) in enumerate(zip(shape, sizes, strict=True)):
        start = np.zeros(batch, np.int64)
        if axis in mapped:
            start = indices[..., list(mapped).index(axis)].astype(np.int64)
        elif axis in operand_batch:
            along = indices_batch[list(operand_batch).index(axis)]
            start = np.arange(n).reshape([-1 if i == along else 1 for i in range(len(batch))])
            start = np.broadcast_to(start, batch)
        ok = (start >= 0) & (start <= n - size)
        start = np.clip(start, 0, max(0, n - size))
        place = np.reshape(start, (*batch, *[1] * len(kept)))
        if not clips:
            inside &= np.reshape(ok, place.shape)
        if axis in kept:
            steps = [-1 if each == axis else 1 for each in kept]
            place = place + np.arange(size).reshape((*[1] * len(batch), *steps))
        where.append(place)
    return tuple(np.broadcast_to(each, whole) for each in where), inside


def sorted_by(arrays: Sequence[np.ndarray], axis: int, keys: int) -> list[np.ndarray]:
    """Arrays in the order of the first of them, equal ones as they were."""
    order = np.argsort(arrays[0], axis=axis, kind="stable")
    if keys > 1:
        order = np.lexsort(arrays[keys - 1 :: -1], axis=axis)
    return [np.take_along_axis(each, order, axis) for each in arrays]


def factors_of(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """L and U in one, LAPACK's pivots from 0, and the rows' permutation."""
    from scipy.linalg import lapack

    factors, pivots, failed = lapack.dgetrf(matrix)
    rows = list(range(len(matrix)))
    for i, j in enumerate(pivots.tolist()):
        rows[i], rows[j] = rows[j], rows[i]
    if failed < 0:
        factors = np.full_like(factors, np.nan)
    return factors, pivots.astype(np.int32), np.array(rows, np.int32)


def triangular(
    a: np.ndarray, b: np.ndarray, *, left: bool, lower: bool, transposed: bool, unit: bool
) -> np.ndarray:
    """X of A X = B, or of X A = B."""
    # As XLA does. LAPACK's own refuses a zero on the diagonal, and wakes threads.
    from scipy.linalg import blas

    how = dict(side=not left, lower=lower, trans_a=transposed, diag=unit)
    return np.asarray(blas.dtrsm(1.0, a, b, **how))


def eigensystem_of(matrix: np.ndarray, *, left: bool, right: bool) -> list[np.ndarray]:
    """Eigenvalues with left and right eigenvectors, those that are asked for."""
    from scipy.linalg import lapack

    real, imag, lefts, rights, failed = lapack.dgeev(matrix, compute_vl=left, compute_vr=right)
    values = real + 1j * imag
    found = [values]
    for vectors, wanted in ((lefts, left), (rights, right)):
        if wanted:
            found.append(_complex_vectors(vectors, imag))
    return [np.full_like(each, np.nan) for each in found] if failed else found


def singular_system_of(matrices: np.ndarray, *, full: bool, vectors: bool) -> list[np.ndarray]:
    """Singular values of matrices (…, n, k), with left and right vectors where asked for."""
    known = np.isfinite(matrices).all(axis=(-2, -1))
    # LAPACK's iteration does not end well on what is no number.
    finite = np.where(known[..., None, None], matrices, 0.0)
    if vectors:
        left, values, right = np.linalg.svd(finite, full_matrices=full)
        found = [values, left, right]
    else:
        found = [np.linalg.svd(finite, compute_uv=False)]
    spare = [each.ndim - known.ndim for each in found]
    held = [known.reshape(known.shape + (1,) * count) for count in spare]
    return [np.where(own, each, np.nan) for own, each in zip(held, found, strict=True)]


def _complex_vectors(vectors: np.ndarray, imag: np.ndarray) -> np.ndarray:
    """LAPACK tells of a pair the real part and then the imaginary one."""
    found = vectors.astype(np.complex128)
    for k in np.flatnonzero(imag > 0.0).tolist():
        found[:, k] = vectors[:, k] + 1j * vectors[:, k + 1]
        found[:, k + 1] = np.conj(found[:, k])
    return found
