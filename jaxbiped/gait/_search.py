"""The search for a periodic orbit: a fixed point of the return map."""

import enum
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
    base_turn: Turn
    damping: Scalar
    coarse: Turn
    optimiser: Any
    code: Scalar
    turns: Scalar
    history: Scalar


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
    seeds, _ = seeded(args, active, len(first))
    coarse = Precision(LOOSER * precision.rtol, LOOSER * precision.tangent_rtol)

    def run(trial: Scalar, stage: Scalar) -> Turn:
        chosen = Precision(
            *(
                jnp.where(stage == _Stage.FINE, a, jnp.where(stage == _Stage.COARSE, b, c))
                for a, b, c in zip(precision, coarse, _ROUGH, strict=True)
            )
        )
        start = state_with(turning.system, guess, trial)
        return turn(turning, seeds, start, chosen, idle=stage >= _Stage.FOUND)

    def advance(now: _Progress) -> _Progress:
        latest = run(now.trial, now.stage)
        active_lane = now.stage < _Stage.FOUND
        after = _progressed(now, latest, method)
        return jax.tree.map(lambda a, b: jnp.where(active_lane, a, b), after, now)

    def goes_on(now: _Progress) -> Scalar:
        return (now.stage < _Stage.FOUND) & (now.turns < method.most_turns)

    off = jnp.abs(turning.section.value(args, guess))
    begin = _begin(first, off, method, jax.eval_shape(run, first, jnp.asarray(0)))
    end = jax.lax.while_loop(goes_on, advance, begin)
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


def _begin(first: Scalar, off: Scalar, method: Method, shape: Any) -> _Progress:
    nothing = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shape)
    on_section = off < 1e-9
    stage = jnp.where(on_section, int(_Stage.ROUGH), int(_Stage.APPROACH))
    return _Progress(
        stage=stage,
        trial=first,
        base=first,
        base_residual=jnp.asarray(jnp.inf),
        base_turn=nothing,
        damping=jnp.asarray(0.0),
        coarse=nothing,
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

    def chosen(new: Any, old: Any) -> Any:
        return jax.tree.map(lambda a, b: jnp.where(better, a, b), new, old)

    base = jnp.where(approaching & returned, latest.recurring, chosen(now.trial, now.base))
    base_residual = chosen(residual, now.base_residual)
    base_turn = chosen(latest, now.base_turn)
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
    step, optimiser = _step(base, base_turn, damping, now, method, better)
    trial = jnp.where(approaching, base, base + step)
    return _Progress(
        stage=stage,
        trial=trial,
        base=base,
        # The finer solves begin afresh: their residuals are not the looser ones'.
        base_residual=jnp.where(refined, jnp.inf, base_residual),
        base_turn=base_turn,
        damping=damping,
        coarse=jax.tree.map(lambda a, b: jnp.where(coarse_done, a, b), base_turn, now.coarse),
        optimiser=optimiser,
        code=jnp.where(returned, now.code, latest.code),
        turns=now.turns + 1,
        history=history,
    )


def _step(
    base: Scalar, base_turn: Turn, damping: Scalar, now: _Progress, method: Method, better: Scalar
) -> tuple[Scalar, Any]:
    m = base.shape[0]
    change = base_turn.recurring - base
    slope = base_turn.jacobian[:, :m] - jnp.eye(m)
    if method.optimiser is not None:
        gradient = slope.T @ change
        step, optimiser = method.optimiser.update(gradient, now.optimiser, base)
        assert isinstance(step, jax.Array)
        # A trial that did not return: go half way back.
        return jnp.where(better, step, 0.5 * (now.trial - base)), optimiser
    normal = slope.T @ slope + damping * jnp.eye(m)
    damped = -solved(normal, slope.T @ change)
    newton = -solved(slope, change)
    return jnp.where(damping > 0.0, damped, newton), now.optimiser
