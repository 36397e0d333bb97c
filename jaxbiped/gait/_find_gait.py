"""Search for periodic gaits of a scene, from one start or from many."""

import dataclasses
import functools
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice, check_count, check_unbatched
from jaxbiped._jax_versions import without_switches
from jaxbiped._progress import stage
from jaxbiped._types import Scalar, as_float, is_traced
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.caching._caches import Once, bounded_cache
from jaxbiped.caching._known_by_shape import known_by_shape
from jaxbiped.compiler import deferred_checks, host_jit
from jaxbiped.dynamics._equivalent_states import BodiesState
from jaxbiped.dynamics._state import recurring_leaves
from jaxbiped.gait._accurate_gait import accurate_gait
from jaxbiped.gait._fixed_point_search import (
    FixedPointProblem,
    Found,
    Search,
    search,
    search_by_lanes,
    walks_only,
)
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._gait_summary import summarise_gait
from jaxbiped.gait._guess_free_search import is_stable, search_on
from jaxbiped.gait._homotopy import search_along
from jaxbiped.gait._newton import Method
from jaxbiped.gait._return_map_spec import arrivals_of, return_map_spec, runs_by_lanes
from jaxbiped.gait._search_provenance import FoundBy, single_stage_origin, warn_of_unknown
from jaxbiped.gait._search_starts import start_of_search
from jaxbiped.hybrid._hybrid_system import SCENES
from jaxbiped.hybrid._scales import recurring_sizes
from jaxbiped.hybrid._sections import AbstractSection, section_of
from jaxbiped.scene._parameter_access import select_parameters
from jaxbiped.scene._scene import WALKER_SCENES, AbstractScene, WalkerScene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.scene._state_types import RigidState, State, WalkerState
from jaxbiped.solve._accuracy import ACCURACIES, Precision, check_accuracy_name, precision_of
from jaxbiped.solve._error_estimate import check_wanted

if TYPE_CHECKING:
    import optax

_RESIDUAL_SHARE = 0.3
"""Residual that counts as none, in units of the state's tolerance."""
_SAME = 1e-4
"""Largest difference of a component (SI units) between two finds of one gait."""


@without_switches
def find_gait(
    scene: AbstractScene,
    guess: Gait | WalkerState | BodiesState | PyTree | None = None,
    *,
    footsteps: int | None = None,
    section: AbstractSection | None = None,
    parameters: tuple[str, ...] | None = None,
    accuracy: str | float | Precision = "balanced",
    method: Literal["newton", "optax"] = "newton",
    optimiser: "optax.GradientTransformation | None" = None,
    max_evaluations: int | None = None,
    radius_sensitivities: bool = True,
    solver: str | diffrax.AbstractSolver[PyTree] | None = None,
    engine: str = "auto",
    progress: bool | None = None,
) -> Gait:
    """Finds a periodic gait, its Floquet multipliers and its sensitivities to the parameters.

    The search is Newton's method on the return map, with Levenberg–Marquardt damping after a failed
    step. Derivatives are carried along the motion with a tolerance of their own, and no step
    crosses a switch. Works under `jit` and `vmap`, over scenes and over guesses.

    Args:
        scene: the walker, compliant or rigid. For a redundant scene, every solve starts on the
            constraints, and returns, multipliers and sensitivities are given in minimal
            coordinates, without the directions of the constraints. Second derivatives (those of the
            spectral radius) use the minimal equations along the redundant motion. On the
            constraints, these agree with the method's own equations, except that a penalty leaves a
            relative difference of 1/(A s) (see `Penalty`).
        guess: a gait, or a start near one, on the section or not, from which Newton's method
            begins. If omitted, the search goes through stages until one finds a stable gait:
            Newton's method from the seed's start, fitted to the scene's legs; forward walks from
            many starts (lanes engine only); continuation from the seed's scene, or from the same
            walker relaxed (straight, passive, hardly any mass outside its legs); Newton's method
            from scattered starts. Where there is nothing to relax, continuation begins at legs of
            the seed's or McGeer's kneed walker and comes before the walks. The result is the
            stable gait, or the one of smallest spectral radius. Under `jit` and `vmap`, only the
            first stage and continuation from the seed's scene are tried.
        footsteps: number of footsteps of a cycle. Default: the smallest possible number, one for a
            mirrored walker and those of a stride for unequal legs. If a gait without a guess closes
            after fewer footsteps than requested, the search goes on for a longer cycle;
            `cycle_footsteps` has the actual number.
        section: section on which the cycle begins. Default: `MidStance()`; for a rigid walker
            `HeelStrike()`, where cycles begin just after the impact.
        parameters: names of the parameters to differentiate with respect to (see
            `parameter_names`). Default: all; () for none.
        accuracy: "draft", "balanced" or "tight"; a `Precision`; or a number, the relative error
            requested of measures, multipliers and sensitivities. Tolerances are then tightened
            until the error bars in the gait's `error` meet the number; if they do not, a
            `RuntimeWarning` gives the reason.
        method: "newton", or "optax" to minimise the squared residual by gradient descent.
        optimiser: optimiser for "optax". Default: Adam with a rate of 1e-2.
        max_evaluations: maximum number of evaluated cycles; if given, only the first stage is
            tried. Default: 40 for each search by "newton", 400 by "optax".
        radius_sensitivities: whether to differentiate the spectral radius, which requires second
            derivatives of the motion.
        solver: a name (see `SOLVERS`) or any diffrax solver without memory. Default: "rodas4"; for
            a rigid walker "rodas5p".
        engine: "xla", "lanes" or "auto" (see `ENGINES`).
        progress: whether to show on stderr what is being done, how far it is and what was found; by
            default (None) after two seconds, in a terminal, a notebook or a command.

    Returns:
        The gait, or if none was found, the best approximation; its `outcome` distinguishes the two.
        `found_by`, `others` and `explain_search` report how it was found. A `RuntimeWarning` is
        issued if the gait grazes a switch, so that derivatives are undefined.

    Raises:
        ArgumentError: an argument is not allowed; raised before anything is compiled.

    Examples:
        >>> import jaxbiped as jb
        >>> gait = jb.find_gait(jb.ladder()["rigid"], parameters=(), radius_sensitivities=False)
        >>> str(gait.outcome), round(float(gait.measures.period), 4)
        ('found', 0.4438)
    """
    scene = check_scene(scene, *SCENES)
    if not isinstance(accuracy, str | Precision):
        check_wanted(accuracy, optimiser=optimiser)
        find = functools.partial(
            find_gait,
            scene,
            footsteps=footsteps,
            section=section,
            parameters=parameters,
            method=method,
            max_evaluations=max_evaluations,
            radius_sensitivities=radius_sensitivities,
            engine=engine,
        )
        with stage(f"finding the gait to an error of {accuracy:g}", show=progress):
            return accurate_gait(
                find,
                scene,
                float(accuracy),
                guess=guess,
                solver=solver,
                radius=radius_sensitivities,
            )
    if isinstance(accuracy, str):
        check_accuracy_name(accuracy)
    check_choice("method", method, ("newton", "optax"))
    if optimiser is not None and (method == "newton" or not hasattr(optimiser, "update")):
        raise ArgumentError(
            f"optimiser = {optimiser!r} is not allowed with method = {method!r}: give an "
            'optimiser of optax with method = "optax".'
        )
    arrivals = arrivals_of(scene, footsteps)
    check_unbatched("scene", scene)
    section = section_of(scene, section)
    start = start_of_search(scene, section, guess)
    check_unbatched("guess", start, "one state")
    most = (40 if method == "newton" else 400) if max_evaluations is None else max_evaluations
    check_count("max_evaluations", most)
    modelled = scene.minimal  # a redundant scene's leaves begin with those of what it models
    names, active = select_parameters(modelled, parameters)
    radius = radius_sensitivities and bool(names)
    precision = precision_of(accuracy, scene) if isinstance(accuracy, str) else accuracy
    named = accuracy if isinstance(accuracy, str) else "tight"
    spec = return_map_spec(
        scene,
        start,
        section=section,
        solver=solver,
        engine=engine,
        steps=arrivals,
        max_solver_steps=ACCURACIES[named].max_solver_steps,
    )
    how = Method(
        optimiser=None if method == "newton" else (_adam() if optimiser is None else optimiser),
        max_evaluations=int(most),
        residual=_RESIDUAL_SHARE * precision.rtol,
        patience=np.asarray(int(most)),
        sizes=recurring_sizes(scene, start) if hasattr(type(start), "scales") else None,
    )
    # One program of lanes serves every search, whatever it is asked for, and what follows it.
    every = active if parameters is None else select_parameters(modelled, None)[1]
    columns = every if runs_by_lanes(spec) else ()
    problem = FixedPointProblem(spec, scene, columns, start, precision, how)
    asked = problem._replace(active=active, method=None)
    origin = single_stage_origin(problem, FoundBy.START if guess is None else FoundBy.GUESS)
    staged = guess is None and max_evaluations is None and method == "newton"
    if is_traced(problem):
        if staged:
            found, origin = search_along(problem, origin)
        else:
            found = walks_only(search(problem))
        return summarise_gait(asked, found, names, radius, origin)
    with stage("searching for a gait", unit="searches", show=progress) as now:
        once = _compilation_of(problem, names, radius)
        once(lambda: _compile(problem, asked, names, radius, origin))
        found, told = _search(problem), origin
        now.update()
        found = found if staged else walks_only(found)
        if staged and not is_stable(found, problem):
            found, told = search_on(_search_within, problem, found, engine, now)
        now.update(0, "measuring it")
        gait = summarise_gait(asked, found, names, radius, origin)
    if told is not origin:  # its scene may be of another structure, as of motors with a share
        gait = dataclasses.replace(gait, origin=jtu.tree_map(np.asarray, told))
    warn_of_unknown(gait)
    return gait


@bounded_cache(1)  # the same object each time, so that nothing is compiled again
def _adam() -> "optax.GradientTransformation":
    import optax

    return optax.adam(1e-2)


@host_jit(search_by_lanes, within=True)
def _search(problem: FixedPointProblem) -> Found:
    # Without weak types, which would make the next program another one than was compiled.
    return jtu.tree_map(
        lambda leaf: jax.lax.convert_element_type(leaf, leaf.dtype), search(problem)
    )


def _search_within(problem: FixedPointProblem, patience: int) -> Found:
    """A search in at most so many evaluations."""
    method = problem.method
    assert method is not None
    most = np.asarray(min(patience, method.max_evaluations))
    return _search(problem._replace(method=dataclasses.replace(method, patience=most)))


@known_by_shape
def _compilation_of(problem: FixedPointProblem, names: tuple[str, ...], radius: bool) -> Once[None]:
    return Once()


def _compile(problem: FixedPointProblem, asked: FixedPointProblem, *more: Any) -> None:
    """Compiles a search and what summarises it, and what lanes run for both, at the same time."""
    told = stage("compiling the search (first time for this kind of scene)")
    with told, ThreadPoolExecutor() as meanwhile:
        with deferred_checks() as programs:
            # What takes lanes longest begins first.
            begun = _search.begin(problem)
            ready = [meanwhile.submit(begun.finish)]
            no_result = _empty_arrays(begun.result)
            ready.append(meanwhile.submit(summarise_gait.begin(asked, no_result, *more).finish))
        try:
            for program in programs:
                program.check()
        except BaseException:
            _search.clear()  # it would be found compiled, and fail where XLA runs it
            raise
        for each in ready:
            each.result()


def _empty_arrays(shape: PyTree) -> PyTree:
    return jtu.tree_map(
        # Made by NumPy: JAX would compile a program for every shape.
        lambda leaf: np.full(leaf.shape, np.nan if leaf.dtype.kind == "f" else 0, leaf.dtype),
        shape,
    )


class Gaits(NamedTuple):
    """The distinct gaits that n starts led to, the one reached most often first.

    Attributes:
        gaits: k gaits, every array with a first axis of k.
        reached: from how many starts each was, shape (k,).
        which: the gait that each start led to, −1 where none, shape (n,).
        ending: code of a `Search` of each start, shape (n,): "no walk" where it led to an orbit
            that is none.
    """

    gaits: Gait
    reached: Scalar
    which: Scalar
    ending: Scalar


@without_switches
def find_gaits(scene: WalkerScene, starts: State | RigidState, **options: Any) -> Gaits:
    """Searches for periodic gaits from many starts at once, and distinguishes those that it finds.

    The gaits have no derivatives with respect to parameters. To obtain these, pass the state of a
    gait to `find_gait` as its guess.

    Args:
        scene: the walker.
        starts: n starts, a state with leaves of shape (n,); see `rolling_starts`.
        options: those of `find_gait`, except parameters and radius_sensitivities.

    Returns:
        The distinct gaits, and which of them each of the n searches found.

    Raises:
        ArgumentError: an argument is not allowed; raised before anything is compiled.
    """
    scene = check_scene(scene, *WALKER_SCENES)
    shapes = {np.shape(leaf) for leaf in jtu.tree_leaves(starts)}
    if len(shapes) != 1 or len(next(iter(shapes))) != 1 or next(iter(shapes)) == (0,):
        raise ArgumentError(
            f"starts has leaves of shapes {sorted(shapes)}: they must all be (n,), n at least 1."
        )

    found = _find_each(scene, jtu.tree_map(as_float, starts), options)
    gaits = jtu.tree_map(np.asarray, found)
    first, which = _told_apart(gaits)
    reached = np.bincount(which[which >= 0], minlength=len(first))
    order = np.argsort(-reached, kind="stable")
    place = np.argsort(order)
    chosen = np.asarray(first, dtype=int)[order]
    return Gaits(
        gaits=jtu.tree_map(lambda leaf: jnp.asarray(leaf[chosen]), gaits),
        reached=jnp.asarray(reached[order]),
        which=jnp.asarray([place[k] if k >= 0 else -1 for k in which], dtype=int),
        ending=found.ending,
    )


@cached_jit
def _find_each(scene: WalkerScene, starts: WalkerState, options: dict[str, Any]) -> Gait:
    def one(start: WalkerState) -> Gait:
        return find_gait(scene, start, parameters=(), radius_sensitivities=False, **options)

    return jax.vmap(one)(starts)


def _told_apart(gaits: Gait) -> tuple[list[int], np.ndarray]:
    """The first start that found each gait, and which of these gaits each start found.

    A gait is the same wherever its orbit was entered: its state is one of the other's crossings.
    """
    states = np.stack(recurring_leaves(gaits.measures.state), axis=1)
    crossings = np.stack([leaf[:, :, 0] for leaf in recurring_leaves(gaits.orbit[1])], axis=2)
    first: list[int] = []
    which = np.full(len(states), -1)
    for i in np.flatnonzero(np.asarray(gaits.ending) == int(Search.FOUND)):
        near = [
            k
            for k, j in enumerate(first)
            if np.min(np.max(np.abs(states[i] - crossings[j]), axis=1)) <= _SAME
        ]
        if not near:
            first.append(int(i))
        which[i] = near[0] if near else len(first) - 1
    return first, which
