"""Newton's method with affine-invariant damping: a trial is judged, the next one proposed.

A step is measured by Newton's own correction ("natural level function"), not by the residual: the
fast directions of contact make the residual a poor guide. Deuflhard, Newton Methods for Nonlinear
Problems (2004), algorithm NLEQ-ERR.
"""

import enum
from typing import TYPE_CHECKING, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Numbers, RealScalarLike, Scalar, choose
from jaxbiped.gait._poincare_map import LinearisedReturn
from jaxbiped.linalg._small_matrices import solution

if TYPE_CHECKING:
    import optax

_NEAR, _NEARER = 1e-3, 1e-4
"""Residuals at which rough solves give way to coarse ones, and these to fine ones."""
_FLOOR = 10.0
"""Newton's correction, in units of the residual that counts as none, from which one that no longer
shrinks is the solve's own error: several footsteps of an unstable gait enlarge a residual's."""
_SINGULAR = 1e-4
"""Singular value of the slope, over its size, from which on a step along it counts for nothing."""
_LEFT_OVER = 1e-2
"""Share of a change that a step along all other directions may leave."""
_SMALLEST_DAMPING = 1e-3
"""Share of Newton's step below which no step is a step forward."""


class Method(eqx.Module):
    """How to search.

    Attributes:
        optimiser: of the squared residual, by its gradient; None for Newton's method, damped by
            its natural level function.
        max_evaluations: evaluations for whose history there is room.
        patience: evaluations allowed, at most as many; None for as many.
        residual: largest change of a recurring component over a cycle that counts as none.
        sizes: what each component's change is measured in, shape (m,); None for SI units.
    """

    optimiser: "optax.GradientTransformation | None" = eqx.field(static=True)
    max_evaluations: int = eqx.field(static=True)
    residual: RealScalarLike
    patience: RealScalarLike | None = None
    sizes: Numbers | None = None

    def measured(self, change: Scalar) -> Scalar:
        """A change of the components in what it is measured in."""
        return change if self.sizes is None else change / self.sizes

    def size(self, change: Scalar) -> Scalar:
        """The Euclidean norm of a change in what its components are measured in."""
        return _size(self.measured(change))

    @property
    def evaluations_allowed(self) -> RealScalarLike:
        return self.max_evaluations if self.patience is None else self.patience


class Stage(enum.IntEnum):
    """Where a search is: on the way to the section, how exactly it solves, or how it ended.

    As a witness of its error, what was found is solved once more, 10 times looser, from Newton's
    next correction: multipliers, too, are off by what they change from there.
    """

    APPROACH = 0
    ROUGH = 1
    COARSE = 2
    FINE = 3
    WITNESS = 4
    FOUND = 5
    NO_RETURN = 6
    STUCK = 7


class Progress(NamedTuple):
    """A search under way.

    Attributes:
        stage: code of a `Stage`.
        trial: the m recurring components to follow next.
        base: the last accepted; `base_residual` the largest change over its cycle `base_return`,
            `slope` the derivatives of its changes with respect to the components (m, m), `step`
            Newton's correction of it; `is_smallest` whether that is the smallest of those that
            leave nothing of the change.
        damping: share of the step that `trial` took.
        coarse: the witness, once there is one.
        optimiser: its state.
        code, evaluations, history: as in `Found`.
    """

    stage: Scalar
    trial: Scalar
    base: Scalar
    base_residual: Scalar
    slope: Scalar
    step: Scalar
    is_smallest: Scalar
    base_return: LinearisedReturn
    damping: Scalar
    coarse: LinearisedReturn
    optimiser: PyTree
    code: Scalar
    evaluations: Scalar
    history: Scalar


def initial_progress(
    first: Scalar, off: Scalar, method: Method, no_return: LinearisedReturn
) -> Progress:
    """Before the first return, from components that are `off` the section by so much.

    `no_return` is in the place of a return.
    """
    on_section = off < 1e-9
    stage = jnp.where(on_section, int(Stage.ROUGH), int(Stage.APPROACH))
    return Progress(
        stage=stage,
        trial=first,
        base=first,
        base_residual=jnp.asarray(jnp.inf),
        slope=jnp.eye(len(first)),
        step=jnp.zeros_like(first),
        is_smallest=jnp.asarray(False),
        base_return=no_return,
        damping=jnp.asarray(1.0),
        coarse=no_return,
        optimiser=None if method.optimiser is None else method.optimiser.init(first),
        code=jnp.asarray(0),
        evaluations=jnp.asarray(0),
        history=jnp.full(method.max_evaluations, jnp.nan),
    )


def newton_iteration(now: Progress, latest: LinearisedReturn, method: Method) -> Progress:
    """One evaluation further: judge the trial, and propose the next."""
    returned = latest.code == 0
    change = latest.recurring - now.trial
    residual = jnp.where(returned, jnp.max(jnp.abs(method.measured(change))), jnp.inf)
    approaching, witness = now.stage == Stage.APPROACH, now.stage == Stage.WITNESS
    place = jnp.where(witness, now.history.shape[0], now.evaluations)
    history = now.history.at[place].set(residual, mode="drop")
    if method.optimiser is not None:
        forward = jnp.asarray(True)
        simplified = jnp.zeros_like(change)
    else:
        simplified = -_correction_of_kind(now.is_smallest, now.slope, change)
        shrinks = method.size(simplified) < method.size(now.step)
        forward = jnp.isinf(now.base_residual) | shrinks
    better = returned & ~approaching & ~witness & forward

    base = jnp.where(better, now.trial, now.base)
    base = jnp.where(approaching & returned, latest.recurring, base)
    m = len(base)
    base_residual, slope, base_return = choose(
        better,
        (residual, latest.jacobian[:, :m] - jnp.eye(m), latest),
        (now.base_residual, now.slope, now.base_return),
    )
    rough_done = (now.stage == Stage.ROUGH) & (base_residual <= _NEAR)
    coarse_done = (now.stage == Stage.COARSE) & (base_residual <= _NEARER)
    refined = rough_done | coarse_done
    at_floor = returned & ~forward & (method.size(now.step) <= _FLOOR * method.residual)
    fine_done = (now.stage == Stage.FINE) & ((base_residual <= method.residual) | at_floor)
    nowhere = ~returned & ~jnp.isfinite(base_residual) & (now.stage < Stage.COARSE)
    if method.optimiser is not None:
        step, optimiser = _descent_step(now, base, change, slope, better, method.optimiser)
        damping, is_smallest = jnp.asarray(1.0), now.is_smallest
    else:
        correction, kind = _correction(slope, change)
        step = jnp.where(better, -correction, now.step)
        is_smallest = jnp.where(better, kind, now.is_smallest)
        last, next_, plain = map(method.measured, (now.step, step, simplified))
        damping = _damping_factor(now, last, next_, plain, returned, better)
        optimiser = now.optimiser
    damping = jnp.where(refined | approaching, 1.0, damping)
    stuck = (damping < _SMALLEST_DAMPING) | (better & ~jnp.all(jnp.isfinite(step)))
    stage = jnp.where(approaching, int(Stage.ROUGH), now.stage)
    stage = jnp.where(rough_done, int(Stage.COARSE), stage)
    stage = jnp.where(coarse_done, int(Stage.FINE), stage)
    stage = jnp.where(stuck, int(Stage.STUCK), stage)
    stage = jnp.where(fine_done, int(Stage.WITNESS), stage)
    stage = jnp.where(nowhere, int(Stage.NO_RETURN), stage)
    stage = jnp.where(witness, int(Stage.FOUND), stage)
    beyond = step if method.optimiser is None else jnp.zeros_like(step)
    ahead = jnp.where(fine_done, beyond, damping * step)
    return Progress(
        stage=stage,
        trial=jnp.where(approaching, base, base + ahead),
        base=base,
        # The finer solves begin afresh: their residuals are not the looser ones'.
        base_residual=jnp.where(refined, jnp.inf, base_residual),
        slope=slope,
        step=step,
        is_smallest=is_smallest,
        base_return=base_return,
        damping=damping,
        coarse=choose(witness & returned, latest, now.coarse),
        optimiser=optimiser,
        code=jnp.where(returned | witness, now.code, latest.code),
        evaluations=now.evaluations + jnp.where(witness, 0, 1),
        history=history,
    )


def _damping_factor(
    now: Progress, last: Scalar, step: Scalar, simplified: Scalar, returned: Scalar, better: Scalar
) -> Scalar:
    """Share of `step` to try next, from what the trial along the `last` one told of the map."""
    tiny = jnp.finfo(step.dtype).tiny
    # After a step forward: how much Newton's new correction differs from the simplified one.
    known = _size(last) * _size(simplified) * now.damping
    ahead = known / (_size(simplified - step) * _size(step) + tiny)
    first = jnp.isinf(now.base_residual)
    ahead = jnp.where(first, 1.0, jnp.minimum(1.0, ahead))
    # After none: how far the simplified correction is from what a linear map would give.
    expected = (1.0 - now.damping) * last
    back = 0.5 * _size(last) * now.damping**2 / (_size(simplified - expected) + tiny)
    back = jnp.where(
        returned, jnp.clip(back, 0.1 * now.damping, 0.5 * now.damping), 0.5 * now.damping
    )
    return jnp.where(better, ahead, back)


def _correction(slope: Scalar, change: Scalar) -> tuple[Scalar, Scalar]:
    """What Newton's step is the negative of, and whether it is the smallest one.

    It is where the orbits are a family, as those of a conservative system are by their energy:
    their slope is singular, and the other directions alone are corrected. Where that leaves a part
    of the change, as behind a fold, there is no orbit to come to, and the plain step tells so.
    """
    plain = solution(slope, change)
    is_far = ~(_size(plain) * jnp.max(jnp.abs(slope)) * _SINGULAR <= _size(change))

    def of_family() -> tuple[Scalar, Scalar]:
        smallest = _smallest_solution(slope, change)
        solves = _size(slope @ smallest - change) <= _LEFT_OVER * _size(change)
        return jnp.where(solves, smallest, plain), solves

    return jax.lax.cond(is_far, of_family, lambda: (plain, jnp.asarray(False)))


def _correction_of_kind(is_smallest: Scalar, slope: Scalar, change: Scalar) -> Scalar:
    """The correction of a change, smallest or plain; corrections of unlike kinds do not compare."""
    return jax.lax.cond(is_smallest, _smallest_solution, solution, slope, change)


def _smallest_solution(slope: Scalar, change: Scalar) -> Scalar:
    """The smallest solution of a linear system, which leaves out its singular directions."""
    damping = (_SINGULAR * jnp.max(jnp.abs(slope))) ** 2 * jnp.eye(len(change))
    return slope.T @ solution(slope @ slope.T + damping, change)


def _size(step: Scalar) -> Scalar:
    return jnp.sqrt(jnp.sum(step * step))


def _descent_step(
    now: Progress,
    base: Scalar,
    change: Scalar,
    slope: Scalar,
    better: Scalar,
    optimiser: "optax.GradientTransformation",
) -> tuple[Scalar, PyTree]:
    """A step down the gradient of the squared residual."""
    gradient = slope.T @ jnp.where(better, change, 0.0)
    step, state = optimiser.update(gradient, now.optimiser, base)
    assert isinstance(step, jax.Array)
    # A trial that did not return: go half way back.
    return jnp.where(better, step, 0.5 * (now.trial - base)), state
