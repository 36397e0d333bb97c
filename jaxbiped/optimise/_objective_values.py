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
import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._files import failure_kind, strict_json
from jaxbiped._identity import difference_of
from jaxbiped._types import JsonObject, Scalar
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.continuation._bifurcations import BranchEvent
from jaxbiped.dynamics._state import recurring_leaves
from jaxbiped.gait._gait import Gait
from jaxbiped.optimise._augmented_system import MOTOR_WORK, integrals_of
from jaxbiped.optimise._bifurcation_distance import Sought, bifurcation_distance
from jaxbiped.optimise._cycle_costs import cost_functionals
from jaxbiped.optimise._cycle_functionals import (
    Functional,
    Functionals,
    cycle_functionals,
    integral_names,
    weighted_sum,
)
from jaxbiped.optimise._jacobian_functionals import (
    CLEARANCE_NORMS,
    CLUSTER,
    JACOBIAN_FUNCTIONALS,
    SYMMETRIC,
    jacobian_functionals,
)
from jaxbiped.optimise._objectives import Combined, Measures, costs_of, with_parts
from jaxbiped.scene._parameter_access import parameter_names, select_parameters
from jaxbiped.scene._scene import AbstractScene, WalkerScene

_OF_THE_GAIT = ("speed", "step_length", "period", "peak_normal")
_DISTANCES = {
    "fold_distance": BranchEvent.FOLD,
    "doubling_distance": BranchEvent.PERIOD_DOUBLING,
}
_WHOLE = ("sensitivity_norm", "floor_sensitivity", *CLEARANCE_NORMS)
"""What the whole sensitivity is made of: step length, step time and clearance, by both."""
AllFunctionals: TypeAlias = tuple[Functionals | None, Functionals | None, Functionals | None]
"""Those of a gait's Jacobian, of its cycle and its costs; None where no measure needs them."""


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
    of_jacobian, of_cycle = functional_names(scene, wanted)
    how: Any = {"arrivals": len(gait.orbit[0]), "accuracy": accuracy, "engine": gait.engine}
    state, first, second, third = gait.measures.state, None, None, None
    if of_jacobian:
        first = jacobian_functionals(scene, state, of_jacobian, **how)
    if of_cycle:
        second = cycle_functionals(scene, state, **how)
    if costs := costs_of(with_parts(wanted)):
        third = cost_functionals(scene, state, costs, **how)
    return first, second, third


def functional_names(scene: AbstractScene, measures: Measures) -> tuple[tuple[str, ...], bool]:
    """Which functionals of the Jacobian these measures need, and whether those of the cycle.

    Where a cycle has no integrals all measures are known with the gait.
    """
    if integrals_of(scene) is None:
        return (), False
    every = with_parts(measures)
    wanted = [name for name, each in every.items() if not (each.costs or each.combined)]
    needed = {*wanted, *(_WHOLE if "whole_sensitivity" in wanted else ())}
    of_jacobian = tuple(name for name in JACOBIAN_FUNCTIONALS if name in needed)
    if "spectral_radius" in wanted:
        of_jacobian = (*CLUSTER, *(name for name in of_jacobian if name not in CLUSTER))
    others = {*of_jacobian, *_OF_THE_GAIT, *_DISTANCES, "whole_sensitivity", *_own(every)}
    return of_jacobian, bool(set(wanted) - others)


def _own(wanted: Measures) -> dict[str, Callable[[Any, Gait], tuple[Any, Any, Any, Any]]]:
    """Those of a user's own among these measures, by name."""
    return {name: each.measured for name, each in wanted.items() if each.measured is not None}


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
    of_jacobian, _ = functional_names(scene, wanted)
    of_gait = tuple(name for name in _OF_THE_GAIT if name in gait.measured)
    if "spectral_radius" in {*wanted} - {*of_jacobian}:
        of_gait = (*of_gait, "spectral_radius")
    rows = {name: _row(*(getattr(each, name) for each in both)) for name in of_gait}
    rows |= {name: Functional(*measured(scene, gait)) for name, measured in _own(wanted).items()}
    if functionals is None:
        functionals = functionals_of(scene, gait, wanted, accuracy)
    first, second, third = functionals
    if first is not None:
        # The orbit's own error moves the Jacobian, too, as its multipliers tell.
        shares = np.asarray(gait.multiplier_errors) / float(gait.measures.spectral_radius)
        for name, row in zip(of_jacobian, _rows_of(first), strict=True):
            # Symmetric functions do not move as multipliers that meet do.
            moved = 0.0 if name in SYMMETRIC else abs(row.value) * float(shares[0])
            rows[name] = row._replace(error=max(row.error, moved))
    if "whole_sensitivity" in wanted:
        rows["whole_sensitivity"] = _root_of_squares([rows[name] for name in _WHOLE])
    if second is not None:
        rows |= dict(zip(integral_names(scene), _rows_of(second), strict=True))
        rows["cost_of_transport"] = _cost_of_transport(scene, rows)
    rows = with_costs(wanted, rows, third)
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
    wanted: Measures, rows: Mapping[str, Functional], costs: Functionals | None
) -> dict[str, Functional]:
    """Adds the measures that are sums of costs or functions of others to those known by name."""
    every, rows = with_parts(wanted), dict(rows)
    if costs is not None:
        parts = dict(zip(costs_of(every), _rows_of(costs), strict=True))
        for name, each in every.items():
            if each.costs:
                terms = [parts[cost] for _, cost in each.costs]
                count = costs.slopes.shape[1]
                rows[name] = weighted_sum([weight for weight, _ in each.costs], terms, count)
    for name, each in every.items():
        if each.combined is not None:
            rows[name] = _combination(each.combined, rows)
    return rows


def _combination(combined: Combined, rows: dict[str, Functional]) -> Functional:
    """A function of functionals, to first order in their errors."""
    parts = [rows[name] for name in combined.of]
    values = [jnp.asarray(part.value) for part in parts]
    value, by_part = jax.value_and_grad(combined.function, tuple(range(len(parts))))(*values)
    return weighted_sum(map(float, by_part), parts, len(parts[0].slopes))._replace(
        value=float(value)
    )


def _root_of_squares(rows: list[Functional]) -> Functional:
    value = float(np.sqrt(sum(row.value**2 for row in rows)))
    shares = [row.value / value for row in rows]
    return weighted_sum(shares, rows, len(rows[0].slopes))._replace(value=value)


def _cost_of_transport(scene: WalkerScene, rows: dict[str, Functional]) -> Functional:
    """Work of the motors over weight times length, and gravity's share, exact over a cycle."""
    slope, length = float(scene.ground.slope), rows["step_length"]
    by_slope = np.zeros(len(length.slopes))
    by_slope[parameter_names(scene).index("slope")] = np.cos(slope)
    if MOTOR_WORK not in rows:
        return Functional(np.sin(slope), 0.0, by_slope, np.zeros(len(by_slope)))
    work, (weight, by_parameters) = rows[MOTOR_WORK], map(np.asarray, _weight(scene))
    own = length.slopes / length.value + by_parameters / weight
    divisor = float(weight) * length.value
    cost = work.value / divisor
    return Functional(
        value=cost + np.sin(slope),
        error=work.error / divisor + cost * length.error / length.value,
        slopes=work.slopes / divisor - cost * own + by_slope,
        slope_errors=work.slope_errors / divisor + cost * length.slope_errors / length.value,
    )


@cached_jit
def _weight(scene: WalkerScene) -> tuple[Scalar, Scalar]:
    """The walker's weight [N], and its derivatives with respect to all parameters, shape (p,)."""

    def of(there: Any) -> Scalar:
        return there.mechanism.total_mass * there.ground.g

    value, slopes = jax.value_and_grad(of)(scene)
    (_, places), leaves = select_parameters(scene, None), jtu.tree_leaves(slopes)
    return value, jnp.stack([leaves[k] for k in places])


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
