"""Starts that the options of `jaxbiped basin` choose."""

import csv
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped.cli._basin_options import StartsOptions, parse_axis
from jaxbiped.dynamics._state import State, rigid_state
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.sweep.starts._coordinates import check_coordinates
from jaxbiped.sweep.starts._samples import sample
from jaxbiped.sweep.starts._starts import AbstractStarts, GivenStarts, grid

_USUAL = ("theta_swing=-0.5:0.3:100", "omega_swing=-2:4:100")
"""Axes of a basin that nobody chose, and as many starts on each."""
_USUAL_RIGID = ("theta_stance=0:0.5:100", "omega_stance=-2.5:0:100")


def chosen_starts(options: StartsOptions, scene: Scene | RigidScene) -> AbstractStarts:
    """The starts; raises `ArgumentError`."""
    if options.starts is not None:
        return GivenStarts(read_starts(options.starts, scene))
    axes = _axes(options, scene)
    if options.samples is None:
        values = {name: np.linspace(a, b, count) for name, (a, b, count) in axes.items()}
        return grid(scene, values, place=options.place)
    bounds = {name: (low, high) for name, (low, high, _) in axes.items()}
    return sample(
        scene,
        bounds,
        options.samples,
        method=options.sampling,
        seed=options.seed,
        place=options.place,
    )


def _axes(options: StartsOptions, scene: Scene | RigidScene) -> dict[str, tuple[float, float, int]]:
    """First, last and count of each axis, the horizontal one last."""
    usual = _USUAL if scene.compliant else _USUAL_RIGID
    axes: dict[str, tuple[float, float, int]] = {}
    for text in options.axes or reversed(usual):
        name, axis = parse_axis(text)
        check_coordinates(scene, [name])
        if name in axes:
            raise ArgumentError(f"{name} is named by two axes: each needs its own.")
        axes[name] = axis
    return axes


def read_starts(path: Path, scene: Scene | RigidScene) -> object:
    """Starts from a CSV file, leaves of shape (n,); a rigid walker keeps its part of them.

    Raises:
        ArgumentError: no such file, another header, or an entry that is not a number.
    """
    wanted = ",".join(State._fields)
    try:
        with path.open(newline="") as file:
            rows = [[cell.strip() for cell in row] for row in csv.reader(file) if row]
    except (OSError, UnicodeDecodeError) as error:
        raise ArgumentError(
            f"starts = {str(path)!r} cannot be read ({error}): it must be a CSV file with the "
            f"header {wanted}."
        ) from None
    if not rows or rows[0] != list(State._fields):
        head = ",".join(rows[0]) if rows else ""
        raise ArgumentError(f"starts = {str(path)!r} has the header {head!r}: it must be {wanted}.")
    if len(rows) == 1:
        raise ArgumentError(f"starts = {str(path)!r} holds no starts: give at least one row.")
    numbers = []
    for line, row in enumerate(rows[1:], start=2):
        try:
            numbers.append([float(cell) for cell in row])
        except ValueError:
            raise ArgumentError(
                f"starts = {str(path)!r}, line {line}: {','.join(row)!r} is not all numbers."
            ) from None
        if len(row) != len(State._fields):
            raise ArgumentError(
                f"starts = {str(path)!r}, line {line}: {len(row)} numbers instead of "
                f"{len(State._fields)}."
            )
    whole = State(*[jnp.asarray(column) for column in np.array(numbers).T])
    return whole if scene.compliant else rigid_state(whole)
