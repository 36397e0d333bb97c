"""The return map as a function that JAX can differentiate, and one return with its derivatives.

Rules around tangents of its own give derivatives by either engine, in both modes. By lanes all
directions of a derivative share one solve; by diffrax each has one, in lockstep.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import diffrax
import equinox as eqx
import equinox.internal as eqxi
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice, check_count, check_positive, check_type
from jaxbiped._jax_versions import without_switches
from jaxbiped._types import Scalar, Time, as_float, in_64_bits, select
from jaxbiped.dynamics._equivalent_states import minimal_state, redundant_state
from jaxbiped.dynamics._state import state_for
from jaxbiped.gait._poincare_map import (
    PARAMETER_FLOOR,
    STATE_FLOOR,
    LinearisedReturn,
    linearised_return,
    seed_directions,
)
from jaxbiped.gait._return_map_spec import (
    AbstractGradient,
    Forward,
    ReturnMapSpec,
    Reverse,
    arrivals_of,
    check_gradient,
    check_holds_none,
    has_switches,
    return_map_spec,
)
from jaxbiped.hybrid._hybrid_system import MINIMAL_SCENES, SCENES
from jaxbiped.hybrid._scales import units_of
from jaxbiped.hybrid._sections import AbstractSection, section_of, with_leg_names_of
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.scene._parameter_access import select_parameters
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.scene._state_types import is_redundant
from jaxbiped.simulate._derivatives import first_derivatives_only
from jaxbiped.solve._accuracy import ACCURACIES, GAIT_ACCURACIES, Precision, precision_of
from jaxbiped.variational._solve_to_section import SectionArrival, solve_to_section
from jaxbiped.variational._tangents import SectionSolve, Seeded, Tangents, VariationalSolution
from jaxbiped.variational._variational_solve import solve_variational

NO_REVERSE = (
    "gradient = Forward() carries tangents along the motion and has no reverse mode: pass "
    "gradient=Reverse() to return_map, or differentiate by jax.jvp or jax.jacfwd."
)
_Arrived: TypeAlias = tuple[PyTree, Scalar, Scalar]
"""A state, the time that it took, and the code of what ended the motion."""


@eqx.filter_custom_jvp
def forward(spec: ReturnMapSpec, precision: Precision, args: PyTree, state: PyTree) -> _Arrived:
    """The next arrival, its derivatives those of tangents that are carried along the motion."""
    if spec.programs is not None:
        solved = _solve(spec, precision, args, state, (), ())
        return _reset_on_arrival(spec, args, solved.state, solved.t, solved.code)
    found = _arrival(spec, precision, args, state)
    return _reset_on_arrival(spec, args, found.y, found.time, found.code)


@forward.def_jvp
def _forward_jvp(
    primals: tuple[PyTree, ...], tangents: tuple[PyTree, ...]
) -> tuple[PyTree, PyTree]:
    spec, precision, args, state = primals
    spec_dot, _, args_dot, _ = tangents
    if jtu.tree_leaves((spec_dot.system, spec_dot.section)):
        raise ArgumentError(
            f"{type(spec.system).__name__} or {type(spec.section).__name__} holds what is "
            "differentiated: it must be among args, whose derivatives are carried."
        )
    tangent = _tangent_by_xla if spec.programs is None else _tangent_by_lanes
    moving, still = eqx.partition((args, state), eqx.is_array)
    moving = first_derivatives_only(moving, "a return map with gradient = Forward()")
    once = eqx.combine(moving, still)
    (end, time_dot, code), row = tangent((spec, precision, *once), tangents)
    arrived = jtu.tree_unflatten(jtu.tree_structure(state), list(row))
    _, end_dot = jax.jvp(_reset(spec, code), (args, end), (full_tangents(args_dot, args), arrived))
    end_dot, time_dot = eqxi.nondifferentiable_backward((end_dot, time_dot), msg=NO_REVERSE)
    # The values by themselves: they must not depend on what they are differentiated along.
    return forward(spec, precision, args, state), (end_dot, time_dot, None)


def _tangent_by_xla(
    primals: tuple[PyTree, ...], tangents: tuple[PyTree, ...]
) -> tuple[_Arrived, Scalar]:
    """Where a motion arrives, the derivatives of its time and of its state: one tangent."""
    spec, precision, args, state = primals
    _, _, args_dot, state_dot = tangents
    args_leaves = jtu.tree_leaves(args)
    column = jnp.stack(_dense(state_dot, state))[:, None]
    seeds = _dense(args_dot, args)
    relative = [d / jnp.where(v == 0.0, 1.0, v) for d, v in zip(seeds, args_leaves, strict=True)]
    inverse = jnp.stack(jtu.tree_leaves(units_of(args, state).inverse))
    floor = STATE_FLOOR * jnp.max(jnp.abs(column[:, 0] * inverse))
    if relative:
        floor = floor + PARAMETER_FLOOR * jnp.max(jnp.abs(jnp.stack(relative)))
    seeded = Seeded(
        args,
        jnp.stack(seeds)[:, None] if seeds else jnp.zeros((0, 1)),
        floor[None],
        tuple(range(len(seeds))),
    )
    found = _arrival(spec, precision, seeded, Tangents(state, column))
    row, time_dot = jtu.tree_map(
        lambda row: jnp.where(found.undetermined, jnp.nan, row),
        (found.y.columns[:, 0], found.time_columns[0]),
    )
    return (found.y.state, time_dot, found.code), row


def _tangent_by_lanes(
    primals: tuple[PyTree, ...], tangents: tuple[PyTree, ...]
) -> tuple[_Arrived, Scalar]:
    """The same from a column for each leaf that is differentiated."""
    spec, precision, args, state = primals
    _, _, args_dot, state_dot = tangents
    state_dots, args_dots = _leaves_with_none(state_dot, state), _leaves_with_none(args_dot, args)
    places = tuple(i for i, dot in enumerate(state_dots) if dot is not None)
    active = tuple(i for i, dot in enumerate(args_dots) if dot is not None)
    found = _solve(spec, precision, args, state, places, active)
    sizes = _sizes(args, active)
    dots = [state_dots[i] for i in places]
    dots += [args_dots[i] / size for i, size in zip(active, sizes, strict=True)]
    along = jnp.stack(dots) if dots else jnp.zeros(0)
    return (found.state, along @ found.time_columns, found.code), along @ found.columns


def reverse(spec: ReturnMapSpec, precision: Precision, args: PyTree, state: PyTree) -> _Arrived:
    """The next arrival, differentiable in reverse mode."""
    if spec.programs is not None:
        return _reverse_by_lanes((args, state), spec, precision)
    return _reverse_by_xla(spec, precision, args, state)


def _reverse_by_xla(
    spec: ReturnMapSpec, precision: Precision, args: PyTree, state: PyTree
) -> _Arrived:
    inverse = jnp.stack(jtu.tree_leaves(units_of(args, state).inverse))
    count = len(inverse)
    start = Tangents(state, jnp.eye(count))
    seeded = Seeded(args, jnp.zeros((0, count)), STATE_FLOOR * inverse, ())
    found = _arrival(spec, precision, seeded, start, columns_only_choose_steps=True)
    known = (found.y.state, found.time)
    smooth = not has_switches(spec.system, args, state)
    y, time = _known_derivatives(smooth, found.undetermined, known, (args, state))
    return _reset_on_arrival(spec, args, y, time, found.code)


def _arrival(
    spec: ReturnMapSpec, precision: Precision, args: PyTree, y: PyTree, **options: bool
) -> SectionArrival:
    """The next arrival through diffrax, of a state or of tangents under seeded arguments."""
    plain, state = (args.args, y.state) if isinstance(y, Tangents) else (args, y)
    return solve_to_section(_how(spec, precision, plain, state), y, args, **options)


def _how(spec: ReturnMapSpec, precision: Precision, args: PyTree, state: PyTree) -> SectionSolve:
    watch = spec.watch(args, state, peak=False)
    return SectionSolve(watch, spec.solver, precision, spec.max_time, spec.max_solver_steps)


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _known_derivatives(smooth: bool, undetermined: Scalar, values: PyTree, given: PyTree) -> PyTree:
    """The values, whose derivatives are NaN where `undetermined`: by all that was `given`.

    Unless the field is `smooth` there are first ones alone: steps end where switches were, so that
    what these would add to second ones is not seen.
    """
    del smooth, undetermined, given
    return values


@_known_derivatives.defjvp
def _known_derivatives_jvp(
    smooth: bool,
    primals: tuple[Scalar, PyTree, PyTree],
    tangents: tuple[Scalar, PyTree, PyTree],
) -> tuple[PyTree, PyTree]:
    undetermined, values, _ = primals
    if not smooth:
        values = first_derivatives_only(values, "a return map across switches")
    _, dots, given = tangents
    # Also by what the values do not depend on here, but may on the other side.
    nothing = jnp.where(undetermined, jnp.nan, 0.0)
    moved = sum((dot * nothing for dot in jtu.tree_leaves(given)), jnp.zeros(()))
    return values, jtu.tree_map(lambda dot: dot + moved, dots)


def _reset_on_arrival(
    spec: ReturnMapSpec, args: PyTree, state: PyTree, time: Scalar, code: Scalar
) -> _Arrived:
    return _reset(spec, code)(args, state), time, code


def _reset(spec: ReturnMapSpec, code: Scalar) -> Callable[[PyTree, PyTree], PyTree]:
    """What is done to a state at the end: the reset, unless no arrival ended the motion."""
    return lambda args, y: select(code == 0, spec.system.reset_map(args, y), y)


def _dense(tangents: PyTree, like: PyTree) -> list[Scalar]:
    """Tangents of every leaf, zeros where JAX left them out."""
    return jtu.tree_leaves(full_tangents(tangents, like))


def full_tangents(tangents: PyTree, like: PyTree) -> PyTree:
    def full(leaf: Scalar | None, dot: Scalar | None) -> Scalar | None:
        # A part that there is not, as bristles may be, has no tangent either.
        return jnp.zeros_like(leaf) if dot is None and leaf is not None else dot

    return jtu.tree_map(full, like, tangents, is_leaf=lambda leaf: leaf is None)


@eqx.filter_custom_vjp
def _reverse_by_lanes(
    given: tuple[PyTree, PyTree], spec: ReturnMapSpec, precision: Precision
) -> _Arrived:
    """The columns, of just what is differentiated, are known and transposed."""
    args, state = given
    return forward(spec, precision, args, state)


@_reverse_by_lanes.def_fwd
def _reverse_by_lanes_fwd(
    perturbed: PyTree, given: tuple[PyTree, PyTree], spec: ReturnMapSpec, precision: Precision
) -> tuple[PyTree, VariationalSolution]:
    args, state = given
    active, places = (_places(part) for part in perturbed)
    found = _solve(spec, precision, args, state, places, active)
    return _reset_on_arrival(spec, args, found.state, found.t, found.code), found


@_reverse_by_lanes.def_bwd
def _reverse_by_lanes_bwd(
    found: VariationalSolution,
    cotangents: PyTree,
    perturbed: PyTree,
    given: tuple[PyTree, PyTree],
    spec: ReturnMapSpec,
    precision: Precision,
) -> tuple[PyTree, PyTree]:
    del precision
    args, state = given
    active, places = (_places(part) for part in perturbed)
    end_bar, time_bar, _ = cotangents

    _, pull = jax.vjp(_reset(spec, found.code), args, found.state)
    args_bar, arrived_bar = pull(full_tangents(end_bar, state))
    along = found.columns @ jnp.stack(jtu.tree_leaves(arrived_bar))
    if time_bar is not None:
        along = along + found.time_columns * time_bar
    by_state = dict(zip(places, along, strict=False))
    by_args = zip(active, along[len(places) :], _sizes(args, active), strict=True)
    own = jtu.tree_leaves(args_bar)
    by_parameter = {i: own[i] + bar / size for i, bar, size in by_args}
    return _sparse_tree(args, by_parameter), _sparse_tree(state, by_state)


def _places(perturbed: PyTree) -> tuple[int, ...]:
    """Positions of the leaves that are differentiated."""
    return tuple(i for i, is_so in enumerate(jtu.tree_leaves(perturbed)) if is_so)


def _sparse_tree(like: PyTree, known: dict[int, Scalar]) -> PyTree:
    """These leaves, and None for the others."""
    leaves, structure = jtu.tree_flatten(like)
    return jtu.tree_unflatten(structure, [known.get(i) for i in range(len(leaves))])


def _solve(
    spec: ReturnMapSpec,
    precision: Precision,
    args: PyTree,
    state: PyTree,
    places: tuple[int, ...],
    active: tuple[int, ...],
) -> VariationalSolution:
    """Columns by these leaves of the state, then by the logarithms of these of the arguments.

    NaN where they are not determined.
    """
    m, p = len(places), len(active)
    columns = np.zeros((len(jtu.tree_leaves(state)), m + p))
    columns[list(places), range(m)] = 1.0
    inverse = jtu.tree_leaves(units_of(args, state).inverse)
    floors = jnp.asarray([*(STATE_FLOOR * inverse[i] for i in places), *[PARAMETER_FLOOR] * p])
    found, _ = solve_variational(
        _how(spec, precision, args, state),
        Tangents(state, jnp.asarray(columns)),
        Seeded(args, jnp.zeros((p, m + p)), floors, active),
        jnp.stack(_sizes(args, active)) if active else jnp.zeros(0),
        engine=spec.programs,
    )
    nan = jnp.where(found.undetermined, jnp.nan, 0.0)
    return found._replace(columns=found.columns + nan, time_columns=found.time_columns + nan)


def _sizes(args: PyTree, active: tuple[int, ...]) -> list[Scalar]:
    """By how much parameters move: their own size, or one where they are zero."""
    leaves = jtu.tree_leaves(args)
    return [jnp.where(leaves[i] == 0.0, 1.0, leaves[i]) for i in active]


def _leaves_with_none(tangents: PyTree, like: PyTree) -> list[PyTree]:
    """Tangents of every leaf, None where JAX left them out; a part that there is not has none."""
    structure: Any = jtu.tree_structure(like)
    if tangents is None:
        return [None] * structure.num_leaves
    return list(structure.flatten_up_to(tangents))


class Return(NamedTuple):
    """An arrival of the return map.

    Attributes:
        state: state on the section after the reset (legs exchanged); cyclic coordinates continue
            from the start.
        time: duration [s].
        code: 0 for a return; otherwise the code of the `Ending` that came instead, and state and
            time are those of that ending.
    """

    state: PyTree
    time: Scalar
    code: Scalar


@without_switches
def return_map(
    args: PyTree,
    state: PyTree,
    *,
    section: AbstractSection | None = None,
    footsteps: int | None = None,
    gradient: AbstractGradient | None = None,
    accuracy: str = "balanced",
    system: AbstractSystem | None = None,
    solver: str | diffrax.AbstractSolver[PyTree] | None = None,
    max_time: Time | None = None,
    engine: str = "auto",
) -> Return:
    """Follows a motion to its next arrival at a section, differentiably.

    Derivatives are those of the map, not of the motion at a fixed time.

    Args:
        args: the scene; with `system`, the parameters of that system.
        state: start, on the section or not, with either leg standing. For a redundant scene, it may
            be a minimal state, and the result is then minimal too.
        section: section to arrive at. Default: `MidStance()`; for a rigid walker `HeelStrike()`.
        footsteps: number of footsteps to follow. Default: those of one cycle.
        gradient: `Forward()` (the default) or `Reverse()`.
        accuracy: "balanced" or "tight".
        system: another system, an `AbstractSystem`. Default: the walker.
        solver: a name (see `SOLVERS`) or any diffrax solver that estimates its errors. Default:
            "rodas4"; for a rigid walker "rodas5p".
        max_time: maximum time to an arrival [s]. Default: 10 s, or 10 units of a hybrid system's
            time.
        engine: "xla", "lanes" or "auto" (see `ENGINES`); with `system`, "auto" is "xla".
            With the lanes engine, all directions of a derivative share one solve.

    Returns:
        State at the arrival, duration [s], and a code: 0, or that of the `Ending` that came before
        an arrival. Leaves have the shape of the start's.

    Raises:
        ArgumentError: an argument is not allowed; raised before anything is compiled.
        RuntimeError: reverse mode is used with `Forward()`.
        TypeError: forward mode is used with `Reverse()`.
    """
    gradient = Forward() if gradient is None else gradient
    check_gradient(gradient)
    check_choice("accuracy", accuracy, GAIT_ACCURACIES)
    max_time = 10.0 * getattr(args, "time_unit", 1.0) if max_time is None else max_time
    check_positive("max_time", max_time, "s", one=True)
    if system is None:
        args = check_scene(args, *SCENES)
        modelled = args if is_redundant(state) else args.minimal
        state = in_64_bits(state_for(modelled, state))
    arrivals = arrivals_of(args, footsteps)
    args, state = (jtu.tree_map(as_float, tree) for tree in (args, state))
    enters = system is None and args.minimal is not args and not is_redundant(state)
    if enters:
        state = redundant_state(args, state)
    section = section_of(args, section)
    if system is None:
        state = with_leg_names_of(section, args, state)
    check_holds_none(gradient, system, section)
    spec = return_map_spec(
        args,
        state,
        section=section,
        solver=solver,
        engine=engine,
        system=system,
        max_time=max_time,
        max_solver_steps=ACCURACIES[accuracy].max_solver_steps,
    )
    follow = reverse if isinstance(gradient, Reverse) else forward
    precision = precision_of(accuracy, args)
    time, code = jnp.zeros(()), jnp.asarray(0)
    for _ in range(arrivals):
        arrived, lasted, came = follow(spec, precision, args, state)
        state = select(code == 0, arrived, state)
        time = time + jnp.where(code == 0, lasted, 0.0)
        code = jnp.where(code == 0, came, code)
    return Return(minimal_state(args, state) if enters else state, time, code)


def linearise_return_map(
    args: PyTree,
    state: PyTree,
    *,
    rtol: float,
    tangent_rtol: float,
    parameters: tuple[str, ...] | None = None,
    section: AbstractSection | None = None,
    footsteps: int | None = None,
    system: AbstractSystem | None = None,
    solver: str | diffrax.AbstractAdaptiveSolver[PyTree] | None = None,
    max_time: Time = 10.0,
    max_solver_steps: int = 32768,
    engine: str = "auto",
) -> LinearisedReturn:
    """Follows a motion for one cycle, with its derivatives with respect to start and parameters.

    `find_gait` evaluates this function. Use it to study the derivatives themselves; `stability_of`
    and `slopes_of` compute multipliers and sensitivities from the result. Tolerances are traced, so
    one compiled program serves all of them.

    Args:
        args: the scene, compliant or rigid; with `system`, the parameters of that system.
        state: start, on the section or not.
        rtol: relative tolerance of the state; the absolute one (SI units, for a walker of the
            seed's size) is a hundredth of it.
        tangent_rtol: relative tolerance of the derivatives; if it is very large, the state alone
            determines the steps.
        parameters: names of the parameters to differentiate with respect to (see
            `parameter_names`), or of the leaves of other `args`. Default: all; () for none.
        section: section to arrive at. Default: `MidStance()`; for a rigid walker `HeelStrike()`.
        footsteps: number of footsteps of a cycle. Default: the smallest possible number.
        system: another system, an `AbstractSystem`. Default: the walker.
        solver: a name (see `SOLVERS`) or any diffrax solver that estimates its errors. Default:
            "rodas4"; for a rigid walker "rodas5p".
        max_time: maximum time to an arrival [s].
        max_solver_steps: maximum number of attempted steps to an arrival.
        engine: "xla", "lanes" or "auto" (see `ENGINES`); for a system of your own, "auto" is "xla".

    Returns:
        The returning state, period, advance and largest load, with their derivatives; those with
        respect to a parameter are in units of its size.

    Raises:
        ArgumentError: an argument is not allowed; raised before anything is compiled.
    """
    if system is None:
        check_type("args", args, *MINIMAL_SCENES)
    for name, tolerance in (("rtol", rtol), ("tangent_rtol", tangent_rtol)):
        check_positive(name, tolerance)
    check_positive("max_time", max_time, "s", one=True)
    arrivals = arrivals_of(args, footsteps)
    check_count("max_solver_steps", max_solver_steps)
    _, active = select_parameters(args, parameters)
    args, state = (jtu.tree_map(as_float, tree) for tree in (args, state))
    spec = return_map_spec(
        args,
        state,
        section=section,
        solver=solver,
        engine=engine,
        system=system,
        steps=arrivals,
        max_time=as_float(max_time),
        max_solver_steps=int(max_solver_steps),
    )
    recurring = len(jtu.tree_leaves(state)) - len(spec.system.cyclic_coordinates)
    seeds, _ = seed_directions(args, active, recurring)
    precision = Precision(as_float(rtol), as_float(tangent_rtol))
    return linearised_return(spec, seeds, state, precision, jnp.asarray(False))
