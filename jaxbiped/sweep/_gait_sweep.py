"""Sweeps of gaits over parameters: each point is searched from its neighbours on the grid."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree
from tqdm import tqdm

from jaxbiped._checks import ArgumentError
from jaxbiped._files import user_path
from jaxbiped._identity import provenance
from jaxbiped._types import as_float
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.scene._parameter_access import (
    parameter_quantities,
    parameter_values,
    scene_identity,
    with_parameters,
)
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.sweep._gait_grid import open_gait_grid
from jaxbiped.sweep._gait_waves import GaitWaves
from jaxbiped.sweep._grid_waves import LARGE, Place, neighbours, rings
from jaxbiped.sweep._store_files import check_store
from jaxbiped.sweep.starts._coordinates import parameter_axes

if TYPE_CHECKING:
    import xarray

AnyScene: TypeAlias = Scene | RigidScene | RedundantScene


def gait_sweep(
    scene: AnyScene,
    over: Mapping[str, Sequence[float] | np.ndarray],
    *,
    parameters: tuple[str, ...] | None = None,
    footsteps: int = 1,
    accuracy: str = "balanced",
    radius_sensitivities: bool = True,
    engine: str = "auto",
    store: str | Path | None = None,
    progress: bool = False,
    any_version: bool = False,
) -> "xarray.Dataset":
    """Finds the periodic gait at every point of a grid over scene parameters.

    The search begins at the point nearest to the scene's own parameters, without a guess, and goes
    on from neighbour to neighbour, so that one branch is followed. Where a neighbour's gait leads
    to none, or to an unstable one, the point is searched without a guess as well; what failed is
    tried once more from neighbours that were found later.

    By lanes a grid of 64 points or more is searched in waves, all points of a wave at once: a
    coarse lattice from its middle outwards, then each finer one from interpolated states. Where
    that leads to no stable gait, Newton's method begins from neighbours; then, where there is no
    gait or the point is of the coarse lattice, the point is searched without a guess, and stable
    gaits that this finds lead on to their neighbours'.

    Args:
        scene: the walker; parameters that are not swept keep its values.
        over: values of each swept parameter by name (see `parameter_names`), shape (k,) each.
        parameters, footsteps, accuracy, radius_sensitivities, engine: as for `find_gait`.
        store: directory of a Zarr store; in memory unless given. A run that was killed continues
            where it was.
        progress: whether to show a bar on stderr.
        any_version: whether to continue a store that another version of jaxbiped wrote.

    Returns:
        A dataset along the swept parameters, SI units: the measures, `state_…`, multipliers,
        `sensitivity_…` and their errors along `parameter`, `ending`, `found_by` and `branch_end`
        (codes, whose names are in the attributes), and `grazes`, see `Gait`; NaN where there is no
        gait. A `RuntimeWarning` tells where gaits graze a switch.

    Raises:
        ArgumentError: an argument that is not allowed, before anything is compiled; a store of
            other settings, or one that may not be written.
        ResourceError: a full disk. What is in the store stays.
    """
    scene = check_scene(scene, Scene, RigidScene, RedundantScene)
    values = _check_values(scene, over)
    path = None if store is None else user_path(store, "store")
    if path is not None:
        check_store(path)
        path = path.absolute()
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
    shape = tuple(map(len, values.values()))
    states: dict[Place, PyTree] = {}
    centre = _nearest(scene, values)
    order = [place for ring in rings(shape, centre) for place in ring]

    def scene_at(place: Place) -> AnyScene:
        point = {name: values[name][i] for name, i in zip(values, place, strict=True)}
        own: AnyScene = jtu.tree_map(as_float, with_parameters(scene, point))
        return own

    def search_alone(place: Place) -> Gait:
        return find_gait(scene_at(place), engine=engine, **options)

    def search(place: Place, *, again: bool) -> Gait | None:
        """The gait there; none again where no neighbour has one."""
        near = [states[at] for at in neighbours(place, shape) if states.get(at) is not None]
        if again and not near:
            return None
        return _find(scene_at(place), near, options | {"engine": engine}, alone=not again)

    first = search_alone(centre)
    units = {name: parameter_quantities(scene)[name].unit for name in values}
    grid = open_gait_grid(
        first, values, units, settings, provenance(scene), path, any_version=any_version
    )
    with tqdm(total=math.prod(shape), unit="gaits", disable=not progress) as bar, grid.open():
        if math.prod(shape) >= LARGE and first.engine == "lanes":
            if not grid.is_done(centre, found=False):
                grid.write(centre, first)
            GaitWaves(scene, values, (centre, first), grid, options, search_alone, bar.update).run()
            grid.warn_of_grazing()
            return grid.dataset()
        for again in (False, True):
            for place in order:
                if not grid.is_done(place, found=again):
                    gait = search(place, again=again) if place != centre or again else first
                    # What the first pass found out about a failure is kept.
                    if gait is not None and (not again or gait.outcome is Search.FOUND):
                        grid.write(place, gait)
                states[place] = grid.state(place)
                bar.update(not again)
        return grid.dataset()


def _find(scene: AnyScene, near: list[PyTree], options: dict[str, Any], *, alone: bool) -> Gait:
    """The gait that a neighbour's leads to; the search's own where that is none or not stable."""
    best: Gait | None = None
    for state in near[:2]:
        gait = find_gait(scene, jtu.tree_map(as_float, state), **options)
        if bool(gait.stable):
            return gait
        if best is None or gait.outcome is Search.FOUND:
            best = gait
    if alone or best is None:
        gait = find_gait(scene, **options)
        if best is None or bool(gait.stable) or best.outcome is not Search.FOUND:
            best = gait
    return best


def _check_values(
    scene: AnyScene, over: Mapping[str, Sequence[float] | np.ndarray]
) -> dict[str, np.ndarray]:
    if not isinstance(over, Mapping) or not over:
        raise ArgumentError(
            f"over = {over!r} is not allowed: map one parameter's name or more to its values, "
            'such as {"K": [1e6, 2e6]}.'
        )
    return parameter_axes(scene, over, "over")


def _nearest(scene: AnyScene, values: dict[str, np.ndarray]) -> Place:
    """The point of the grid nearest to the scene's own parameters."""
    own = parameter_values(scene)
    return tuple(int(np.argmin(np.abs(v - float(own[name])))) for name, v in values.items())
