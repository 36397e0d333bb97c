"""Compilation of a search and of what summarises it, at the same time and once for each kind."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import equinox as eqx
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._progress import stage
from jaxbiped.caching._caches import PROGRAMS, Once, bounded_cache
from jaxbiped.compiler import deferred_checks
from jaxbiped.gait._fixed_point_search import FixedPointProblem
from jaxbiped.gait._gait_summary import summarise_gait
from jaxbiped.gait._search_provenance import Origin


def compile_once(
    search: Any,
    problem: FixedPointProblem,
    asked: FixedPointProblem,
    names: tuple[str, ...],
    radius: bool,
    origin: Origin,
) -> None:
    """Compiles what is not compiled yet for this kind of search and what is asked of its gait."""
    once = _compilation_of(_kind_of((problem, names, radius)))
    once(lambda: _compile(search, problem, asked, names, radius, origin))


@bounded_cache(PROGRAMS)
def _compilation_of(kind: tuple[object, ...]) -> Once[None]:
    return Once()


def _compile(search: Any, problem: FixedPointProblem, asked: FixedPointProblem, *more: Any) -> None:
    """Compiles both programs, and what lanes run for them, at the same time."""
    told = stage("compiling the search (first time for this kind of scene)")
    with told, ThreadPoolExecutor() as meanwhile:
        with deferred_checks() as programs:
            # What takes lanes longest begins first.
            begun = search.begin(problem)
            ready = [meanwhile.submit(begun.finish)]
            no_result = _empty_arrays(begun.result)
            ready.append(meanwhile.submit(summarise_gait.begin(asked, no_result, *more).finish))
        try:
            for program in programs:
                program.check()
        except BaseException:
            search.clear()  # it would be found compiled, and fail where XLA runs it
            raise
        for each in ready:
            each.result()


def _kind_of(tree: PyTree) -> tuple[object, ...]:
    """What decides whether one compiled program can serve for another."""
    arrays, rest = eqx.partition(tree, eqx.is_array)
    shapes = tuple((leaf.shape, leaf.dtype) for leaf in jtu.tree_leaves(arrays))
    leaves, structure = jtu.tree_flatten(rest)
    return jtu.tree_structure(arrays), shapes, tuple(leaves), structure


def _empty_arrays(shape: PyTree) -> PyTree:
    return jtu.tree_map(
        # Made by NumPy: JAX would compile a program for every shape.
        lambda leaf: np.full(leaf.shape, np.nan if leaf.dtype.kind == "f" else 0, leaf.dtype),
        shape,
    )
