"""One step of the search for an orbit: a turn is judged, and the next trial proposed."""

import enum
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optax

from jaxbiped._types import Scalar
from jaxbiped.gait._small_matrices import solved
from jaxbiped.gait._turn import Turn

_NEAR, _NEARER = 1e-3, 1e-4
"""Residuals at which rough solves give way to coarse ones, and these to fine ones."""
_FIRST_DAMPING, _LARGEST_DAMPING = 1e-3, 1e8


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


class Stage(enum.IntEnum):
    """Where a search is: on the way to the section, how exactly it solves, or how it ended."""

    APPROACH = 0
    ROUGH = 1
    COARSE = 2
    FINE = 3
    FOUND = 4
    NO_RETURN = 5
    STUCK = 6


class Progress(NamedTuple):
    """A search under way.

    Attributes:
        stage: code of a `Stage`.
        trial: the m recurring components to turn from next.
        base: the best so far; `base_residual` the largest change over its turn `base_turn`,
            `change` its changes and `slope` their derivatives by the components (m, m).
        damping: Levenberg and Marquardt's.
        coarse: the last looser turn.
        optimiser: its state.
        code, turns, history: as in `Found`.
    """

    stage: Scalar
    trial: Scalar
    base: Scalar
    base_residual: Scalar
    change: Scalar
    slope: Scalar
    base_turn: Turn
    damping: Scalar
    coarse: Turn
    optimiser: Any
    code: Scalar
    turns: Scalar
    history: Scalar


def begun(first: Scalar, off: Scalar, method: Method, nothing: Turn) -> Progress:
    """Before the first turn, from components that are `off` the section by so much.

    `nothing` is in the place of a turn.
    """
    on_section = off < 1e-9
    stage = jnp.where(on_section, int(Stage.ROUGH), int(Stage.APPROACH))
    return Progress(
        stage=stage,
        trial=first,
        base=first,
        base_residual=jnp.asarray(jnp.inf),
        change=jnp.zeros_like(first),
        slope=jnp.zeros((len(first), len(first))),
        base_turn=nothing,
        damping=jnp.asarray(0.0),
        coarse=nothing,
        optimiser=None if method.optimiser is None else method.optimiser.init(first),
        code=jnp.asarray(0),
        turns=jnp.asarray(0),
        history=jnp.full(method.most_turns, jnp.nan),
    )


def progressed(now: Progress, latest: Turn, method: Method) -> Progress:
    """One turn further: judge the trial, and propose the next."""
    returned = latest.code == 0
    change = latest.recurring - now.trial
    residual = jnp.where(returned, jnp.max(jnp.abs(change)), jnp.inf)
    history = now.history.at[now.turns].set(residual)
    approaching = now.stage == Stage.APPROACH
    better = (
        returned & ~approaching & ((residual < now.base_residual) | (method.optimiser is not None))
    )

    base = jnp.where(better, now.trial, now.base)
    base = jnp.where(approaching & returned, latest.recurring, base)
    m = len(base)
    base_residual, moved, slope, base_turn = chosen(
        better,
        (residual, change, latest.jacobian[:, :m] - jnp.eye(m), latest),
        (now.base_residual, now.change, now.slope, now.base_turn),
    )
    damping = jnp.where(
        better,
        jnp.where(now.damping <= _FIRST_DAMPING, 0.0, 0.1 * now.damping),
        jnp.maximum(10.0 * now.damping, _FIRST_DAMPING),
    )
    rough_done = (now.stage == Stage.ROUGH) & (base_residual <= _NEAR)
    coarse_done = (now.stage == Stage.COARSE) & (base_residual <= _NEARER)
    refined = rough_done | coarse_done
    fine_done = (now.stage == Stage.FINE) & (base_residual <= method.residual)
    nowhere = ~returned & ~jnp.isfinite(base_residual) & (now.stage < Stage.COARSE)
    stage = jnp.where(approaching, int(Stage.ROUGH), now.stage)
    stage = jnp.where(rough_done, int(Stage.COARSE), stage)
    stage = jnp.where(coarse_done, int(Stage.FINE), stage)
    stage = jnp.where(fine_done, int(Stage.FOUND), stage)
    stage = jnp.where(nowhere, int(Stage.NO_RETURN), stage)
    stage = jnp.where(damping > _LARGEST_DAMPING, int(Stage.STUCK), stage)
    damping = jnp.where(approaching | refined, 0.0, damping)
    step, optimiser = _step(base, moved, slope, damping, now, method, better)
    trial = jnp.where(approaching, base, base + step)
    return Progress(
        stage=stage,
        trial=trial,
        base=base,
        # The finer solves begin afresh: their residuals are not the looser ones'.
        base_residual=jnp.where(refined, jnp.inf, base_residual),
        change=moved,
        slope=slope,
        base_turn=base_turn,
        damping=damping,
        coarse=chosen(coarse_done, base_turn, now.coarse),
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
    now: Progress,
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


def chosen(condition: Scalar, new: Any, old: Any) -> Any:
    """One of two trees of the same structure."""
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), new, old)
