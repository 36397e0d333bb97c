"""The search for a periodic orbit: a fixed point of the return map."""

import enum
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.gait._small_matrices import solved
from jaxbiped.gait._turn import Turn, Turning, recurring_of, seeded, state_with, turn
from jaxbiped.solve._passage import Precision

LOOSER = 10.0
"""How much looser the search is solved before its last turns, and the witness of their error."""
_ROUGH = Precision(3e-6, 3e-4)
"""How exactly the search is solved until it is near."""
_NEAR, _NEARER = 1e-3, 1e-4
"""Residuals at which rough solves give way to coarse ones, and these to fine ones."""
_FIRST_DAMPING, _LARGEST_DAMPING = 1e-3, 1e8


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


class Method(eqx.Module):
    """How to search.

    Attributes:
        optimiser: of the squared residual, by its gradient; None for Newton's method, damped as
            Levenberg and Marquardt do where it fails.
        most_turns: turns allowed.
        residual: largest change of a recurring component over a turn that counts as none.
    """

    optimiser: optax.GradientTransformation | None = eqx.field(static=True)
    most_turns: int = eqx.field(static=True)
    residual: Any


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


class _Stage(enum.IntEnum):
    APPROACH = 0
    ROUGH = 1
    COARSE = 2
    FINE = 3
    FOUND = 4
    NO_RETURN = 5
    STUCK = 6


class _Progress(NamedTuple):
    stage: Scalar
    trial: Scalar
    base: Scalar
    base_residual: Scalar
    change: Scalar
    slope: Scalar
    base_turn: Turn
    damping: Scalar
    coarse: Turn | None
    optimiser: Any
    code: Scalar
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
        begin = _begin(first, off, method, nothing)._replace(coarse=nothing)
        end = _advanced(whole, begin, method, _Stage.FOUND)
    assert end.coarse is not None
    ending = jnp.where(
        end.stage == _Stage.FOUND,
        int(Search.FOUND),
        jnp.where(end.stage == _Stage.NO_RETURN, int(Search.NO_RETURN), int(Search.NOT_CONVERGED)),
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


def _by_lanes(bare: Run, whole: Run, first: Scalar, off: Scalar, method: Method) -> _Progress:
    """Turns are `bare` of directions but the state's until it is near."""
    now = _advanced(bare, _begin(first, off, method, _nothing(bare, first)), method, _Stage.COARSE)
    nothing = _nothing(whole, first)
    now = now._replace(base_turn=nothing, coarse=nothing)

    def near(now: _Progress) -> Scalar:
        return _goes_on(now, method, _Stage.COARSE, _Stage.FOUND)

    def goes_on(both: tuple[_Progress, Scalar]) -> Scalar:
        return near(both[0]) | both[1]

    def advance(both: tuple[_Progress, Scalar]) -> tuple[_Progress, Scalar]:
        now, untold = both
        on = near(now)
        latest = whole(jnp.where(on, now.trial, now.base), now.stage, ~(on | untold))
        told = now._replace(base_turn=_where(untold, latest, now.base_turn))
        return _where(on, _progressed(now, latest, method), told), jnp.asarray(False)

    # Whoever did not come near still has the best orbit told.
    untold = ~near(now) & (now.stage != _Stage.NO_RETURN)
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
        chosen = Precision(
            *(
                jnp.where(stage == _Stage.FINE, a, jnp.where(stage == _Stage.COARSE, b, c))
                for a, b, c in zip(precision, coarse, _ROUGH, strict=True)
            )
        )
        start = state_with(turning.system, guess, trial)
        return turn(turning, seeds, start, chosen, idle, save_nodes=save_nodes)

    return run


def _advanced(run: Run, begin: _Progress, method: Method, until: _Stage) -> _Progress:
    """Searches on until a stage is reached or the turns are used up."""

    def goes_on(now: _Progress) -> Scalar:
        return _goes_on(now, method, _Stage.APPROACH, until)

    def advance(now: _Progress) -> _Progress:
        on = goes_on(now)
        return _where(on, _progressed(now, run(now.trial, now.stage, ~on), method), now)

    return jax.lax.while_loop(goes_on, advance, begin)


def _goes_on(now: _Progress, method: Method, since: _Stage, until: _Stage) -> Scalar:
    return (now.stage >= since) & (now.stage < until) & (now.turns < method.most_turns)


def _where(condition: Scalar, new: Any, old: Any) -> Any:
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), new, old)


def _nothing(run: Run, first: Scalar) -> Turn:
    """A turn of zeros."""
    shape: Turn = jax.eval_shape(run, first, jnp.asarray(0), jnp.asarray(True))
    return jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shape)


def _begin(first: Scalar, off: Scalar, method: Method, nothing: Turn) -> _Progress:
    on_section = off < 1e-9
    stage = jnp.where(on_section, int(_Stage.ROUGH), int(_Stage.APPROACH))
    return _Progress(
        stage=stage,
        trial=first,
        base=first,
        base_residual=jnp.asarray(jnp.inf),
        change=jnp.zeros_like(first),
        slope=jnp.zeros((len(first), len(first))),
        base_turn=nothing,
        damping=jnp.asarray(0.0),
        coarse=None,
        optimiser=None if method.optimiser is None else method.optimiser.init(first),
        code=jnp.asarray(0),
        turns=jnp.asarray(0),
        history=jnp.full(method.most_turns, jnp.nan),
    )


def _progressed(now: _Progress, latest: Turn, method: Method) -> _Progress:
    """One turn further: judge the trial, and propose the next."""
    returned = latest.code == 0
    change = latest.recurring - now.trial
    residual = jnp.where(returned, jnp.max(jnp.abs(change)), jnp.inf)
    history = now.history.at[now.turns].set(residual)
    approaching = now.stage == _Stage.APPROACH
    better = (
        returned & ~approaching & ((residual < now.base_residual) | (method.optimiser is not None))
    )

    base = jnp.where(better, now.trial, now.base)
    base = jnp.where(approaching & returned, latest.recurring, base)
    m = len(base)
    base_residual, moved, slope, base_turn = _where(
        better,
        (residual, change, latest.jacobian[:, :m] - jnp.eye(m), latest),
        (now.base_residual, now.change, now.slope, now.base_turn),
    )
    damping = jnp.where(
        better,
        jnp.where(now.damping <= _FIRST_DAMPING, 0.0, 0.1 * now.damping),
        jnp.maximum(10.0 * now.damping, _FIRST_DAMPING),
    )
    rough_done = (now.stage == _Stage.ROUGH) & (base_residual <= _NEAR)
    coarse_done = (now.stage == _Stage.COARSE) & (base_residual <= _NEARER)
    refined = rough_done | coarse_done
    fine_done = (now.stage == _Stage.FINE) & (base_residual <= method.residual)
    nowhere = ~returned & ~jnp.isfinite(base_residual) & (now.stage < _Stage.COARSE)
    stage = jnp.where(approaching, int(_Stage.ROUGH), now.stage)
    stage = jnp.where(rough_done, int(_Stage.COARSE), stage)
    stage = jnp.where(coarse_done, int(_Stage.FINE), stage)
    stage = jnp.where(fine_done, int(_Stage.FOUND), stage)
    stage = jnp.where(nowhere, int(_Stage.NO_RETURN), stage)
    stage = jnp.where(damping > _LARGEST_DAMPING, int(_Stage.STUCK), stage)
    damping = jnp.where(approaching | refined, 0.0, damping)
    step, optimiser = _step(base, moved, slope, damping, now, method, better)
    trial = jnp.where(approaching, base, base + step)
    return _Progress(
        stage=stage,
        trial=trial,
        base=base,
        # The finer solves begin afresh: their residuals are not the looser ones'.
        base_residual=jnp.where(refined, jnp.inf, base_residual),
        change=moved,
        slope=slope,
        base_turn=base_turn,
        damping=damping,
        coarse=None if now.coarse is None else _where(coarse_done, base_turn, now.coarse),
        optimiser=optimiser,
        code=jnp.where(returned, now.code, latest.code),
        turns=now.turns + 1,
        history=history,
    )


def _step(
    base: Scalar,
    change: Scalar,
    slope: Scalar,
    damping: Scalar,
    now: _Progress,
    method: Method,
    better: Scalar,
) -> tuple[Scalar, Any]:
    """From `base`, whose turn comes `change` away from it; `slope` is that of the change."""
    if method.optimiser is not None:
        gradient = slope.T @ change
        step, optimiser = method.optimiser.update(gradient, now.optimiser, base)
        assert isinstance(step, jax.Array)
        # A trial that did not return: go half way back.
        return jnp.where(better, step, 0.5 * (now.trial - base)), optimiser
    normal = slope.T @ slope + damping * jnp.eye(len(base))
    damped = -solved(normal, slope.T @ change)
    newton = -solved(slope, change)
    return jnp.where(damping > 0.0, damped, newton), now.optimiser
