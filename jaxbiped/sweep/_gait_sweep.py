"""Sweeps of gaits over parameters: each point is searched from its neighbours on the grid."""

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped._identity import provenance
from jaxbiped._progress import stage
from jaxbiped._types import as_float, rows_of
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._state import recurring_leaves
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._search_starts import default_guess
from jaxbiped.scene._parameter_access import (
    parameter_quantities,
    parameter_values,
    scene_identity,
    select_parameters,
    with_parameters,
)
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.sweep._gait_grid import LARGE, Place, open_gait_grid
from jaxbiped.sweep._gait_waves import GaitWaves
from jaxbiped.sweep._store_files import store_path, what_is_kept
from jaxbiped.sweep.starts._coordinates import parameter_axes

if TYPE_CHECKING:
    import xarray

AnyScene: TypeAlias = Scene | RigidScene | RedundantScene

_FEW, _MANY = 16, 256
"""Searches in a batch: every size is a program that XLA compiles."""


def gait_sweep(
    scene: AnyScene,
    over: Mapping[str, Sequence[float] | np.ndarray],
    *,
    parameters: tuple[str, ...] | None = None,
    footsteps: int | None = None,
    accuracy: str = "balanced",
    radius_sensitivities: bool = True,
    engine: str = "auto",
    store: str | Path | None = None,
    progress: bool | None = None,
    any_version: bool = False,
) -> "xarray.Dataset":
    """Finds the periodic gait at every point of a grid over scene parameters.

    The search begins without a guess at the point nearest to the scene's own parameters, and
    proceeds outwards. Each point starts from an extrapolation of its neighbours' gaits, so one
    branch is followed. If that gives no stable gait, Newton's method starts from the neighbours,
    and then the point is searched without a guess; a gait that this finds is followed to the
    neighbours.

    With the lanes engine, a grid of 64 points or more is searched in waves, all points of a wave at
    once: first a coarse lattice from its middle outwards, then finer ones from interpolated states.
    If a search without a guess finds nothing better there, it also speaks for the points up to two
    strides of the coarse lattice away, except those between two points with a better gait and,
    on the coarse lattice, those next to one.

    Args:
        scene: the walker; parameters that are not swept keep their values.
        over: values of each swept parameter by name (see `parameter_names`), arrays of shape (k,).
        parameters, footsteps, accuracy, radius_sensitivities, engine: as for `find_gait`.
        store: directory or address of a Zarr store (see `sweep`), from which an interrupted run
            continues. Default: in memory.
        progress: whether to show on stderr what is being done, how far it is and what was found; by
            default (None) after two seconds, in a terminal, a notebook or a command.
        any_version: whether to continue a store that another version of jaxbiped wrote.

    Returns:
        A dataset along the swept parameters, in SI units: the measures, `state_…`, multipliers,
        `sensitivity_…` with errors along `parameter`, `ending`, `found_by` and `branch_end` (codes,
        with names in the attributes), and `grazes` (see `Gait`). NaN where no gait was found; a
        `RuntimeWarning` says at how many points, and how they were searched (`found_by` is that of
        the last search). Another is issued if gaits graze a switch.

    Raises:
        ArgumentError: an argument is not allowed (raised before anything is compiled); or the store
            has other settings or cannot be written.
        ResourceError: the disk is full. The contents of the store are kept.
    """
    scene = check_scene(scene, Scene, RigidScene, RedundantScene)
    if not isinstance(over, Mapping) or not over:
        raise ArgumentError(
            f"over = {over!r} is not allowed: map one parameter's name or more to its values, "
            'such as {"K": [1e6, 2e6]}.'
        )
    values = parameter_axes(scene, over, "over")
    select_parameters(scene.minimal, parameters)  # which refuses what is no name
    path = store_path(store)
    options: dict[str, Any] = dict(
        parameters=parameters,
        footsteps=footsteps,
        accuracy=accuracy,
        radius_sensitivities=radius_sensitivities,
    )
    own = scene_identity(scene)
    settings = {
        "scene": own["scene"],
        "models": own["model"],
        "over": {name: column.tolist() for name, column in values.items()},
        "options": {**options, "parameters": None if parameters is None else list(parameters)},
    }
    centre = _nearest(scene, values)

    def scene_at(place: Place) -> AnyScene:
        point = {name: values[name][i] for name, i in zip(values, place, strict=True)}
        return with_parameters(scene, point)

    size = math.prod(map(len, values.values()))
    with stage(
        "finding gaits", total=size, unit="gaits", show=progress, kept=what_is_kept(path)
    ) as now:
        first = find_gait(scene_at(centre), engine=engine, **options)
        kind = type(first.measures.state)
        at_once = size >= LARGE and first.engine == "lanes"

        def search_alone(place: Place) -> Gait:
            return (
                first if place == centre else find_gait(scene_at(place), engine=engine, **options)
            )

        def start_at(place: Place) -> np.ndarray:
            return np.array(recurring_leaves(default_guess(scene_at(place))), float)

        def find(places: Sequence[Place], guesses: np.ndarray) -> Iterator[tuple[slice, Gait]]:
            if at_once:
                columns = zip(values, np.transpose(places), strict=True)
                chosen = {name: values[name][rows] for name, rows in columns}
                yield from find_each(scene, chosen, guesses, kind, options)
                return
            for k, (place, guess) in enumerate(zip(places, guesses, strict=True)):
                start = jtu.tree_map(as_float, kind(0.0, *guess))
                gait = find_gait(scene_at(place), start, engine=engine, **options)
                yield slice(k, k + 1), rows_of(gait, None)

        quantities = parameter_quantities(scene)
        grid = open_gait_grid(
            first, values, quantities, settings, provenance(scene), path, any_version=any_version
        )
        try:
            GaitWaves(grid, (centre, first), find, start_at, search_alone, now).run()
            grid.warn_of_missing()
            if at_once:
                grid.warn_of_grazing()
            return grid.dataset()
        except KeyboardInterrupt:
            grid.flush()  # what was found is not lost
            raise


def find_each(
    scene: AnyScene,
    values: Mapping[str, np.ndarray],
    starts: np.ndarray,
    state: type,
    options: Mapping[str, Any],
) -> Iterator[tuple[slice, Gait]]:
    """The gaits that lanes come to, batch by batch: which of the n, and these with a first axis.

    Args:
        scene: the walker.
        values: of the parameters that differ, shape (n,) each.
        starts: states without `ROOT_x`, shape (n, m), of the type `state`.
        options: those of `find_gait`. Gaits have no orbits.
    """
    count, first = len(starts), 0
    scene = jtu.tree_map(as_float, scene)
    while first < count:
        size = _MANY if count - first > 3 * _FEW else _FEW
        part = slice(first, min(first + size, count))
        kept = part.stop - first
        missing = size - kept
        # A search from nowhere ends at once: it fills the batch.
        rows = np.pad(starts[part], ((0, missing), (0, 0)), constant_values=np.nan)
        columns = {k: np.pad(v[part], (0, missing), mode="edge") for k, v in values.items()}
        begin = state(np.zeros(size), *np.ascontiguousarray(rows.T))
        gaits = _find_each(scene, columns, begin, dict(options))
        yield part, rows_of(gaits, slice(kept))
        first = part.stop


@cached_jit
def _find_each(
    scene: AnyScene, values: dict[str, np.ndarray], starts: PyTree, options: dict[str, Any]
) -> Gait:
    def one(values: dict[str, np.ndarray], start: PyTree) -> Gait:
        own = jtu.tree_map(jnp.asarray, with_parameters(scene, values))
        # Times and states of all steps would take more memory than all else.
        gait = find_gait(own, start, **options)
        return dataclasses.replace(gait, orbit=None)  # type: ignore[arg-type]

    return jax.vmap(one)(values, starts)


def _nearest(scene: AnyScene, values: dict[str, np.ndarray]) -> Place:
    """The point of the grid nearest to the scene's own parameters."""
    own = parameter_values(scene)
    return tuple(int(np.argmin(np.abs(v - float(own[name])))) for name, v in values.items())
