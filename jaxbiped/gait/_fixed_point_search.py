"""Fixed-point search of the return map, and the footsteps after which what it came to closes.

The return map of n footsteps also has the gaits of every divisor of n as fixed points.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxbiped._ending import NamedCode
from jaxbiped._types import RealScalarLike, Scalar, by_numpy, is_traced
from jaxbiped.gait._newton import Method, Progress, Stage, initial_progress, newton_iteration
from jaxbiped.gait._poincare_map import (
    LinearisedReturn,
    linearised_return,
    recurring_components,
    seed_directions,
    state_with,
)
from jaxbiped.gait._return_map_spec import ReturnMapSpec, runs_by_lanes
from jaxbiped.solve._accuracy import Precision
from jaxbiped.solve._error_estimate import LOOSER
from jaxbiped.variational._tangents import Seeded

ROUGH = Precision(3e-6, 3e-4)
"""How exactly the search is solved until it is near."""
_ERRORS, _TOLERANCES = 4.0, 30.0
"""Distance of two crossings that are one: in units of the fixed point's error, and of rtol."""
Run = Callable[[Scalar, Scalar, Scalar], LinearisedReturn]
"""The return from recurring components, as exactly as a stage wants, or none where idle."""


class Search(NamedCode):
    """How a search ended. `str(search)` is its name in words.

    - found: the orbit returns to within the residual asked for.
    - no return: the first return already ended in a failure (its `Ending` tells which).
    - not converged: no step reduced the residual any more, or the evaluations allowed were used up.
    - no walk: an orbit returns, but with a foot deep underground, a step uphill or below 1 % of the
      walker's height, or hardly any time between crossings of the section; no other was found.
    """

    FOUND = 0
    NO_RETURN = 1
    NOT_CONVERGED = 2
    NO_WALK = 3


class Found(NamedTuple):
    """A fixed point, or the best that was found instead.

    Attributes:
        ending: code of a `Search`.
        code: that of the `Ending` of the last return that did not return, 0 for none.
        recurring: the m recurring components.
        residual: largest of their changes over a cycle; infinite where nothing returned.
        both: the return from there, and behind it a looser one, the witness of its error.
        evaluations: how often the return map was evaluated.
        history: residual of each evaluation, shape (max_evaluations,), NaN beyond the last.
        sound: whether the orbit is a walk (see `AbstractSystem.is_walk`).
        columns: both returns solved once more, with derivatives with respect to parameters; None
            where they were not (see `with_parameter_columns`).
    """

    ending: Scalar
    code: Scalar
    recurring: Scalar
    residual: Scalar
    both: LinearisedReturn
    evaluations: Scalar
    history: Scalar
    sound: Scalar
    columns: LinearisedReturn | None = None

    @property
    def last(self) -> LinearisedReturn:
        """The return from the fixed point."""
        return _row(self.both, 0)

    @property
    def coarse(self) -> LinearisedReturn:
        """The looser one."""
        return _row(self.both, 1)

    @property
    def fine(self) -> LinearisedReturn:
        """The return with derivatives with respect to parameters, if any."""
        return _row(self.both if self.columns is None else self.columns, 0)

    @property
    def loose(self) -> LinearisedReturn:
        """The looser one with these."""
        return _row(self.both if self.columns is None else self.columns, 1)


def _row(pair: LinearisedReturn, place: int) -> LinearisedReturn:
    if not is_traced(pair):
        # By NumPy: JAX would compile a program for every shape.
        pair = jax.tree.map(np.asarray, pair)
    return jax.tree.map(lambda leaf: leaf[place], pair)


class FixedPointProblem(NamedTuple):
    """Which fixed point is sought, and how exactly.

    Attributes:
        spec: of the return map.
        args: the scene, or the parameters of another system.
        active: positions among its leaves of the parameters that derivatives are with respect to.
        guess: where the search begins, on the section or not; any state where none is sought.
        precision: of the solves in the end.
        method: how to search; None once the fixed point is known.
    """

    spec: ReturnMapSpec
    args: PyTree
    active: tuple[int, ...]
    guess: PyTree
    precision: Precision
    method: Method | None = None

    def state(self, recurring: Scalar) -> PyTree:
        return state_with(self.spec.system, self.guess, recurring)

    @property
    def loaded(self) -> bool:
        """Whether the system has a load, whose largest value is known."""
        return self.spec.system.load_exists(self.args, self.guess)

    def directions(self, m: int) -> tuple[Seeded, Scalar]:
        """Seeds of the m components and the active parameters, and the sizes of these."""
        return seed_directions(self.args, self.active, m)


def search_by_lanes(problem: FixedPointProblem, *_: object, **__: object) -> bool:
    """Whether a function of a problem leaves the work to programs of lanes."""
    return runs_by_lanes(problem.spec)


def search(problem: FixedPointProblem, wanted: Scalar | bool = True) -> Found:
    """Searches from the guess: roughly, then 10 times looser, then finely, and once more looser.

    Not at all where not `wanted`. Derivatives with respect to the active parameters are not carried
    (see `with_parameter_columns`), for which gait is found does not depend on what is asked of it:
    they only choose the program.
    """
    spec, args, guess, method = problem.spec, problem.args, problem.guess, problem.method
    assert method is not None
    first = recurring_components(spec.system, guess)
    off = jnp.abs(spec.section.value(args, guess))
    run = _runner(problem, len(first))
    shape: LinearisedReturn = jax.eval_shape(run, first, jnp.asarray(0), jnp.asarray(True))
    empty_return = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shape)
    begin = initial_progress(first, off, method, empty_return)
    stage = jnp.where(wanted, begin.stage, int(Stage.STUCK))
    end = _iterate(run, begin._replace(stage=stage), method)
    ending = jnp.where(
        end.stage == Stage.FOUND,
        int(Search.FOUND),
        jnp.where(end.stage == Stage.NO_RETURN, int(Search.NO_RETURN), int(Search.NOT_CONVERGED)),
    )
    last = end.base_return
    # Not every system has a cyclic coordinate.
    sound = spec.system.is_walk(
        args, problem.state(end.base), jnp.sum(last.advance), last.period, spec.steps
    )
    return Found(
        ending=ending,
        code=end.code,
        recurring=end.base,
        residual=end.base_residual,
        both=jax.tree.map(lambda *pair: jnp.stack(pair), end.base_return, end.coarse),
        evaluations=end.evaluations,
        history=end.history,
        sound=sound,
    )


def walks_only(found: Found) -> Found:
    """The same, told as no walk where the orbit is none."""

    def told(numpy: Any, ending: Any, sound: Any) -> Any:
        no_walk = (ending == int(Search.FOUND)) & ~sound
        return numpy.where(no_walk, int(Search.NO_WALK), ending)

    return found._replace(ending=by_numpy(told, found.ending, found.sound))


def _runner(problem: FixedPointProblem, m: int) -> Run:
    """Returns, with derivatives with respect to the state's m recurring components."""
    seeds, _ = problem.directions(m)
    coarse = looser(problem.precision)

    def run(trial: Scalar, stage: Scalar, idle: Scalar) -> LinearisedReturn:
        wanted = Precision(
            *(
                jnp.where(stage == Stage.FINE, a, jnp.where(stage >= Stage.COARSE, b, c))
                for a, b, c in zip(problem.precision, coarse, ROUGH, strict=True)
            )
        )
        start, no = problem.state(trial), jnp.asarray(False)
        return linearised_return(problem.spec, seeds, start, wanted, idle, carries_parameters=no)

    return run


def looser(precision: Precision) -> Precision:
    """The precision before a search's end, and of the witness of a return's error."""
    return Precision(LOOSER * precision.rtol, LOOSER * precision.tangent_rtol)


def with_looser(precision: Precision) -> Precision:
    """A precision and that of the witness beside it, tolerances of shape (2,)."""

    def both(numpy: Any, fine: Any, loose: Any) -> Any:
        return numpy.stack([numpy.asarray(fine), numpy.asarray(loose)])

    return Precision(*map(functools.partial(by_numpy, both), precision, looser(precision)))


def _iterate(run: Run, begin: Progress, method: Method) -> Progress:
    """Searches on until it has ended or the evaluations are used up."""

    def goes_on(now: Progress) -> Scalar:
        allowed = (now.stage == Stage.WITNESS) | (now.evaluations < method.evaluations_allowed)
        return (now.stage < Stage.FOUND) & allowed

    def advance(now: Progress) -> Progress:
        on = goes_on(now)
        latest = run(now.trial, now.stage, ~on)
        return newton_iteration(now, latest, method)

    return jax.lax.while_loop(goes_on, advance, begin)


def minimal_cycle(
    last: LinearisedReturn, error: Scalar, rtol: RealScalarLike, cyclic: tuple[int, ...] = (0,)
) -> Scalar:
    """The least divisor k of n such that the crossing after k footsteps is the first one.

    `last` are the n returns of the cycle, with their nodes; `error` are the estimated errors of the
    components that it begins at, shape (m,).
    """
    crossings = crossings_of(last, cyclic)
    n = crossings.shape[0]
    if n == 1:
        return jnp.asarray(1)

    def least(numpy: Any, crossings: Any, error: Any, rtol: Any) -> Any:
        allowed = _ERRORS * numpy.max(numpy.abs(error)) + _TOLERANCES * rtol
        found = numpy.asarray(n)
        for k in range(n - 1, 0, -1):
            if n % k == 0:
                off = numpy.max(numpy.abs(crossings[k] - crossings[0]))
                found = numpy.where(off <= allowed, k, found)
        return found

    return by_numpy(least, crossings, error, rtol)


def crossings_of(last: LinearisedReturn, cyclic: tuple[int, ...] = (0,)) -> Scalar:
    """The m recurring components at the beginning of each of the n returns, shape (n, m).

    `cyclic` are the positions of the others among a state's leaves: a walker's is the first.
    """
    assert last.nodes is not None
    leaves = last.recurring.shape[0] + len(cyclic)
    # A row is the time and then all leaves.
    rows = last.nodes.start.reshape(-1, 1 + leaves)
    return rows[:, [1 + k for k in range(leaves) if k not in cyclic]]
