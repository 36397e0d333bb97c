"""Functionals of a periodic orbit: values, derivatives by the implicit function theorem, errors."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._cached_jit import cached_jit
from jaxbiped._types import Scalar
from jaxbiped.dynamics._rigid_state import WalkerState
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.gait._fixed_point_search import LOOSER
from jaxbiped.gait._orbit import slopes_of
from jaxbiped.gait._poincare_map import (
    LinearisedReturn,
    linearised_return,
    recurring_components,
    seed_directions,
    state_with,
)
from jaxbiped.gait._return_map_spec import ReturnMapSpec
from jaxbiped.gait._solver import orbit_solver
from jaxbiped.linalg._small_matrices import solve
from jaxbiped.optimise._augmented_state import MotionSection
from jaxbiped.optimise._cycle_integrals import AbstractIntegrals, integrals_of
from jaxbiped.scene._parameters import select_parameters
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._accuracy import ACCURACIES, Precision, precision_of
from jaxbiped.variational._hybrid_system import AbstractSystem, section_of
from jaxbiped.variational._tangents import Seeded

_PATIENCE = 50.0
"""Time allowed to the next arrival, in units of √(l/g)."""


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


def cycle_functionals(
    scene: Scene | RigidScene,
    state: WalkerState,
    *,
    footsteps: int = 1,
    accuracy: str = "balanced",
    engine: str = "lanes",
) -> Functionals:
    """The integrals over the cycle of the gait with this state, and its swing foot's clearance.

    Args:
        scene: the walker.
        state: of its gait, on the section.
        footsteps: how many a cycle has.
        accuracy: "balanced" or "tight".
        engine: "xla" or "lanes".

    Returns:
        Of each integral in the order of `integral_names`, then of the foot's clearance [m]; with
        respect to all parameters in the order of `parameter_names`.
    """
    section = MotionSection(section_of(scene, None))
    spec = cycle_spec(scene, integrals_of(scene), section, footsteps, accuracy, engine)
    return _functionals(spec, scene, state, accuracy)


def integral_names(scene: Scene | RigidScene) -> tuple[str, ...]:
    """What `cycle_functionals` tells of a scene."""
    return (*integrals_of(scene).integrals, "foot_clearance")


def cycle_spec(
    scene: Scene | RigidScene,
    system: AbstractSystem,
    section: AbstractSection,
    footsteps: int,
    accuracy: str,
    engine: str,
) -> ReturnMapSpec:
    """The return map of a walker's scene whose state has more coordinates."""
    return ReturnMapSpec(
        system=system,
        section=section,
        solver=orbit_solver(None, rigid=not scene.compliant),
        max_time=_PATIENCE * jnp.sqrt(scene.walker.l / scene.ground.g),
        steps=footsteps,
        max_solver_steps=ACCURACIES[accuracy].max_solver_steps,
        engine=engine,
    )


@cached_jit
def _functionals(
    spec: ReturnMapSpec, scene: Scene | RigidScene, state: WalkerState, accuracy: str
) -> Functionals:
    assert isinstance(spec.system, AbstractIntegrals)
    y = spec.system.begin(state)
    _, active = select_parameters(scene, None)
    seeds, sizes = seed_directions(scene, active, len(recurring_components(spec.system, y)))
    fine = precision_of(accuracy, scene)
    y = corrected(spec, seeds, y, fine)
    point = recurring_components(spec.system, y)
    both = Precision(*(jnp.asarray([tol, LOOSER * tol]) for tol in fine))

    def at(precision: Precision) -> tuple[Scalar, Scalar, Scalar]:
        once = linearised_return(spec, seeds, y, precision, jnp.asarray(False))
        values, slopes = _totals(once, point)
        return values, slopes / sizes, once.code

    return with_errors(*jax.vmap(at)(both))


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


def corrected(spec: ReturnMapSpec, seeds: Seeded, y: PyTree, precision: Precision) -> PyTree:
    """A state near a fixed point after one more correction by Newton.

    What a search leaves is below its tolerance, but derivatives along contact feel it.
    """
    point = recurring_components(spec.system, y)
    once = linearised_return(
        spec, seeds, y, precision, jnp.asarray(False), carries_parameters=jnp.asarray(False)
    )
    m = len(point)
    step = solve(jnp.eye(m) - once.jacobian[:, :m], once.recurring - point)
    return state_with(spec.system, y, point + jnp.where(once.code == 0, step, 0.0))


def _totals(once: LinearisedReturn, point: Scalar) -> tuple[Scalar, Scalar]:
    """Values at the fixed point that Newton's correction gives, and total derivatives."""
    m = len(point)
    correction = solve(jnp.eye(m) - once.jacobian[:, :m], once.recurring - point)
    slopes = slopes_of(once)
    gained = once.advance[1:] + once.advance_rows[1:, :m] @ correction
    depth = once.peak + once.peak_row[:m] @ correction
    values = jnp.append(gained, -depth)
    return values, jnp.concatenate([slopes.advance[1:], -slopes.peak[None]])
