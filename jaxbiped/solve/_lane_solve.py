"""Adaptive solves by lanes, or by what runs their programs on devices."""

from typing import NamedTuple, cast

import jax.tree_util as jtu
import numpy as np

from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.compiler import CUDA, LANES, LaneEngine, Program, Recorded, Request
from jaxbiped.solve._adaptive_program import AdaptiveSolve, Solve, Solved
from jaxbiped.solve._saved_outputs import Saved
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock

_ROOM = 1 << 18
"""Steps that there is room for at first; who takes more runs again, with room for as many."""


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


def solve_scene(
    solve: Solve, setting: Setting, *, times: np.ndarray | None = None, room: int = 0
) -> tuple[Solved, Recorded | None]:
    """Solves one simulation, or under `vmap` many, with records of what the setting saves.

    They are the time and the state's components at each of `times`, or for the first `room`
    arrivals at a section. It has no derivatives.

    Raises:
        UnknownPrimitiveError: the scene holds an operation that lanes do not have.
    """
    engine = lane_engine(device=setting.device)
    request = request_of(solve, setting)._replace(times=times, room=room)
    found = engine.run(request)
    return found.outputs, found.records


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
    return AdaptiveSolve(solver, watch, counting=counting, saved=saved, located=True).program()
