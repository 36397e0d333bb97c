"""Differentiable solve: scenes solved by lanes, with derivatives of their own.

JAX cannot differentiate machine code, so the rules of both modes are given here.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import PyTree, PyTreeDef

from jaxbiped._caches import PROGRAMS, bounded_cache
from jaxbiped._checks import ArgumentError
from jaxbiped._types import Scalar
from jaxbiped.compiler import CUDA, LANES, LaneEngine, Program, Recorded, Request
from jaxbiped.dynamics._minimal_motion import vector_field
from jaxbiped.dynamics._state import State
from jaxbiped.dynamics._switches import switches
from jaxbiped.solve._accuracy import Precision
from jaxbiped.solve._adaptive_program import AdaptiveSolve, Solve, Solved
from jaxbiped.solve._saved_outputs import Saved
from jaxbiped.solve._units import units_of
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock
from jaxbiped.variational._switch_locator import Watch
from jaxbiped.variational._tangents import Seeded, Tangents
from jaxbiped.variational._variational_solve import solve_variational
from jaxbiped.variational._variational_types import VariationalSolution

_LOOSER = 10.0
"""Tolerance of derivatives, in units of the state's."""
_FLOOR = 1e-4
"""Size below which a derivative's error is absolute, along a direction of its own size."""
_MOST_ATTEMPTS = 1_000_000
_ROOM = 1 << 18
"""Steps that there is room for at first; who takes more runs again, with room for as many."""
_WATCH = Watch(field=vector_field, switches=switches)
"""Derivatives are taken up to the time at which the plain solve ended."""


class Setting(NamedTuple):
    """What a program is made for, besides a scene's structure; see `AdaptiveSolve`.

    Attributes:
        solver, watch, counting, saved: see there.
        quick: see `Request`.
        device: whether CUDA devices solve it.
    """

    solver: AbstractRosenbrock
    watch: tuple[str, ...]
    counting: bool
    quick: bool
    saved: Saved = Saved()
    device: bool = False


def lane_engine(*, device: bool) -> LaneEngine:
    """What runs programs of lanes: devices or the CPU."""
    return CUDA if device else LANES


def solve_scene(solve: Solve, setting: Setting) -> Solved:
    """Solves one simulation, or under `vmap` many.

    Its derivatives are those of the final state, and with respect to the duration that of the
    time; where a simulation ended otherwise, they are at that fixed time. They come from tangent
    columns of exactly the leaves that are differentiated, under a tolerance of their own, in a
    solve of their own: in forward mode one for all directions, in reverse mode its transpose.
    Where a switch is grazed, or the field jumps at the very end, they are NaN.

    Raises:
        UnknownPrimitiveError: the scene holds an operation that lanes do not have.
    """
    leaves, structure = jtu.tree_flatten(solve)
    if not any(isinstance(leaf, jax.core.Tracer) for leaf in leaves):
        return _run(solve, setting)[0]
    return Solved(*_unflatten(solve.state, _differentiable(setting, structure)(*leaves)))


def solve_and_save(
    solve: Solve, setting: Setting, *, times: np.ndarray | None = None, room: int = 0
) -> tuple[Solved, Recorded | None]:
    """The same with what the setting saves: records of the time and the state's eight components.

    They are made at each of `times`, or for the first `room` arrivals at a section. It has no
    derivatives.
    """
    return _run(solve, setting, times=times, room=room)


def solve_step_by_step(solve: Solve, setting: Setting, *, most: int) -> tuple[Solved, np.ndarray]:
    """One simulation, not traced, and the records of its at most so many steps, (n, numbers)."""
    one = jtu.tree_map(lambda leaf: np.asarray(leaf)[None], solve)

    def run(room: int) -> tuple[Solved, Recorded]:
        engine = lane_engine(device=setting.device)
        found = engine.run(request_of(one, setting)._replace(room=room, batch=True))
        return found.outputs, cast(Recorded, found.records)

    outputs, recorded = run(min(most, _ROOM))
    if recorded.counts[0] > _ROOM:
        # Memory is asked for by what a solve takes, not by what it might.
        outputs, recorded = run(int(recorded.counts[0]))
    return jtu.tree_map(lambda leaf: leaf[0], outputs), recorded.values[0, : recorded.counts[0]]


def request_of(solve: Solve, setting: Setting) -> Request:
    """What is asked of lanes; they may hold no operation that it needs (see `LaneEngine.can`)."""
    return Request(_program(setting), solve, quick=setting.quick)


@bounded_cache(PROGRAMS)  # the same object each time, so that nothing is compiled again
def _program(setting: Setting) -> Program:
    solver, watch, counting, _, saved, _ = setting
    return AdaptiveSolve(solver, watch, counting=counting, saved=saved).program()


def _run(solve: Solve, setting: Setting, **options: Any) -> tuple[Solved, Recorded | None]:
    engine = lane_engine(device=setting.device)
    found = engine.run(request_of(solve, setting)._replace(**options))
    return found.outputs, found.records


@bounded_cache(PROGRAMS)
def _differentiable(setting: Setting, structure: PyTreeDef) -> Callable[..., list[Scalar]]:
    @jax.custom_jvp
    def run(*leaves: Scalar) -> list[Scalar]:
        solve = jtu.tree_unflatten(structure, leaves)
        return jtu.tree_leaves(_run(solve, setting)[0])

    def rule(
        primals: Sequence[Scalar], tangents: Sequence[Scalar | SymbolicZero]
    ) -> tuple[list[Scalar], list[Scalar]]:
        solve = jtu.tree_unflatten(structure, primals)
        if solve.scene.redundant:
            raise ArgumentError(
                f'engine = "{"cuda" if setting.device else "lanes"}" is not allowed here: '
                "derivatives in redundant coordinates are "
                'diffrax\'s; use engine="xla".'
            )
        found = run(*primals)
        solve_dot = jtu.tree_unflatten(structure, tangents)
        t, state, *counts = _unflatten(solve.state, found)
        t_dot, state_dot = _tangents(setting, solve, solve_dot, t, state)
        none: list[PyTree] = [
            np.zeros(jnp.shape(count), dtype=jax.dtypes.float0) for count in counts
        ]
        return found, [t_dot, *state_dot, *none]

    run.defjvp(rule, symbolic_zeros=True)
    return run


def _unflatten(like: PyTree, found: Sequence[Scalar]) -> tuple[PyTree, ...]:
    t, *rest = found
    leaves, structure = jtu.tree_flatten(like)
    size = len(leaves)
    return t, jtu.tree_unflatten(structure, rest[:size]), *rest[size:]


def _tangents(
    setting: Setting, solve: Solve, solve_dot: Solve, t: Scalar, state: State
) -> tuple[Scalar, list[Scalar]]:
    """Derivatives of the time and of the final state along the tangents, linear in them."""
    places = [i for i, dot in enumerate(solve_dot.state) if not _is_zero(dot)]
    scene_dots = jtu.tree_leaves(solve_dot.scene, is_leaf=_is_zero)
    active = tuple(i for i, dot in enumerate(scene_dots) if not _is_zero(dot))
    total = [jnp.zeros_like(leaf) for leaf in state]
    if places or active:
        found = _columns(setting, solve, places, active, t)
        columns = jnp.where(found.undetermined, jnp.nan, found.columns)
        dots = [solve_dot.state[i] for i in places] + [scene_dots[i] for i in active]
        for k, dot in enumerate(dots):
            total = [sum_ + columns[k, i] * dot for i, sum_ in enumerate(total)]
    t_dot = jnp.zeros_like(t)
    if not _is_zero(solve_dot.duration):
        t_dot = jnp.where(t >= solve.duration, 1.0, 0.0) * solve_dot.duration
        rates = vector_field(t, state, solve.scene)
        total = [sum_ + rate * t_dot for sum_, rate in zip(total, rates, strict=True)]
    return t_dot, total


def _is_zero(tangent: object) -> bool:
    return isinstance(tangent, SymbolicZero)


def _columns(
    setting: Setting, solve: Solve, places: list[int], active: tuple[int, ...], t: Scalar
) -> VariationalSolution:
    """Derivatives of the final state with respect to start and scene."""
    c, m, p = len(solve.state), len(places), len(active)
    start = np.zeros((c, m + p))
    start[places, range(m)] = 1.0
    leaves = jtu.tree_leaves(solve.scene)
    sizes = [jnp.where(leaves[i] == 0.0, 1.0, jnp.abs(leaves[i])) for i in active]
    inverse = units_of(solve.scene, solve.state).inverse
    by_state = [jnp.asarray(_FLOOR * inverse[i]) for i in places]
    floors = jnp.stack([*by_state, *(_FLOOR / size for size in sizes)])
    return solve_variational(
        _WATCH,
        setting.solver,
        Tangents(solve.state, jnp.asarray(start)),
        Seeded(solve.scene, jnp.zeros((p, m + p)), floors, active),
        jnp.ones(p),
        precision=Precision(solve.rtol, _LOOSER * solve.rtol),
        max_time=t,
        max_solver_steps=_MOST_ATTEMPTS,
        engine=lane_engine(device=setting.device),
    )[0]
