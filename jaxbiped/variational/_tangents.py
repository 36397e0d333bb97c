"""Tangents: a state with its derivatives, and what a solve of them watches, takes and gives."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Scalar, Time, VectorField
from jaxbiped.hybrid._implicit_field import ImplicitField
from jaxbiped.hybrid._scales import Units
from jaxbiped.solve._accuracy import Precision
from jaxbiped.solve._watch import Watch


class Tangents(NamedTuple):
    """A state and its derivatives in n directions.

    Attributes:
        state: pytree of scalars, c in all.
        columns: derivatives of its leaves, in their order, shape (c, n).
    """

    state: PyTree
    columns: Scalar


class Seeded(eqx.Module):
    """The arguments of a vector field and the directions in which they are differentiated.

    Attributes:
        args: pytree of scalars.
        seeds: derivatives of the active leaves in each direction, shape (p, n).
        floors: size below which a column's error is measured absolutely, shape (n,).
        active: positions of the p leaves of `args` that any direction moves.
    """

    args: PyTree
    seeds: Scalar
    floors: Scalar
    active: tuple[int, ...] = eqx.field(static=True)


def is_cut_short(code: Scalar) -> Scalar:
    """Whether a solve that ended so came neither to its section nor to its time."""
    return (code == int(Ending.OUT_OF_STEPS)) | (code == int(Ending.SOLVER_FAILED))


def active_leaves(args: Seeded) -> list[Scalar]:
    """The leaves that any direction moves."""
    leaves = jtu.tree_leaves(args.args)
    return [leaves[i] for i in args.active]


def with_active(args: Seeded, values: Sequence[Scalar]) -> PyTree:
    """The arguments with their active leaves replaced."""
    leaves, structure = jtu.tree_flatten(args.args)
    for i, value in zip(args.active, values, strict=True):
        leaves[i] = value
    return jtu.tree_unflatten(structure, leaves)


def along_columns(
    function: Callable[[PyTree, PyTree], PyTree], y: Tangents, args: Seeded
) -> tuple[PyTree, PyTree]:
    """`function(state, args)` and its derivatives along the columns, leaves of shape (n, …)."""
    of_leaves, leaves = _of_leaves(function, y, args)

    def along(column: Scalar, seed: Scalar) -> PyTree:
        return jax.jvp(of_leaves, leaves, (list(column), list(seed)))

    return jax.vmap(along, in_axes=-1, out_axes=(None, 0))(y.columns, args.seeds)


def along_columns_in_turn(
    function: Callable[[PyTree, PyTree], PyTree], y: Tangents, args: Seeded
) -> tuple[PyTree, PyTree]:
    """`along_columns`, one column after the other."""
    of_leaves, leaves = _of_leaves(function, y, args)

    def along(each: tuple[Scalar, Scalar]) -> PyTree:
        tangents = tuple([part[i] for i in range(part.shape[0])] for part in each)
        return jax.jvp(of_leaves, leaves, tangents)[1]

    found = jax.lax.map(along, (y.columns.T, args.seeds.T))
    return of_leaves(*leaves), found


def _of_leaves(
    function: Callable[[PyTree, PyTree], PyTree], y: Tangents, args: Seeded
) -> tuple[Callable[..., PyTree], tuple[list[Scalar], list[Scalar]]]:
    """A function of the state's and the active leaves, and these."""
    state, structure = jtu.tree_flatten(y.state)

    def of_leaves(state: list[Scalar], parameters: list[Scalar]) -> PyTree:
        return function(jtu.tree_unflatten(structure, state), with_active(args, parameters))

    return of_leaves, (state, active_leaves(args))


def as_columns(tangents: PyTree) -> Scalar:
    """Derivatives with leaves of shape (n,) as one matrix of shape (c, n)."""
    return jnp.stack(jtu.tree_leaves(tangents))


def plain_state(y: PyTree) -> PyTree:
    """The state without its columns."""
    return y.state if isinstance(y, Tangents) else y


def plain_args(args: PyTree) -> PyTree:
    """The arguments without their seeds."""
    return args.args if isinstance(args, Seeded) else args


def traced_once(field: VectorField) -> VectorField:
    """The same field, compiled by itself: traced once, not at each of its many uses."""
    if isinstance(field, ImplicitField):
        return ImplicitField(
            jax.jit(field.field), jax.jit(field.mass_matrix), jax.jit(field.residual)
        )
    return jax.jit(field)


class SectionSolve(NamedTuple):
    """How motions are followed: to a section, a failure or the end of their time.

    Attributes:
        watch: what steps end on, and what ends the solve.
        solver: of the steps.
        precision: tolerances of states and columns.
        max_time: longest time [s].
        max_solver_steps: cap on the attempted steps.
    """

    watch: Watch
    solver: diffrax.AbstractAdaptiveSolver[PyTree]
    precision: Precision
    max_time: Time
    max_solver_steps: int


class VariationalProblem(NamedTuple):
    """One solve's inputs. Of n directions, m are of the state and p of parameters.

    Attributes:
        args, state: parameters and start, pytrees of scalars.
        by_state: columns of the first m directions, shape (m, c).
        by_parameter: of the others, shape (p, c).
        sizes: by how much these move their parameter, shape (p,).
        carries_parameters: whether these are carried at all (0 or 1).
        state_floors, parameter_floors: below which errors of columns are absolute, (m,) and (p,).
        rtol, tangent_rtol: tolerances of state and columns.
        units: of the state's leaves and of time.
        max_time: longest time to the section [s]; from `almost` on, a step there ends there.
        max_attempts: cap on attempted steps.
    """

    args: PyTree
    state: PyTree
    by_state: Scalar
    by_parameter: Scalar
    sizes: Scalar
    carries_parameters: Scalar
    state_floors: Scalar
    parameter_floors: Scalar
    rtol: Scalar
    tangent_rtol: Scalar
    units: Units
    max_time: Scalar
    almost: Scalar
    max_attempts: Scalar


class VariationalSolution(NamedTuple):
    """What a solve found: as in `SectionArrival`, all columns as rows of shape (m + p, …).

    Attributes:
        t, reached, time_columns: on the section.
        state, columns: there, or behind it where the watch's `arrival` makes another one of it.
        code, attempted, jumps, grazes, peak, peak_columns: see there.
        accepted: number of steps accepted.
    """

    t: Scalar
    reached: PyTree
    state: PyTree
    columns: Scalar
    time_columns: Scalar
    code: Scalar
    attempted: Scalar
    accepted: Scalar
    jumps: Scalar
    grazes: Scalar
    peak: Scalar
    peak_columns: Scalar

    @property
    def undetermined(self) -> Scalar:
        """Whether the columns are not the derivatives of the motion (boolean)."""
        return (self.grazes > 0) | is_cut_short(self.code)
