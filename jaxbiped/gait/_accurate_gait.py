"""Gait to a wanted accuracy, with error bars by two witnesses.

One is the ten times looser solve that every gait has beside it, the other another method of steps.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import QUANTITIES, Gait, Measures
from jaxbiped.gait._return_map_spec import orbit_solver
from jaxbiped.gait._search_provenance import unknown_derivatives
from jaxbiped.hybrid._scales import relative_to_scene
from jaxbiped.scene._parameter_access import parameter_values
from jaxbiped.scene._scene import AbstractScene
from jaxbiped.solve._accuracy import GAIT_ACCURACIES, Precision
from jaxbiped.solve._error_estimate import Judged, check_untraced, refine
from jaxbiped.solve.rosenbrock._rodas_tableaux import Rodas5P

_FIRST = 1e-2
"""First tolerance as a share of the relative error wanted, at most the draft's."""
_FINEST = 1e-9
"""Finest tolerance of gaits, that of "tight": Newton's method comes to no finer residual."""
_COLUMNS = 10.0
"""Tolerance of the columns over that of the state, as in the named accuracies."""
_LOOSER_SHARE, _OTHER_SHARE = 0.65, 1.4
"""What an error bar has of the change by a ten times looser tolerance, and of another method's.

Chosen on the gaits of 400 random scenes (draw 23 of `experiments/accuracy_coverage.py`): the larger
of both changes held 99.3 % of the sensitivities, twice that 99.8 % at bars 50 times the error in
the median, this sum 99.6 % at 29 times."""
_SLOPES_SHARE = 0.5
"""Part of the first of both that sensitivities have: their estimate is more than that change."""
_MULTIPLIERS_SHARE = 0.8
"""Part of that sum that is a multiplier's bar: on the same scenes the sum was 28 times the error in
the median, this part 23 times, and all multipliers lay within it in 99.0 % of them."""


def accurate_gait(
    find: Callable[..., Gait],
    scene: AbstractScene,
    wanted: float,
    *,
    guess: PyTree,
    solver: PyTree,
    radius: bool,
) -> Gait:
    """The gait whose estimated relative error is at most `wanted`, or as small as can be had.

    Args:
        find: finds a gait from a guess at an `accuracy`, by a `solver` of its own or another.
        scene: the scene, known numbers.
        wanted: relative error [–].
        guess: the user's, or None.
        solver: the method of steps, or None for the usual one; the witness takes Rodas5P, or
            Rodas4P where that is the method itself.
        radius: whether derivatives of the spectral radius are wanted.
    """
    check_untraced(wanted, (scene, guess), GAIT_ACCURACIES)
    fifth = isinstance(orbit_solver(solver, stiff=scene.stiff), Rodas5P)
    other = "rodas4p" if fifth else "rodas5p"
    near = guess

    def attempt(tolerance: float) -> tuple[Gait, Judged]:
        nonlocal near
        # Arrays: inputs of the compiled programs, which no round compiles anew.
        precision = Precision(jnp.asarray(tolerance), jnp.asarray(_COLUMNS * tolerance))
        gait = find(near, accuracy=precision, solver=solver)
        if gait.outcome is not Search.FOUND:
            return gait, ({}, np.inf, f"the search ended as {gait.outcome}")
        near = gait.measures.state
        witness = find(near, accuracy=precision, solver=other)
        judged = judge_gait(scene.minimal, gait, witness, radius)
        if int(gait.grazes):  # which a finer tolerance may resolve
            return gait, (judged[0], np.inf, unknown_derivatives(gait) if finest(tolerance) else "")
        return gait, judged

    def finest(tolerance: float) -> bool:
        return tolerance < (1.0 + 1e-6) * _FINEST

    first = min(max(_FIRST * wanted, _FINEST), 1e-5)
    dtype = np.dtype(jnp.result_type(*jtu.tree_leaves(scene)))
    gait, error = refine(attempt, wanted, first=first, dtype=dtype, finest=_FINEST)
    return eqx.tree_at(lambda each: each.error, gait, error, is_leaf=lambda leaf: leaf is None)


def judge_gait(scene: AbstractScene, gait: Gait, other: Gait, radius: bool) -> Judged:
    """Error bars of `measures`, `multipliers` and `sensitivities`.

    Relative errors: of measures to themselves, of states and times in the scene's l and √(l/g), of
    multipliers to the largest or 1, of a measure's elasticities to its largest one.
    """
    if other.outcome is not Search.FOUND:
        return {}, np.inf, f"another method's search ended as {other.outcome}"
    bars = {
        "measures": jtu.tree_map(_bar, gait.measure_errors, gait.measures, other.measures),
        "multipliers": _MULTIPLIERS_SHARE
        * _bar(gait.multiplier_errors, gait.multipliers, other.multipliers),
        "sensitivities": jtu.tree_map(
            lambda estimate, *both: _bar(_SLOPES_SHARE * np.asarray(estimate), *both),
            gait.sensitivity_errors,
            gait.sensitivities,
            other.sensitivities,
        ),
    }
    of, found = bars["measures"], gait.measures
    shares = [relative_to_scene(scene, of.period, of.state)]
    shares += [_ratio(getattr(of, name), getattr(found, name)) for name in _numbers_of(gait)]
    multipliers = np.abs(np.asarray(gait.multipliers))
    shares.append(_ratio(bars["multipliers"].max(), max(1.0, multipliers.max())))
    slopes, unknown = _elasticity_shares(scene, gait, bars["sensitivities"], radius)
    worst = float(np.max([*shares, *slopes]))
    relative = worst if np.isfinite(worst) else np.inf
    return bars, relative, unknown


def _elasticity_shares(
    scene: AbstractScene, gait: Gait, bars: Measures, radius: bool
) -> tuple[list[float], str]:
    """Relative errors of the sensitivities, and a sentence where there are none to be had."""
    if not gait.parameters:
        return [], ""
    values = parameter_values(scene)
    sizes = np.abs([float(values[name]) for name in gait.parameters])
    sizes = np.where(sizes > 0.0, sizes, 1.0)
    names = [*_numbers_of(gait), "spectral_radius"] if radius else _numbers_of(gait)
    shares, lacking = [], []
    for name in names:
        slopes, errors = (
            np.asarray(getattr(each, name)) * sizes for each in (gait.sensitivities, bars)
        )
        if not np.all(np.isfinite(slopes)):
            lacking.append(name)
        shares.append(_ratio(errors.max(), np.abs(slopes).max()))
    if not lacking:
        return shares, ""
    told = " and ".join(each.replace("_", " ") for each in lacking)
    why = "the law's force jumps or is infinitely steep there"
    return shares, f"derivatives of the {told} are unknown: {why}"


def _numbers_of(gait: Gait) -> list[str]:
    known = (name for name in QUANTITIES if getattr(gait.measures, name) is not None)
    return [name for name in known if name != "spectral_radius"]


def _bar(estimate: Any, told: Any, other: Any) -> np.ndarray:
    """Error bars from what a looser tolerance changes, and what another method does."""
    change = np.abs(np.asarray(told) - np.asarray(other))
    return _LOOSER_SHARE * np.asarray(estimate) + _OTHER_SHARE * change


def _ratio(error: Any, value: Any) -> float:
    size = abs(float(value))
    return float(error) / size if size > 0.0 else float("inf")
