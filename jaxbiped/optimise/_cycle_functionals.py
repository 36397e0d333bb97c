"""Functionals of a periodic orbit: values, derivatives by the implicit function theorem, errors."""

from collections.abc import Iterable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Scalar, as_float
from jaxbiped.dynamics._energy import is_driven
from jaxbiped.gait._fixed_point_search import with_looser
from jaxbiped.gait._orbit_derivatives import slopes_of
from jaxbiped.gait._poincare_map import (
    LinearisedReturn,
    linearised_return,
    recurring_components,
    seed_directions,
    state_with,
)
from jaxbiped.gait._return_map_spec import (
    ReturnMapSpec,
    orbit_solver,
)
from jaxbiped.hybrid._sections import AbstractSection
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.linalg._small_matrices import solve
from jaxbiped.scene._parameter_access import select_parameters
from jaxbiped.scene._scene import WalkerScene
from jaxbiped.solve._accuracy import ACCURACIES, Precision, precision_of
from jaxbiped.variational._tangents import Seeded

_STIFF = {"balanced": Precision(2e-8, 2e-7)}
"""How exactly functionals of a stiff orbit are solved where that is not as the gait is: the
errors of derivatives of the spectral radius, of slip and of losses are then below 1e-5 of the
elasticity, as those of the gait's own measures are; it doubles what an evaluation costs."""
_DRIVEN, _BOUND = 0.3, 0.1
"""Shares of these tolerances that keep the motors' work, and the bound of the radius, to 1e-5."""
_AWAY = 1e-3
"""Relative distance from an orbit at which a cycle of it does not end."""


class Functional(NamedTuple):
    """One functional, with respect to p parameters.

    Attributes:
        value: its value; `error` the estimated error.
        slopes: its derivatives, shape (p,); `slope_errors` their estimated errors.
    """

    value: float
    error: float
    slopes: np.ndarray
    slope_errors: np.ndarray


def weighted_sum(weights: Iterable[float], parts: Iterable[Functional], count: int) -> Functional:
    """Of functionals with respect to `count` parameters."""
    value, error, slopes, slope_errors = 0.0, 0.0, np.zeros(count), np.zeros(count)
    for weight, part in zip(weights, parts, strict=True):
        value, error = value + weight * part.value, error + abs(weight) * part.error
        slopes = slopes + weight * part.slopes
        slope_errors = slope_errors + abs(weight) * part.slope_errors
    return Functional(value, error, slopes, slope_errors)


class Functionals(NamedTuple):
    """Functionals of an orbit, k in all, with p parameters.

    Attributes:
        values: shape (k,); `errors` what a ten times looser solve changes.
        slopes: derivatives with respect to the parameters, shape (k, p); `slope_errors` likewise.
        code: 0, or that of the `Ending` that came instead of the return.
    """

    values: Scalar
    errors: Scalar
    slopes: Scalar
    slope_errors: Scalar
    code: Scalar


def cycle_spec(
    scene: WalkerScene,
    system: AbstractSystem,
    section: AbstractSection,
    arrivals: int,
    engine: str,
) -> ReturnMapSpec:
    """The return map of a walker's scene whose state has more coordinates, at any precision."""
    return ReturnMapSpec(
        system=system,
        section=section,
        solver=orbit_solver(None, stiff=scene.stiff),
        max_time=system_of(scene).longest_wait(scene),
        steps=arrivals,
        max_solver_steps=max(each.max_solver_steps for each in ACCURACIES.values()),
        engine=engine,
    )


def functional_precision(
    accuracy: str, scene: WalkerScene, names: tuple[str, ...] = ()
) -> Precision:
    """How exactly functionals are solved, as arrays: one program serves every accuracy."""
    found, share = precision_of(accuracy, scene), 1.0
    if scene.stiff and accuracy in _STIFF:
        found, share = _STIFF[accuracy], _DRIVEN if is_driven(scene) else 1.0
        share = _BOUND if "radius_bound" in names else share
    return Precision(*(as_float(share * tolerance) for tolerance in found))


class Orbits(NamedTuple):
    """An orbit by a precision, and by the ten times looser one of its errors, leaves (2, …).

    Each is corrected by itself: how that moves is a part of the error, too.

    Attributes:
        seeds, sizes: what is differentiated, and the parameters' sizes (p,): of both alike.
        points: recurring components, shape (2, m).
        returns: one cycle of each.
    """

    seeds: Seeded
    sizes: Scalar
    points: Scalar
    returns: LinearisedReturn


def orbits_near(spec: ReturnMapSpec, scene: WalkerScene, y: PyTree, fine: Precision) -> Orbits:
    """The orbits near a state on the section, after one more correction by Newton."""
    point = recurring_components(spec.system, y)
    _, active = select_parameters(scene, None)
    seeds, sizes = seed_directions(scene, active, len(point))

    def once(precision: Precision) -> tuple[Scalar, LinearisedReturn]:
        # What a search leaves is below its tolerance, but derivatives along contact feel it.
        by_state = linearised_return(
            spec, seeds, y, precision, jnp.asarray(False), carries_parameters=jnp.asarray(False)
        )
        own = point + jnp.where(by_state.code == 0, _newton_step(by_state, point), 0.0)
        start = state_with(spec.system, y, own)
        found = linearised_return(spec, seeds, start, precision, jnp.asarray(False))
        # As where the swing foot is lowest behind the section, and another arrival is the next.
        away = jnp.any(jnp.abs(found.recurring - own) > _AWAY * (1.0 + jnp.abs(own)))
        lost = jnp.where(away, int(Ending.TIMED_OUT), 0)
        return own, found._replace(code=jnp.where(found.code == 0, lost, found.code))

    return Orbits(seeds, sizes, *jax.vmap(once)(with_looser(fine)))


def with_errors(values: Scalar, slopes: Scalar, code: Scalar) -> Functionals:
    """Functionals from a fine solve and a looser one, leaves (2, …); NaN unless both returned."""
    known = jnp.where(jnp.all(code == 0), 1.0, jnp.nan)
    return Functionals(
        values=values[0] * known,
        errors=jnp.abs(values[0] - values[1]) * known,
        slopes=slopes[0] * known,
        slope_errors=jnp.abs(slopes[0] - slopes[1]) * known,
        code=jnp.max(code),
    )


def _newton_step(once: LinearisedReturn, point: Scalar) -> Scalar:
    """From a point to the fixed point, by Newton's correction."""
    m = len(point)
    return solve(jnp.eye(m) - once.jacobian[:, :m], once.recurring - point)


def totals_of_advance(once: LinearisedReturn, point: Scalar) -> tuple[Scalar, Scalar]:
    """What coordinates gain that need not return, but for the place, and total derivatives.

    They are those at the fixed point that Newton's correction gives.
    """
    rows, correction = once.advance_rows[1:, : len(point)], _newton_step(once, point)
    return once.advance[1:] + rows @ correction, slopes_of(once).advance[1:]


def total_of_peak(once: LinearisedReturn, point: Scalar) -> tuple[Scalar, Scalar]:
    """The largest load at that fixed point, and total derivatives."""
    row = once.peak_row[: len(point)]
    return once.peak + row @ _newton_step(once, point), slopes_of(once).peak
