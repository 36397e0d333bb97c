"""Search for the gaits that starts may converge to."""

from collections.abc import Mapping, Sequence

import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import as_float
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.scene._parameter_access import SomeScene, with_parameters
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.sweep._attractor import Attractor, attractor_without_radius, component_scales
from jaxbiped.sweep._effort import Effort
from jaxbiped.sweep._family import Family
from jaxbiped.sweep._radius import with_radius

_SAME = 1e-5
"""Distance in the components' sizes up to which two states on the section are of one gait, where
its convergence is quick."""


def find_family(
    scene: Scene | RigidScene,
    effort: Effort,
    *,
    parameters: Mapping[str, Sequence[float] | np.ndarray],
    guess: PyTree,
) -> Family:
    """The gait of one footstep for every combination of the parameters' values.

    Each search begins from the nearest gait found so far, the first from the guess, and one that
    fails goes on without a guess.
    """
    names = tuple(parameters)
    grids = np.meshgrid(*[np.asarray(parameters[name], float) for name in names], indexing="ij")
    table = np.stack([grid.ravel() for grid in grids], axis=1) if names else np.zeros((1, 0))
    spans = np.where(np.ptp(table, axis=0) > 0.0, np.ptp(table, axis=0), 1.0)
    rows: list[tuple[Attractor, ...]] = [()] * len(table)

    def near(k: int) -> list[PyTree]:
        """The state of the nearest gait that is known."""
        known = [j for j, row in enumerate(rows) if row]
        off = [float(np.linalg.norm((table[j] - table[k]) / spans)) for j in known]
        return [rows[known[int(np.argmin(off))]][0].state] if known else []

    # Forward, then back: a gait may be found from one side only.
    for k in [*range(len(table)), *reversed(range(len(table)))]:
        if not rows[k]:
            own = scene_with(scene, names, table[k])
            guesses = [*(near(k) or [guess]), None]
            rows[k] = tuple(with_radius(own, gait, effort) for gait in _found(own, guesses, 1))
    return _family(scene, names, table, tuple(rows), guess)


def with_gaits(
    scene: Scene | RigidScene,
    family: Family,
    effort: Effort,
    found: Mapping[int, Sequence[tuple[int, PyTree]]],
) -> Family:
    """The family with more gaits in some rows, searched from these cycles' footsteps and states."""
    rows = list(family.rows)
    for k, guesses in found.items():
        own = scene_with(scene, family.names, family.table[k])
        for length, guess in guesses:
            scales = family.scales[k]
            new = [
                with_radius(own, gait, effort)
                for gait in _found(own, [guess], length)
                if not any(_same(gait, old, scales) for old in rows[k])
            ]
            # Stable by the cycles' lengths, from which positions follow.
            rows[k] = tuple(sorted([*rows[k], *new], key=lambda gait: gait.cycle_footsteps))
    # What starts take that they are not told stays, else they would be other starts.
    return family._replace(rows=tuple(rows))


def scene_with(scene: SomeScene, names: Sequence[str], values: np.ndarray) -> SomeScene:
    """The scene of one combination of parameters."""
    changed = with_parameters(scene, dict(zip(names, values, strict=True)))
    return jtu.tree_map(as_float, changed)


def _found(
    scene: Scene | RigidScene, guesses: Sequence[PyTree], length: int
) -> tuple[Attractor, ...]:
    """The stable gait that the first successful guess leads to, of its minimal cycle, or none.

    Its radius is not known yet.
    """
    for guess in guesses:
        near, count = guess, length
        while True:
            gait = find_gait(
                scene,
                None if near is None else jtu.tree_map(as_float, near),
                footsteps=count,
                parameters=(),
                radius_sensitivities=False,
            )
            least = int(gait.cycle_footsteps)
            if not bool(gait.stable) or least == count:
                break
            near, count = gait.measures.state, least
        if bool(gait.stable):
            return (attractor_without_radius(scene, gait),)
    return ()


def _family(
    scene: Scene | RigidScene,
    names: tuple[str, ...],
    table: np.ndarray,
    rows: tuple[tuple[Attractor, ...], ...],
    guess: PyTree,
) -> Family:
    known = [k for k, row in enumerate(rows) if row]
    states, scales = [], []
    for k, values in enumerate(table):
        near = min(known, key=lambda j: (abs(j - k), j)) if known else None
        state = guess if near is None else rows[near][0].state
        states.append(jtu.tree_map(np.asarray, state))
        scales.append(component_scales(scene_with(scene, names, values), state))
    return Family(names, table, rows, tuple(states), np.stack(scales))


def _same(a: Attractor, b: Attractor, scales: np.ndarray) -> bool:
    """Whether two finds are of one orbit, which may begin at any of its crossings."""
    off = np.linalg.norm((a.point - b.crossings) / scales, axis=1)
    # Where hardly anything is left out of a cycle's change, Newton's residual says little.
    return a.cycle_footsteps == b.cycle_footsteps and bool(
        off.min() < _SAME / (1.0 - b.contraction)
    )
