"""The return map as a function that JAX can differentiate."""

from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import equinox.internal as eqxi
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._checks import check_choice, check_positive
from jaxbiped._types import Scalar, as_float
from jaxbiped.gait._gradient import AbstractGradient, Forward, check_anywhere
from jaxbiped.gait._precision import GAIT_ACCURACIES, MOST_SOLVER_STEPS, precision_of
from jaxbiped.gait._section import AbstractSection, MidStance
from jaxbiped.gait._system import AbstractSystem, Walking
from jaxbiped.gait._turn import PARAMETER_FLOOR, STATE_FLOOR, Turning
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

    Raises:
        ArgumentError: an argument that is not allowed, before anything is compiled.
        RuntimeError: reverse mode through `Forward()`.
        TypeError: forward mode through `Reverse()`.
    """
    gradient = Forward() if gradient is None else gradient
    check_anywhere(gradient, "a return map")
    check_choice("accuracy", accuracy, GAIT_ACCURACIES)
    check_positive("steps", steps)
    turning = Turning(
        system=Walking() if system is None else system,
        section=MidStance() if section is None else section,
        solver=Rodas4() if solver is None else solver,
        time_limit=time_limit,
        steps=1,
        max_solver_steps=MOST_SOLVER_STEPS[accuracy],
        engine="xla",
    )
    follow = _forward if isinstance(gradient, Forward) else _reverse
    args, state = (jtu.tree_map(as_float, tree) for tree in (args, state))
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
