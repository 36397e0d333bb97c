"""The search for a periodic orbit: a fixed point of the return map."""

import enum
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.gait._newton import Method, Progress, Stage, begun, chosen, progressed
from jaxbiped.gait._turn import Turn, Turning, recurring_of, seeded, state_with, turn
from jaxbiped.solve._passage import Precision

LOOSER = 10.0
"""How much looser the search is solved before its last turns, and the witness of their error."""
_ROUGH = Precision(3e-6, 3e-4)
"""How exactly the search is solved until it is near."""


class Search(enum.IntEnum):
    """How a search ended. `str(search)` is its name in words.

    - found: the orbit returns to within the residual asked for.
    - no return: the first turn already ended in a misfortune (its `Ending` tells which).
    - not converged: no step reduced the residual any more, or the turns allowed were used up.
    """

    FOUND = 0
    NO_RETURN = 1
    NOT_CONVERGED = 2

    def __str__(self) -> str:
        return self.name.lower().replace("_", " ")


class Found(NamedTuple):
    """A fixed point, or the best that was found instead.

    Attributes:
        ending: code of a `Search`.
        code: that of the `Ending` of the last turn that did not return, 0 for none.
        recurring: the m recurring components.
        residual: largest of their changes over a turn; infinite where nothing returned.
        last: the turn from there.
        coarse: a looser turn near there, the witness of the last one's error.
        turns: number of turns taken.
        history: residual of each turn, shape (most_turns,), NaN beyond the last.
    """

    ending: Scalar
    code: Scalar
    recurring: Scalar
    residual: Scalar
    last: Turn
    coarse: Turn
    turns: Scalar
    history: Scalar


Run = Callable[[Scalar, Scalar, Scalar], Turn]
"""The turn from recurring components, as exactly as a stage wants, or none where idle."""


def search(
    turning: Turning,
    args: PyTree,
    active: tuple[int, ...],
    guess: PyTree,
    precision: Precision,
    method: Method,
) -> Found:
    """Searches from `guess`, on the section or not: roughly, then 10 times looser, then finely."""
    first = recurring_of(turning.system, guess)
    off = jnp.abs(turning.section.value(args, guess))
    whole = _runner(turning, args, active, guess, precision, save_nodes=True)
    if turning.engine == "lanes":
        bare = _runner(turning, args, (), guess, precision, save_nodes=False)
        end = _by_lanes(bare, whole, first, off, method)
    else:
        # One loop, all directions in it: each loop is compiled for itself.
        nothing = _nothing(whole, first)
        begin = begun(first, off, method, nothing)._replace(coarse=nothing)
        end = _advanced(whole, begin, method, Stage.FOUND)
    assert end.coarse is not None
    ending = jnp.where(
        end.stage == Stage.FOUND,
        int(Search.FOUND),
        jnp.where(end.stage == Stage.NO_RETURN, int(Search.NO_RETURN), int(Search.NOT_CONVERGED)),
    )
    return Found(
        ending=ending,
        code=end.code,
        recurring=end.base,
        residual=end.base_residual,
        last=end.base_turn,
        coarse=end.coarse,
        turns=end.turns,
        history=end.history,
    )


def _by_lanes(bare: Run, whole: Run, first: Scalar, off: Scalar, method: Method) -> Progress:
    """Turns are `bare` of directions but the state's until it is near."""
    now = _advanced(bare, begun(first, off, method, _nothing(bare, first)), method, Stage.COARSE)
    nothing = _nothing(whole, first)
    now = now._replace(base_turn=nothing, coarse=nothing)

    def near(now: Progress) -> Scalar:
        return _goes_on(now, method, Stage.COARSE, Stage.FOUND)

    def goes_on(both: tuple[Progress, Scalar]) -> Scalar:
        return near(both[0]) | both[1]

    def advance(both: tuple[Progress, Scalar]) -> tuple[Progress, Scalar]:
        now, untold = both
        on = near(now)
        latest = whole(jnp.where(on, now.trial, now.base), now.stage, ~(on | untold))
        told = now._replace(base_turn=chosen(untold, latest, now.base_turn))
        return chosen(on, progressed(now, latest, method), told), jnp.asarray(False)

    # Whoever did not come near still has the best orbit told.
    untold = ~near(now) & (now.stage != Stage.NO_RETURN)
    return jax.lax.while_loop(goes_on, advance, (now, untold))[0]


def _runner(
    turning: Turning,
    args: PyTree,
    active: tuple[int, ...],
    guess: PyTree,
    precision: Precision,
    *,
    save_nodes: bool,
) -> Run:
    """Turns with derivatives by the state and by the `active` parameters."""
    seeds, _ = seeded(args, active, len(recurring_of(turning.system, guess)))
    coarse = Precision(LOOSER * precision.rtol, LOOSER * precision.tangent_rtol)

    def run(trial: Scalar, stage: Scalar, idle: Scalar) -> Turn:
        wanted = Precision(
            *(
                jnp.where(stage == Stage.FINE, a, jnp.where(stage == Stage.COARSE, b, c))
                for a, b, c in zip(precision, coarse, _ROUGH, strict=True)
            )
        )
        start = state_with(turning.system, guess, trial)
        return turn(turning, seeds, start, wanted, idle, save_nodes=save_nodes)

    return run


def _advanced(run: Run, begin: Progress, method: Method, until: Stage) -> Progress:
    """Searches on until a stage is reached or the turns are used up."""

    def goes_on(now: Progress) -> Scalar:
        return _goes_on(now, method, Stage.APPROACH, until)

    def advance(now: Progress) -> Progress:
        on = goes_on(now)
        return chosen(on, progressed(now, run(now.trial, now.stage, ~on), method), now)

    return jax.lax.while_loop(goes_on, advance, begin)


def _goes_on(now: Progress, method: Method, since: Stage, until: Stage) -> Scalar:
    return (now.stage >= since) & (now.stage < until) & (now.turns < method.most_turns)


def _nothing(run: Run, first: Scalar) -> Turn:
    """A turn of zeros."""
    shape: Turn = jax.eval_shape(run, first, jnp.asarray(0), jnp.asarray(True))
    return jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shape)
