"""The return map as a function that JAX can differentiate."""

from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import equinox.internal as eqxi
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import check_choice, check_positive
from jaxbiped._types import Scalar, as_float
from jaxbiped.dynamics._section import AbstractSection, MidStance
from jaxbiped.gait._engine import orbit_engine
from jaxbiped.gait._gradient import AbstractGradient, Forward, check_anywhere
from jaxbiped.gait._precision import GAIT_ACCURACIES, MOST_SOLVER_STEPS, precision_of
from jaxbiped.gait._system import AbstractSystem, Walking
from jaxbiped.gait._turn import PARAMETER_FLOOR, STATE_FLOOR, Turning
from jaxbiped.lanes._adaptive_columns import Crossed
from jaxbiped.lanes._crossing import cross
from jaxbiped.solve._columns import Seeded, Tangents
from jaxbiped.solve._passage import Precision, passage
from jaxbiped.solve._rodas4 import Rodas4

_NO_REVERSE = (
    "gradient = Forward() carries tangents along the motion and has no reverse mode: pass "
    "gradient=Reverse() to return_map, or differentiate by jax.jvp or jax.jacfwd."
)


class Return(NamedTuple):
    """Where the return map leads.

    Attributes:
        state: on the section, renewed (legs exchanged); drifting components go on from the start's.
        time: duration [s].
        code: 0 for a return, else that of the `Ending` that came instead; state and time are then
            where it ended.
    """

    state: PyTree
    time: Scalar
    code: Scalar


def return_map(
    args: PyTree,
    state: PyTree,
    *,
    section: AbstractSection | None = None,
    steps: int = 1,
    gradient: AbstractGradient | None = None,
    accuracy: str = "balanced",
    system: AbstractSystem | None = None,
    solver: diffrax.AbstractAdaptiveSolver | None = None,
    time_limit: Any = 10.0,
    engine: str = "auto",
) -> Return:
    """Follows a motion to its next arrival at a section, differentiably.

    Derivatives follow the arrival: they are those of the map, not of the motion at a fixed time.

    Args:
        args: the scene, or the parameters of another `system`.
        state: start, on the section or not.
        section: `MidStance()` unless given.
        steps: how many arrivals to follow.
        gradient: `Forward()` (the default) or `Reverse()`.
        accuracy: "balanced" or "tight".
        system: the walker unless given.
        solver: `Rodas4()` unless given.
        time_limit: longest time to an arrival [s].
        engine: "xla", "lanes" or "auto" (see `ENGINES`), which here is "xla" for a system of your
            own and for `Reverse()`. By lanes all directions of `jax.jacfwd` share one solve.

    Raises:
        ArgumentError: an argument that is not allowed, before anything is compiled.
        RuntimeError: reverse mode through `Forward()`.
        TypeError: forward mode through `Reverse()`.
    """
    gradient = Forward() if gradient is None else gradient
    check_anywhere(gradient, "a return map")
    check_choice("accuracy", accuracy, GAIT_ACCURACIES)
    check_positive("steps", steps)
    args, state = (jtu.tree_map(as_float, tree) for tree in (args, state))
    section = MidStance() if section is None else section
    solver = Rodas4() if solver is None else solver
    chosen = orbit_engine(
        engine,
        solver=solver,
        section=section,
        leaves=(args, state),
        gradient=gradient,
        own_system=system is not None,
    )
    turning = Turning(
        system=Walking() if system is None else system,
        section=section,
        solver=solver,
        time_limit=time_limit,
        steps=1,
        max_solver_steps=MOST_SOLVER_STEPS[accuracy],
        engine=chosen,
    )
    forward = _by_lanes if chosen == "lanes" else _forward
    follow = forward if isinstance(gradient, Forward) else _reverse
    precision = precision_of(accuracy)
    time, code = jnp.zeros(()), jnp.asarray(0)
    for _ in range(int(steps)):
        arrived, lasted, came = follow(turning, precision, args, state)
        state = _where(code == 0, arrived, state)
        time = time + jnp.where(code == 0, lasted, 0.0)
        code = jnp.where(code == 0, came, code)
    return Return(state, time, code)


def _renewed(turning: Turning, args: PyTree, state: PyTree, time: Any, code: Any) -> tuple:
    return _where(code == 0, turning.system.renew(args, state), state), time, code


def _where(condition: Any, a: PyTree, b: PyTree) -> PyTree:
    return jtu.tree_map(lambda x, y: jnp.where(condition, x, y), a, b)


@eqx.filter_custom_jvp
def _forward(
    turning: Turning, precision: Precision, args: PyTree, state: PyTree
) -> tuple[PyTree, Scalar, Scalar]:
    watch = turning.watch(args, state, peak=False)
    found = passage(
        watch,
        turning.solver,
        state,
        args,
        precision=precision,
        time_limit=turning.time_limit,
        max_solver_steps=turning.max_solver_steps,
    )
    return _renewed(turning, args, found.y, found.time, found.code)


@_forward.def_jvp
def _forward_jvp(primals: tuple, tangents: tuple) -> tuple[Any, Any]:
    turning, precision, args, state = primals
    _, _, args_dot, state_dot = tangents
    args_leaves = jtu.tree_leaves(args)
    column = jnp.stack(_dense(state_dot, state))[:, None]
    seeds = _dense(args_dot, args)
    relative = [d / jnp.where(v == 0.0, 1.0, v) for d, v in zip(seeds, args_leaves, strict=True)]
    floor = STATE_FLOOR * jnp.max(jnp.abs(column))
    if relative:
        floor = floor + PARAMETER_FLOOR * jnp.max(jnp.abs(jnp.stack(relative)))
    seeded = Seeded(
        args,
        jnp.stack(seeds)[:, None] if seeds else jnp.zeros((0, 1)),
        floor[None],
        tuple(range(len(seeds))),
    )
    found = passage(
        turning.watch(args, state, peak=False),
        turning.solver,
        Tangents(state, column),
        seeded,
        precision=precision,
        time_limit=turning.time_limit,
        max_solver_steps=turning.max_solver_steps,
    )
    structure = jtu.tree_structure(state)
    arrived = jtu.tree_unflatten(structure, list(found.y.columns[:, 0]))

    def renew(args: PyTree, y: PyTree) -> PyTree:
        return _renewed(turning, args, y, found.time, found.code)[0]

    _, end_dot = jax.jvp(renew, (args, found.y.state), (_full(args_dot, args), arrived))
    end_dot, time_dot = eqxi.nondifferentiable_backward(
        (end_dot, found.time_columns[0]), msg=_NO_REVERSE
    )
    # The values by themselves: they must not depend on what they are differentiated along.
    values = _forward(turning, precision, args, state)
    return values, (end_dot, time_dot, None)


@eqx.filter_custom_jvp
def _by_lanes(
    turning: Turning, precision: Precision, args: PyTree, state: PyTree
) -> tuple[PyTree, Scalar, Scalar]:
    found = _crossed(turning, precision, args, state, (), ())
    return _renewed(turning, args, found.state, found.t, found.code)


@_by_lanes.def_jvp
def _by_lanes_jvp(primals: tuple, tangents: tuple) -> tuple[Any, Any]:
    turning, precision, args, state = primals
    _, _, args_dot, state_dot = tangents
    moved, steered = _leaves_with_none(state_dot, state), _leaves_with_none(args_dot, args)
    places = tuple(i for i, dot in enumerate(moved) if dot is not None)
    active = tuple(i for i, dot in enumerate(steered) if dot is not None)
    found = _crossed(turning, precision, args, state, places, active)
    sizes = _sizes(args, active)
    dots = [moved[i] for i in places]
    dots += [steered[i] / size for i, size in zip(active, sizes, strict=True)]
    along = jnp.stack(dots) if dots else jnp.zeros(0)
    arrived = jtu.tree_unflatten(jtu.tree_structure(state), list(along @ found.columns))

    def renew(args: PyTree, y: PyTree) -> PyTree:
        return _renewed(turning, args, y, found.t, found.code)[0]

    _, end_dot = jax.jvp(renew, (args, found.state), (_full(args_dot, args), arrived))
    end_dot, time_dot = eqxi.nondifferentiable_backward(
        (end_dot, along @ found.time_columns), msg=_NO_REVERSE
    )
    return _by_lanes(turning, precision, args, state), (end_dot, time_dot, None)


def _crossed(
    turning: Turning,
    precision: Precision,
    args: PyTree,
    state: PyTree,
    places: tuple[int, ...],
    active: tuple[int, ...],
) -> Crossed:
    """Columns by these leaves of the state, then by the logarithms of these of the arguments."""
    m, p = len(places), len(active)
    columns = np.zeros((len(jtu.tree_leaves(state)), m + p))
    columns[list(places), range(m)] = 1.0
    floors = jnp.asarray([STATE_FLOOR] * m + [PARAMETER_FLOOR] * p)
    found, _ = cross(
        turning.watch(args, state, peak=False),
        turning.solver,
        Tangents(state, jnp.asarray(columns)),
        Seeded(args, jnp.zeros((p, m + p)), floors, active),
        jnp.stack(_sizes(args, active)) if active else jnp.zeros(0),
        precision=precision,
        time_limit=turning.time_limit,
        max_solver_steps=turning.max_solver_steps,
    )
    return found


def _sizes(args: PyTree, active: tuple[int, ...]) -> list[Scalar]:
    """By how much parameters move: their own size, or one where they are zero."""
    leaves = jtu.tree_leaves(args)
    return [jnp.where(leaves[i] == 0.0, 1.0, leaves[i]) for i in active]


def _leaves_with_none(tangents: PyTree, like: PyTree) -> list[Any]:
    """Tangents of every leaf, None where JAX left them out."""
    if tangents is None:
        return [None] * len(jtu.tree_leaves(like))
    return jtu.tree_leaves(tangents, is_leaf=lambda leaf: leaf is None)


def _reverse(
    turning: Turning, precision: Precision, args: PyTree, state: PyTree
) -> tuple[PyTree, Scalar, Scalar]:
    count = len(jtu.tree_leaves(state))
    steering = Tangents(state, jnp.eye(count))
    seeded = Seeded(args, jnp.zeros((0, count)), jnp.full(count, STATE_FLOOR), ())
    found = passage(
        turning.watch(args, state, peak=False),
        turning.solver,
        steering,
        seeded,
        precision=precision,
        time_limit=turning.time_limit,
        max_solver_steps=turning.max_solver_steps,
        columns_only_steer=True,
    )
    return _renewed(turning, args, found.y.state, found.time, found.code)


def _dense(tangents: PyTree, like: PyTree) -> list[Scalar]:
    """Tangents of every leaf, zeros where JAX left them out."""
    return jtu.tree_leaves(_full(tangents, like))


def _full(tangents: PyTree, like: PyTree) -> PyTree:
    return jtu.tree_map(
        lambda leaf, dot: jnp.zeros_like(leaf) if dot is None else dot,
        like,
        tangents,
        is_leaf=lambda leaf: leaf is None,
    )
