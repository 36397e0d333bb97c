"""Cycle of footsteps with its derivatives: the one evaluation that all continuation reads.

It is chained of single returns, so that one compiled program serves every point of a branch, every
step of a corrector and every number of arrivals.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Numbers, Scalar
from jaxbiped.compiler import host_jit
from jaxbiped.gait._fixed_point_search import FixedPointProblem, search_by_lanes, with_looser
from jaxbiped.gait._poincare_map import linearised_return

NO_WALK = -1
"""Code of an orbit that returns but is no walk: a foot underground, steps uphill or hardly any."""


class Cycle(NamedTuple):
    """A cycle of arrivals; beside it a looser one, the witness of its error, on a first axis of 2.

    With m recurring components and p parameters:

    Attributes:
        recurring: the components that came back, shape (m,).
        jacobian: their derivatives on the section with respect to components and parameters,
            shape (m, m + p), SI units.
        monodromy: with respect to the components at a fixed time, shape (m, m).
        velocity: their rates where the cycle ends, shape (m,).
        period: duration [s].
        advance: along the slope [m], or of a system's first cyclic coordinate; NaN if it has none.
        peak: largest force on a foot [N].
        code: 0 or that of the `Ending` that came instead.
        grazes: how often a switch was touched or missed by less than the tolerance resolves.
        sound: whether every footstep goes downhill and on the ground, and their mean is a step
            (see `AbstractSystem.is_walk`).
    """

    recurring: Numbers
    jacobian: Numbers
    monodromy: Numbers
    velocity: Numbers
    period: Numbers
    advance: Numbers
    peak: Numbers
    code: Numbers
    grazes: Numbers
    sound: Numbers

    @property
    def failure(self) -> int:
        """0, the code of the `Ending` that came instead, or `NO_WALK`."""
        return int(self.code[0]) or (0 if bool(self.sound[0]) else NO_WALK)


def follow_cycle(
    problem: FixedPointProblem, point: np.ndarray, values: list[float], arrivals: int
) -> Cycle:
    """The cycle from a point of m components, the problem's active parameters so changed."""
    numbers: PyTree = np.asarray(point), np.asarray(values, float), np.asarray(arrivals)
    both = problem._replace(precision=with_looser(problem.precision))
    return jax.device_get(_evaluate(both, *numbers))


@host_jit(search_by_lanes, within=True)
def _evaluate(problem: FixedPointProblem, point: Scalar, values: Scalar, arrivals: Scalar) -> Cycle:
    """The cycle, and in a lane of its own the looser one."""
    leaves, structure = jtu.tree_flatten(problem.args)
    for k, place in enumerate(problem.active):
        leaves[place] = values[k]
    there = problem._replace(args=jtu.tree_unflatten(structure, leaves))
    return jax.vmap(lambda precision: _chain(there._replace(precision=precision), point, arrivals))(
        problem.precision
    )


def _chain(problem: FixedPointProblem, point: Scalar, arrivals: Scalar) -> Cycle:
    spec, scene, precision = problem.spec, problem.args, problem.precision
    m, p = point.shape[0], len(problem.active)
    seeds, sizes = problem.directions(m)
    units = jnp.concatenate([jnp.ones(m), sizes])

    def add(_: int, before: Cycle) -> Cycle:
        y = problem.state(jnp.asarray(before.recurring))
        once = linearised_return(spec, seeds, y, precision, before.code != 0)
        own = once.jacobian / units
        advance = once.advance[0] if len(once.advance) else jnp.asarray(jnp.nan)
        by_parameters = jnp.concatenate([jnp.zeros((m, m)), own[:, m:]], axis=1)
        return Cycle(
            recurring=once.recurring,
            jacobian=own[:, :m] @ before.jacobian + by_parameters,
            monodromy=once.monodromy[:, :m] @ before.monodromy,
            velocity=once.velocity,
            period=before.period + once.period,
            advance=before.advance + advance,
            peak=jnp.maximum(before.peak, once.peak),
            code=jnp.where(before.code != 0, before.code, once.code),
            grazes=before.grazes + once.grazes,
            sound=before.sound & spec.system.is_walk(scene, y, advance, once.period, 0),
        )

    zero = jnp.zeros(())
    begin = Cycle(
        recurring=point,
        jacobian=jnp.eye(m, m + p),
        monodromy=jnp.eye(m),
        velocity=jnp.zeros(m),
        period=zero,
        advance=zero,
        peak=zero,
        code=jnp.asarray(0),
        grazes=jnp.asarray(0),
        sound=jnp.asarray(True),
    )
    end: Cycle = jax.lax.fori_loop(0, arrivals, add, begin)
    return end._replace(sound=end.sound & spec.system.takes_steps(scene, end.advance, arrivals))
