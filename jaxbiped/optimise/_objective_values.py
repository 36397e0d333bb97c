"""Values of objectives: those of one gait by name, with gradients and error bars, and kept.

In memory and, where asked for, in a file to resume from, a line of JSON for each design. An
optimiser that is run again asks for the same designs in the same order, finds them there, and goes
on where it was.
"""

import contextlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._files import failure_kind, strict_json
from jaxbiped._identity import difference_of
from jaxbiped._types import JsonObject, Scalar
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.continuation._bifurcations import BranchEvent
from jaxbiped.dynamics._state import recurring_leaves
from jaxbiped.gait._gait import Gait
from jaxbiped.hybrid._motion_costs import has_motion_costs
from jaxbiped.optimise._bifurcation_distance import Sought, bifurcation_distance
from jaxbiped.optimise._cycle_costs import cost_functionals
from jaxbiped.optimise._cycle_functionals import (
    Functional,
    Functionals,
    weighted_sum,
)
from jaxbiped.optimise._jacobian_functionals import (
    CLEARANCE_NORMS,
    CLUSTER,
    JACOBIAN_FUNCTIONALS,
    SYMMETRIC,
    jacobian_functionals,
)
from jaxbiped.optimise._objectives import OBJECTIVES, Combined, Measures, costs_of, with_parts
from jaxbiped.scene._scene import AbstractScene, WalkerScene

_OF_THE_GAIT = ("speed", "step_length", "period", "peak_normal")
_DISTANCES = {
    "fold_distance": BranchEvent.FOLD,
    "doubling_distance": BranchEvent.PERIOD_DOUBLING,
}
_WHOLE = ("sensitivity_norm", "floor_sensitivity", *CLEARANCE_NORMS)
"""What the whole sensitivity is made of: step length, step time and clearance, by both."""
AllFunctionals: TypeAlias = tuple[Functionals | None, Functionals | None]
"""Those of a gait's Jacobian and of its costs; None where no measure needs them."""


class Evaluation(NamedTuple):
    """Objectives of one gait, with derivatives with respect to the p parameters of its scene.

    Attributes:
        values: values by name.
        errors: estimated errors of the values.
        slopes: derivatives by name, shape (p,).
        slope_errors: estimated errors of the derivatives.
        state: recurring components of the gait's state, shape (m,).
        state_slopes: derivatives of the state, shape (m, p).
        beyond_range: names of distances whose bifurcation lies beyond the range that is followed;
            their values are lower bounds, and their derivatives are zero.
    """

    values: dict[str, float]
    errors: dict[str, float]
    slopes: dict[str, np.ndarray]
    slope_errors: dict[str, np.ndarray]
    state: np.ndarray
    state_slopes: np.ndarray
    beyond_range: tuple[str, ...] = ()

    def functional(self, name: str) -> Functional:
        """Value, error, derivatives and their errors of one objective."""
        return _row(*(part[name] for part in self[:4]))


def functionals_of(
    scene: WalkerScene, gait: Gait, wanted: Measures, accuracy: str
) -> AllFunctionals:
    """What measures need beside the gait itself."""
    names, costs = jacobian_names(scene, wanted), costs_of(with_parts(wanted), scene)
    how: Any = {"arrivals": len(gait.orbit[0]), "accuracy": accuracy, "engine": gait.engine}
    state, of_jacobian, of_costs = gait.measures.state, None, None
    if names:
        of_jacobian = jacobian_functionals(scene, state, names, **how)
    if costs:
        of_costs = cost_functionals(scene, state, costs, **how)
    return of_jacobian, of_costs


def jacobian_names(scene: AbstractScene, measures: Measures) -> tuple[str, ...]:
    """Which functionals of the Jacobian these measures need; none where a scene is no walker."""
    if not has_motion_costs(scene):
        return ()
    wanted = {name for name, each in with_parts(measures).items() if name in OBJECTIVES}
    needed = {*wanted, *(_WHOLE if "whole_sensitivity" in wanted else ())}
    names = tuple(name for name in JACOBIAN_FUNCTIONALS if name in needed)
    if "spectral_radius" in wanted:
        names = (*CLUSTER, *(name for name in names if name not in CLUSTER))
    return names


def evaluate(
    scene: WalkerScene,
    gait: Gait,
    wanted: Measures,
    accuracy: str,
    functionals: AllFunctionals | None = None,
) -> Evaluation:
    """Objectives of a gait that was found with the sensitivities to all parameters.

    `functionals` are those of `functionals_of`, where they are known.
    """
    both = (gait.measures, gait.measure_errors, gait.sensitivities, gait.sensitivity_errors)
    of_jacobian = jacobian_names(scene, wanted)
    of_gait = tuple(name for name in _OF_THE_GAIT if name in gait.measured)
    if "spectral_radius" in {*wanted} - {*of_jacobian}:
        of_gait = (*of_gait, "spectral_radius")
    rows = {name: _row(*(getattr(each, name) for each in both)) for name in of_gait}
    for name, each in with_parts(wanted).items():
        if each.measured is not None:
            rows[name] = Functional(*each.measured(scene, gait))
    if functionals is None:
        functionals = functionals_of(scene, gait, wanted, accuracy)
    of_derivatives, of_costs = functionals
    if of_derivatives is not None:
        # The orbit's own error moves the Jacobian, too, as its multipliers tell.
        shares = np.asarray(gait.multiplier_errors) / float(gait.measures.spectral_radius)
        for name, row in zip(of_jacobian, _rows_of(of_derivatives), strict=True):
            # Symmetric functions do not move as multipliers that meet do.
            moved = 0.0 if name in SYMMETRIC else abs(row.value) * float(shares[0])
            rows[name] = row._replace(error=max(row.error, moved))
    if "whole_sensitivity" in wanted:
        rows["whole_sensitivity"] = _root_of_squares([rows[name] for name in _WHOLE])
    rows = with_costs(wanted, rows, of_costs, scene)
    beyond_range = []
    for name in (name for name in wanted if name in _DISTANCES):
        told = bifurcation_distance(scene, gait, _DISTANCES[name], accuracy=accuracy)
        rows[name] = Functional(told.distance, told.error, told.slopes, told.slope_errors)
        if told.outcome is Sought.NONE_IN_RANGE:
            rows[name] = Functional(told.distance, 0.0, *[np.zeros_like(told.slopes)] * 2)
            beyond_range.append(name)
    needed = dict.fromkeys((*with_parts(wanted), *of_jacobian, *of_gait))
    kept = {name: _row(*rows[name]) for name in needed}
    state, slopes = gait.measures.state, gait.sensitivities.state
    columns: Any = zip(*kept.values(), strict=True)
    named = [dict(zip(kept, column, strict=True)) for column in columns]
    return Evaluation(
        **dict(zip(Evaluation._fields[:4], named, strict=True)),
        state=np.stack(recurring_leaves(state)),
        state_slopes=np.stack(recurring_leaves(slopes)),
        beyond_range=tuple(beyond_range),
    )


def _row(value: Any, error: Any, slopes: Any, slope_errors: Any) -> Functional:
    return Functional(float(value), float(error), np.asarray(slopes), np.asarray(slope_errors))


def _rows_of(found: Functionals) -> list[Functional]:
    return [_row(*each) for each in zip(*map(np.asarray, found[:4]), strict=True)]


def with_costs(
    wanted: Measures, rows: Mapping[str, Functional], costs: Functionals | None, scene: Any
) -> dict[str, Functional]:
    """Adds the measures that are sums of costs or functions of others to those known by name.

    Costs that the scene lacks are zero.
    """
    every, rows = with_parts(wanted), dict(rows)
    known = () if costs is None else _rows_of(costs)
    parts = dict(zip(costs_of(every, scene), known, strict=True))
    for name, each in every.items():
        if each.costs:
            terms = [(weight, parts[cost]) for weight, cost in each.costs if cost in parts]
            weights, summed = zip(*terms, strict=True) if terms else ((), ())
            rows[name] = weighted_sum(weights, summed, len(rows["period"].slopes))
    for name, each in every.items():
        if each.combined is not None:
            rows[name] = _combination(each.combined, rows)
    return rows


def _combination(combined: Combined, rows: dict[str, Functional]) -> Functional:
    """A function of functionals, to first order in their errors."""
    parts = [rows[name] for name in combined.of]
    values = tuple(jnp.asarray(part.value) for part in parts)
    value, by_part = _value_and_slopes(combined.function, values)
    return weighted_sum(map(float, by_part), parts, len(parts[0].slopes))._replace(
        value=float(value)
    )


@cached_jit
def _value_and_slopes(function: Callable[..., Any], values: tuple[Scalar, ...]) -> Any:
    return jax.value_and_grad(function, tuple(range(len(values))))(*values)


def _root_of_squares(rows: list[Functional]) -> Functional:
    value = float(np.sqrt(sum(row.value**2 for row in rows)))
    shares = [row.value / value for row in rows]
    return weighted_sum(shares, rows, len(rows[0].slopes))._replace(value=value)


class Evaluations:
    """Designs by their u, with what is known of each; None for one whose gait was lost."""

    def __init__(self, path: Path | None = None, settings: JsonObject | None = None) -> None:
        self._known: dict[bytes, Evaluation | None] = {}
        self._path, self.count = path, 0
        if path is None:
            return
        try:
            text = path.read_text(errors="replace") if path.exists() else ""
        except OSError as error:
            raise failure_kind(error)(f"store = {str(path)!r}: {error.strerror}.") from None
        if text:
            self._read(path, text.splitlines(), json.loads(strict_json(settings)))
        else:
            self._append(settings)
        if text and not text.endswith("\n"):
            self._append(None)  # what was cut off ends: the next line stands by itself

    def get(self, u: np.ndarray) -> Evaluation | None:
        return self._known.get(u.tobytes())

    def is_lost(self, u: np.ndarray) -> bool:
        return self._known.get(u.tobytes(), ...) is None

    def add(self, u: np.ndarray, known: Evaluation | None) -> None:
        """Keeps a design, None for one that has no gait."""
        self._known[u.tobytes()] = known
        self.count += known is not None
        self._append({"u": u, "known": None if known is None else known._asdict()})

    def nearest(self, u: np.ndarray) -> tuple[np.ndarray, Evaluation]:
        found = [(np.frombuffer(key), e) for key, e in self._known.items() if e is not None]
        return min(found, key=lambda each: float(np.linalg.norm(each[0] - u)))

    def _read(self, path: Path, lines: list[str], settings: JsonObject) -> None:
        rows: list[Any] = []
        for line in lines:
            with contextlib.suppress(json.JSONDecodeError):  # one that was cut off
                rows.append(json.loads(line))
        difference = "it holds something else"
        if rows and isinstance(rows[0], dict):
            difference = difference_of(rows[0], settings) or ""
        if difference:
            raise ArgumentError(
                f"store = {str(path)!r} belongs to another problem ({difference}): give another "
                "file, or the same scene, variables, measures and settings."
            )
        for row in rows:
            # Two runs that begin one store both write what it is of.
            if isinstance(row, dict) and "u" in row:
                known = row["known"]
                u = np.asarray(row["u"], dtype=float)
                self._known[u.tobytes()] = None if known is None else _evaluation(known)
        self.count = sum(each is not None for each in self._known.values())

    def _append(self, row: JsonObject | None) -> None:
        """In one piece, so that another run may add to the same file; without a row a line's end.

        What is no finite number is a word that `float` reads.
        """
        if self._path is None:
            return
        text = "" if row is None else strict_json(row, unknown=str)
        try:
            with self._path.open("a") as file:
                file.write(text + "\n")
        except OSError as error:
            raise failure_kind(error)(f"store = {str(self._path)!r}: {error.strerror}.") from None


def _evaluation(told: JsonObject) -> Evaluation:
    def read(part: Any) -> Any:
        if isinstance(part, dict):
            return {name: read(each) for name, each in part.items()}
        return np.asarray(part, float)[()]

    beyond = tuple(told.pop("beyond_range"))
    return Evaluation(**read(told), beyond_range=beyond)
