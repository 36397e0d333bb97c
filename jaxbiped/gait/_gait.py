"""The walker's periodic gait."""

import functools
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Literal, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import optax
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice, check_positive, check_type
from jaxbiped._types import Scalar, as_float
from jaxbiped.dynamics._state import State, checked_state
from jaxbiped.gait._orbit import Orbit, orbit_of
from jaxbiped.gait._parameters import chosen_parameters
from jaxbiped.gait._precision import GAIT_ACCURACIES, MOST_SOLVER_STEPS, precision_of
from jaxbiped.gait._search import Found, Method, Search, search
from jaxbiped.gait._section import AbstractSection, MidStance
from jaxbiped.gait._seed_start import seed_start
from jaxbiped.gait._stability import Bifurcation
from jaxbiped.gait._system import Walking
from jaxbiped.gait._turn import Turning
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._ending import Ending
from jaxbiped.solve._passage import Precision
from jaxbiped.solve._solvers import solver_named

_RESIDUAL_SHARE = 0.3
"""Residual that counts as none, in units of the state's tolerance."""
_NOTHING = 1e-9
"""A measure (SI units) that is zero but for the solve's error has no elasticity."""
_PATIENCE = 50.0
"""Time allowed to the next arrival, in units of √(l/g)."""


class Measures(NamedTuple):
    """What is measured of a gait, or its derivatives; leaves of one shape.

    Attributes:
        period: duration of the cycle [s].
        step_length: advance along the slope in a cycle [m].
        speed: mean speed along the slope [m/s].
        peak_normal: largest normal force on a foot [N]; None where the gradient mode has none.
        spectral_radius: largest absolute value of a Floquet multiplier, the trivial one left out;
            None where the gradient mode has none.
        state: the state on the section, hip_x zero.
    """

    period: Scalar
    step_length: Scalar
    speed: Scalar
    peak_normal: Any
    spectral_radius: Any
    state: State


class Gait(eqx.Module):
    """A periodic gait; under `vmap` every array gains the batch's axes. p parameters.

    Attributes:
        ending: code of a `Search`; `outcome` names it.
        walk_ending: code of the `Ending` of the last trial that did not return; 0 where all did.
        measures: period, step length, speed, peak force, spectral radius and state.
        residual: largest change of a component of the state over the cycle, SI units.
        multipliers: Floquet multipliers, largest first, without the trivial one; shape (6,).
        multiplier_errors: their estimated errors, shape (6,).
        directions: their eigenvectors in the space of hip_z … omega_2, shape (7, 6).
        monodromy: derivative of a cycle at a fixed time, shape (7, 7).
        return_jacobian: derivatives on the section by the state: of the state that returns, the
            period and the step length; shape (9, 7).
        unit_multiplier_error: distance from 1 of the multiplier that must be exactly 1.
        bifurcation: code of a `Bifurcation`: whether a multiplier lies on the unit circle.
        sensitivities: derivatives of the measures by each parameter, leaves of shape (p,).
        sensitivity_errors: their estimated errors: what a ten times looser solve changes.
        elasticities: d log |measure| / d log parameter, leaves of shape (p,); zero for a parameter
            that is zero, NaN for a measure that is.
        turns: cycles that the search took.
        history: residual of each of them, NaN beyond the last.
        solver_steps: solver steps attempted in the last cycle.
        orbit: times [s] and states at the ends of the last cycle's solver steps, NaN beyond.
        parameters: names of the p parameters.
    """

    ending: Scalar
    walk_ending: Scalar
    measures: Measures
    residual: Scalar
    multipliers: Scalar
    multiplier_errors: Scalar
    directions: Scalar
    monodromy: Scalar
    return_jacobian: Scalar
    unit_multiplier_error: Scalar
    bifurcation: Scalar
    sensitivities: Measures
    sensitivity_errors: Measures
    elasticities: Measures
    turns: Scalar
    history: Scalar
    solver_steps: Scalar
    orbit: tuple[Scalar, State]
    parameters: tuple[str, ...] = eqx.field(static=True)

    @property
    def outcome(self) -> Search:
        """How the search ended, by name; for one gait, not a batch."""
        return Search(int(self.ending))

    @property
    def walk_outcome(self) -> Ending:
        """How the last trial that did not return ended; for one gait, not a batch."""
        return Ending(int(self.walk_ending))

    @property
    def critical(self) -> Bifurcation:
        """The bifurcation that the gait is at, by name; for one gait, not a batch."""
        return Bifurcation(int(self.bifurcation))

    @property
    def stable(self) -> Scalar:
        """Whether a gait was found and all its multipliers lie inside the unit circle."""
        return (self.ending == int(Search.FOUND)) & (self.measures.spectral_radius < 1.0)


def find_gait(
    scene: Scene,
    guess: State | None = None,
    *,
    period: int = 1,
    section: AbstractSection | None = None,
    parameters: tuple[str, ...] | None = None,
    accuracy: str = "balanced",
    method: Literal["newton", "optax"] = "newton",
    optimiser: optax.GradientTransformation | None = None,
    most_turns: int | None = None,
    radius_sensitivities: bool = True,
    solver: str | diffrax.AbstractSolver = "rodas4",
) -> Gait:
    """Finds a periodic gait, its Floquet multipliers and its sensitivities to the parameters.

    Newton's method on the return map, damped as Levenberg and Marquardt do where a step fails;
    derivatives are carried along the motion under a tolerance of their own, and no step straddles
    a switch. Works under `jit` and `vmap`, over scenes and over guesses.

    Args:
        scene: the walker.
        guess: a start near the gait, on the section or not; unless given, the seed's start, its
            stance foot set down as deep for the scene's own legs and rolling as fast.
        period: footsteps in a cycle.
        section: where the cycle begins, `MidStance()` unless given.
        parameters: names of the parameters to differentiate by (see `parameter_names`); all of
            them unless given, none for ().
        accuracy: "balanced" or "tight".
        method: "newton", or "optax" to minimise the squared residual by gradient.
        optimiser: for "optax"; Adam with a rate of 1e-2 unless given.
        most_turns: cycles allowed; 40 for "newton", 400 for "optax".
        radius_sensitivities: whether to differentiate the spectral radius, which takes second
            derivatives of the motion.
        solver: a name (see `SOLVERS`) or any diffrax solver without memory.

    Returns:
        The gait, or the best that was found instead: look at its `ending`.

    Raises:
        ArgumentError: an argument that is not allowed, before anything is compiled.
    """
    check_type("scene", scene, Scene)
    check_choice("accuracy", accuracy, GAIT_ACCURACIES)
    check_choice("method", method, ("newton", "optax"))
    check_positive("period", period)
    if int(period) != period:
        raise ArgumentError(f"period = {period} is not allowed: it must be a whole number.")
    start = checked_state(seed_start(scene) if guess is None else guess)
    if jnp.ndim(start.hip_z) != 0:
        raise ArgumentError(
            f"guess has leaves of shape {jnp.shape(start.hip_z)}: give one state, and use jax.vmap "
            "for many."
        )
    most = (40 if method == "newton" else 400) if most_turns is None else most_turns
    check_positive("most_turns", most)
    scene = jtu.tree_map(as_float, scene)
    names, active = chosen_parameters(scene, parameters)
    precision = precision_of(accuracy)
    turning = Turning(
        system=Walking(),
        section=MidStance() if section is None else section,
        solver=solver_named(solver),
        time_limit=_PATIENCE * jnp.sqrt(scene.walker.l / scene.ground.g),
        steps=int(period),
        max_solver_steps=MOST_SOLVER_STEPS[accuracy],
    )
    how = Method(
        optimiser=None if method == "newton" else (_adam() if optimiser is None else optimiser),
        most_turns=int(most),
        residual=_RESIDUAL_SHARE * precision.rtol,
    )
    return _find(turning, scene, start, precision, how, names, active, radius_sensitivities)


@functools.cache  # the same object each time, so that nothing is compiled again
def _adam() -> optax.GradientTransformation:
    return optax.adam(1e-2)


def _find(
    turning: Turning,
    scene: Scene,
    start: State,
    precision: Precision,
    method: Method,
    names: tuple[str, ...],
    active: tuple[int, ...],
    radius: bool,
) -> Gait:
    def described(found: Found) -> Gait:
        return _described(turning, scene, start, found, names, active, radius)

    searching = (turning, scene, active, start, precision, method)
    if any(isinstance(leaf, jax.core.Tracer) for leaf in jtu.tree_leaves(searching)):
        return described(_searched(*searching))
    # Two programs, so that the second compiles while the first one does: run on nothing, it ends
    # at once.
    with ThreadPoolExecutor(max_workers=1) as meanwhile:
        nothing = _nothing(eqx.filter_eval_shape(_searched, *searching))
        ready = meanwhile.submit(described, nothing)
        found = _searched(*searching)
        ready.result()
    return described(found)


@eqx.filter_jit
def _searched(*searching: Any) -> Found:
    # Without weak types, which would make the next program another one than was compiled.
    return jtu.tree_map(
        lambda leaf: jax.lax.convert_element_type(leaf, leaf.dtype), search(*searching)
    )


def _nothing(shape: PyTree) -> PyTree:
    """Arrays of these shapes that hold nothing."""
    return jtu.tree_map(
        lambda leaf: jnp.full(leaf.shape, jnp.nan if leaf.dtype.kind == "f" else 0, leaf.dtype),
        shape,
    )


@eqx.filter_jit
def _described(
    turning: Turning,
    scene: Scene,
    start: State,
    found: Found,
    names: tuple[str, ...],
    active: tuple[int, ...],
    radius: bool,
) -> Gait:
    orbit = orbit_of(turning, scene, active, start, found, radius=radius)
    stability = orbit.stability
    last, m = found.last, found.recurring.shape[0]
    lost = found.ending == int(Search.NO_RETURN)

    def known(tree: PyTree) -> PyTree:
        """NaN where no cycle was ever completed."""
        return jtu.tree_map(lambda leaf: jnp.where(lost, jnp.nan, leaf), tree)

    measures = Measures(
        period=last.period,
        step_length=last.advance[0],
        speed=last.advance[0] / last.period,
        peak_normal=last.peak,
        spectral_radius=stability.spectral_radius,
        state=orbit.state,
    )
    measures = known(measures)._replace(state=orbit.state)
    slopes = _by_parameter(orbit, measures, orbit.slopes, orbit.radius_slopes)
    errors = jtu.tree_map(
        jnp.abs, _by_parameter(orbit, measures, orbit.slope_errors, orbit.radius_errors)
    )
    times, states = last.nodes
    valid = jnp.isfinite(times)
    return Gait(
        ending=found.ending,
        walk_ending=found.code,
        measures=measures,
        residual=found.residual,
        multipliers=known(stability.multipliers),
        multiplier_errors=known(stability.errors),
        directions=known(stability.directions),
        monodromy=known(last.monodromy[:, :m]),
        return_jacobian=known(
            jnp.concatenate([last.jacobian, last.period_row[None], last.advance_rows])[:, :m]
        ),
        unit_multiplier_error=known(stability.unit_error),
        bifurcation=jnp.where(lost, int(Bifurcation.NONE), stability.bifurcation),
        sensitivities=known(jtu.tree_map(lambda leaf: leaf / orbit.sizes, slopes)),
        sensitivity_errors=known(jtu.tree_map(lambda leaf: leaf / jnp.abs(orbit.sizes), errors)),
        elasticities=known(_elasticities(scene, active, measures, slopes)),
        turns=found.turns,
        history=found.history,
        solver_steps=last.attempted,
        orbit=jtu.tree_map(lambda leaf: jnp.where(valid, leaf, jnp.nan), (times, states)),
        parameters=names,
    )


def _by_parameter(orbit: Orbit, measures: Measures, slopes: Any, radius: Scalar) -> Measures:
    """Derivatives of the measures by the parameters' own sizes, leaves of shape (p,)."""
    length, period = slopes.advance[0], slopes.period
    speed = (length - measures.speed * period) / measures.period
    state = State(jnp.zeros_like(period), *slopes.recurring)
    return Measures(period, length, speed, slopes.peak, radius, state)


def _elasticities(
    scene: Scene, active: tuple[int, ...], measures: Measures, slopes: Measures
) -> Measures:
    leaves = jtu.tree_leaves(scene)
    zero = jnp.stack([leaves[i] == 0.0 for i in active]) if active else jnp.zeros(0, dtype=bool)

    def relative(value: Scalar, slope: Scalar) -> Scalar:
        return jnp.where(zero, 0.0, jnp.where(jnp.abs(value) < _NOTHING, jnp.nan, slope / value))

    return jax.tree.map(relative, measures, slopes)
