"""Accurate walks: other solves of a walk, its witnesses, estimate its error.

A wanted accuracy has two: the same method at a looser tolerance, and another method. Steps of one
size control no error and have two as well, of other sizes: where steps are too long the walk goes
wrong without a sign of its own. About switches of the laws errors are erratic: of one other solve,
as wrong by chance, nothing is seen.
"""

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, warn
from jaxbiped._ending import Ending
from jaxbiped._types import is_traced
from jaxbiped.hybrid._scales import relative_to_scene, sizes_of
from jaxbiped.simulate._abstract_simulation import AbstractSimulation
from jaxbiped.simulate._trajectory import Trajectory
from jaxbiped.solve._accuracy import ACCURACIES, check_accuracy_name
from jaxbiped.solve._error_estimate import LOOSER, Judged, check_untraced, check_wanted, refine

_SHARE = 0.05
"""Least bar of one number over the largest bar of the same moment, in the scene's units.

The errors of one moment have one origin, most of all a shift in time, and a number whose difference
to a witness changes its sign just there would have a bar of next to nothing."""
_LONG = 1e-2
"""Relative change of the final state by other steps from which steps are too long."""
_MANY = 8
"""Steps from which the other ones are longer, and cost less; those of fewer are shorter."""
_LONGER, _SHORTER = (2.0, 2.0**0.5), (1.0 / 2.0, 1.0 / 3.0)


class Witness(NamedTuple):
    """Another solve of a walk, and how often its difference counts."""

    walk: Trajectory[Any]
    weight: float


def check_accurate_walk(accuracy: str | float, **replaced: object) -> float | None:
    """The relative error wanted; None where an accuracy is asked for by name.

    Raises:
        ArgumentError: an unknown name, a number that is not above 0, or `replaced` arguments that
            a number leaves no room for.
    """
    if isinstance(accuracy, str):
        check_accuracy_name(accuracy)
        return None
    if isinstance(accuracy, jax.core.Tracer):  # type: ignore[unreachable]
        raise ArgumentError("accuracy is traced: a number must be known beforehand.")
    check_wanted(accuracy, **replaced)
    return float(accuracy)


def accurate_walk(run: AbstractSimulation, wanted: float) -> Trajectory[Any]:
    """The walk whose estimated relative error is at most `wanted`, or as small as can be had.

    Tolerances are inputs of the compiled programs: no round compiles anything anew.

    Raises:
        ArgumentError: under `jit`, `vmap` or differentiation.
    """
    check_untraced(wanted, run, ACCURACIES)
    other, other_looser, weight = run.by_other_method()

    def attempt(tolerance: float) -> tuple[Trajectory[Any], Judged]:
        walk = run.at_tolerance(tolerance)()
        witnesses = (
            Witness(run.at_tolerance(LOOSER * tolerance)(), 1.0),
            Witness(other.at_tolerance(other_looser * tolerance)(), weight),
        )
        bars, relative, obstacle = judge_walk(run.scene.minimal, walk, witnesses)
        # Whether a foot that grazes the ground strikes is for a finer tolerance to tell.
        grazes = walk.grazes is not None and int(walk.grazes) > 0
        return walk, (bars, np.inf if grazes else relative, obstacle)

    dtype = run.rtol.dtype
    first = run.first_tolerance(wanted)
    walk, error = refine(attempt, wanted, first=first, dtype=dtype, finest=run.finest_tolerance)
    return dataclasses.replace(walk, error=error)


def judge_walk(scene: PyTree, walk: Trajectory[Any], witnesses: tuple[Witness, ...]) -> Judged:
    """Error bars of a walk from other solves of it: fields `t`, `state` and what else was asked."""
    if walk.outcome in (Ending.OUT_OF_STEPS, Ending.SOLVER_FAILED):
        return _unknown(walk), np.inf, f"the solve ended as {walk.outcome}"
    if any(int(each.walk.ending) != int(walk.ending) for each in witnesses):
        return _unknown(walk), np.inf, ""
    told = [_on_times_of(walk, each.walk) for each in witnesses]
    own = _outputs(walk)
    if any(_shapes(each) != _shapes(own) for each in told):
        return _unknown(walk), np.inf, ""
    weights = [each.weight for each in witnesses]
    bars = jtu.tree_map(lambda *leaves: _largest_change(weights, *leaves), own, *told)
    bars["state"] = _at_least_a_share(scene, bars["state"])
    relative = relative_to_scene(scene, bars["t"], bars["state"])
    if "arrivals" in bars:
        reached = bars["arrivals"]
        bars["arrivals"] = reached = reached._replace(state=_at_least_a_share(scene, reached.state))
        relative = max(relative, relative_to_scene(scene, reached.t, reached.state))
    return bars, relative, ""


def _at_least_a_share(scene: PyTree, bars: PyTree) -> PyTree:
    """No bar far below the others of its moment (see `_SHARE`), but for bristles, whose size is."""
    _, sizes = sizes_of(scene, bars)
    largest = np.max(jtu.tree_leaves(jtu.tree_map(np.divide, bars, sizes)), axis=0)
    raised = {
        name: jtu.tree_map(
            lambda bar, size: np.maximum(bar, _SHARE * size * largest), bar, getattr(sizes, name)
        )
        for name, bar in bars._asdict().items()
        if not name.startswith("bristle")
    }
    return bars._replace(**raised)


def _outputs(walk: Trajectory[Any]) -> dict[str, Any]:
    told = ("t", "state", "arrivals", "lowest", "highest", "integrals")
    found = {name: getattr(walk, name) for name in told}
    return jtu.tree_map(np.asarray, {k: v for k, v in found.items() if v is not None})


def _on_times_of(walk: Trajectory[Any], other: Trajectory[Any]) -> dict[str, Any]:
    """What another solve tells at a walk's own times; at resets and at the end, at its own.

    Empty where its resets are not as many.
    """
    found = _outputs(other)
    if walk.dense is None:
        return found
    times = np.array(walk.t)
    inside = np.clip(times, None, found["t"][-1])
    between = jtu.tree_map(lambda leaf: np.array(leaf), other.at(inside))
    # A reset is at two of the times, at which there are the states on its two sides.
    resets, others = (np.flatnonzero(np.diff(t) == 0.0) for t in (times, found["t"]))
    if len(resets) != len(others):
        return {}
    here, there = (np.array([*before, *(before + 1), -1]) for before in (resets, others))
    jtu.tree_map(lambda leaf, told: leaf.__setitem__(here, told[there]), between, found["state"])
    times[here] = found["t"][there]
    return found | {"t": times, "state": between}


def _largest_change(weights: list[float], told: np.ndarray, *others: np.ndarray) -> np.ndarray:
    # What no arrival filled is infinite in all of them.
    with np.errstate(invalid="ignore"):
        changes = [
            np.where(told == other, 0.0, weight * np.abs(told - other))
            for weight, other in zip(weights, others, strict=True)
        ]
    return np.max(changes, axis=0)


def _shapes(tree: PyTree) -> list[tuple[int, ...]]:
    return [np.shape(leaf) for leaf in jtu.tree_leaves(tree)]


def _unknown(walk: Trajectory[Any]) -> dict[str, Any]:
    return jtu.tree_map(lambda leaf: np.full(leaf.shape, np.inf), _outputs(walk))


def warn_of_missed_contacts(run: AbstractSimulation, walk: Trajectory) -> None:
    """Warns where steps of one size stepped over contacts; nothing is known while tracing."""
    missed = walk.missed_contacts
    if run.dt is None or missed is None or isinstance(missed, jax.core.Tracer) or not int(missed):
        return
    warn(
        f"dt = {float(run.dt):g} steps over contacts: a foot dips into the ground and leaves it "
        f"between two steps, {int(missed)} times; take shorter steps, or tolerances.",
    )


def warn_of_long_steps(run: AbstractSimulation, walk: Trajectory[Any]) -> None:
    """Warns where other steps of one size lead elsewhere; nothing is known while tracing.

    Compiles nothing: steps are an input of the program.
    """
    if run.dt is None or is_traced((run, walk)):
        return
    if walk.outcome in (Ending.SOLVER_FAILED, Ending.OUT_OF_STEPS):
        return
    many = float(run.duration) >= _MANY * float(run.dt) or run.max_solver_steps < 3 * _MANY
    base = run.dt if many else jnp.minimum(run.dt, run.duration)
    for factor in _LONGER if many else _SHORTER:
        dt = factor * base
        other = run.with_steps(dt)()
        found = _change(run, walk, other)
        if found:
            break
    else:
        return
    warn(
        f"dt = {float(run.dt):g} is too long: with steps of {float(dt):g} s {found}; take shorter "
        "steps, or tolerances.",
    )


def _change(run: AbstractSimulation, walk: Trajectory[Any], other: Trajectory[Any]) -> str:
    """How far another solve leads elsewhere; "" for not far."""
    if int(other.ending) != int(walk.ending):
        return f"it ends as {other.outcome} instead of {walk.outcome}"
    apart = jtu.tree_map(lambda a, b: np.abs(np.asarray(a - b)), walk.final, other.final)
    change = relative_to_scene(run.scene.minimal, np.zeros(()), apart)
    return "" if change <= _LONG else f"the relative change of its final state is {change:.2g}"
