"""Provenance of a gait: how a search came to it and what else it saw, also in a sentence."""

import dataclasses
from typing import TYPE_CHECKING, Any, NamedTuple

import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import warn
from jaxbiped._ending import Ending, NamedCode
from jaxbiped._summary import call_text
from jaxbiped._types import Scalar, is_traced
from jaxbiped.gait._fixed_point_search import FixedPointProblem, Search
from jaxbiped.gait._relaxation import has_seed_bodies
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene._clearance import AlwaysTouching
from jaxbiped.scene._parameter_access import parameter_values
from jaxbiped.scene._scene import AbstractScene
from jaxbiped.scene._state_types import WalkerState

if TYPE_CHECKING:
    from jaxbiped.gait._gait import Gait

MOST_OTHERS = 4
"""Other gaits that there is room for."""
_MOST_NAMED = 4
"""Parameters that are named; of more, how many there are."""
_HOW = {
    Ending.TIMED_OUT: "makes no more footsteps",
    Ending.FELL_FORWARD: "falls forward",
    Ending.FELL_BACK: "falls back",
    Ending.STOPPED: "stops",
    Ending.STUMBLED: "stumbles",
}


class FoundBy(NamedCode):
    """The stage of the search that came to a gait. `str(found_by)` is its name in words.

    - guess: Newton's method from the guess that was given.
    - start: Newton's method from the seed's start, fitted to the scene.
    - walking: forward walks from many starts.
    - continuation: continuation of the gait of the seed's scene to this one; for a walker with
      other bodies, of the same walker relaxed: straight, passive, with hardly any mass outside its
      legs; where there is nothing to relax, with legs of the seed or of McGeer's kneed walker.
    - scattered starts: Newton's method from scattered starts.
    """

    GUESS = 0
    START = 1
    WALKING = 2
    CONTINUATION = 3
    SCATTERED_STARTS = 4


class BranchEnd(NamedCode):
    """How a branch of gaits ended. `str(end)` is its name in words.

    - not followed: there was no need to.
    - reached: it reached the requested scene.
    - fold: it turned back at a fold.
    - walk ends: beyond this point, the walk of the gait ends (see its `Ending`).
    - breaks off: the return map is not smooth there, for example because a foot begins to scuff.
    - no beginning: there is no known gait at which to begin.
    - unfinished: the maximum number of steps was reached.
    - no walk: beyond this point, the orbit is not a walk (see `Search`).
    - closed: it returned to its beginning.
    - branches off: it begins at another branch.
    - jumped: a step led back to gaits that were already followed.
    - interrupted: by Ctrl-C.
    """

    NOT_FOLLOWED = 0
    REACHED = 1
    FOLD = 2
    WALK_ENDS = 3
    BREAKS_OFF = 4
    NO_BEGINNING = 5
    UNFINISHED = 6
    NO_WALK = 7
    CLOSED = 8
    BRANCHES_OFF = 9
    JUMPED = 10
    INTERRUPTED = 11


class OtherGait(NamedTuple):
    """A gait that was found, but is not the one returned.

    Attributes:
        period: duration of its cycle [s].
        step_length: advance along the slope in a cycle [m].
        spectral_radius: largest absolute value of a Floquet multiplier.
        state: its state on the section.
    """

    period: Scalar
    step_length: Scalar
    spectral_radius: Scalar
    state: WalkerState


class Origin(NamedTuple):
    """How a search found a gait. Under `vmap`, every array gains the axes of the batch.

    Attributes:
        found_by: code of a `FoundBy`.
        others: other gaits that were found, by their spectral radius, with leaves of shape (4,),
            NaN beyond the last.
        branch_end: code of a `BranchEnd`: how the branch of the seed's gait ended on its way to the
            scene, if it was followed.
        branch_walk_ending: code of the `Ending` of the walk at which it ended.
        nearest: the scene with a gait on that branch that is nearest to the requested one; NaN if
            no branch was followed.
        walks: how many walks were followed from starts of the scene.
        searches: how many searches by Newton's method began at states of the scene.
    """

    found_by: Scalar
    others: OtherGait
    branch_end: Scalar
    branch_walk_ending: Scalar
    nearest: AbstractScene
    walks: Scalar
    searches: Scalar

    def __repr__(self) -> str:
        scene = self.nearest
        lost = not is_traced(scene) and np.isnan(jtu.tree_leaves(scene)[0]).all()
        return call_text("Origin", self._asdict() | {"nearest": None if lost else scene})


def single_stage_origin(problem: FixedPointProblem, found_by: FoundBy) -> Origin:
    """Of a search that had but one stage."""
    missing: PyTree = np.full(MOST_OTHERS, np.nan)
    return Origin(
        found_by=code_array(found_by),
        others=OtherGait(missing, missing, missing, jtu.tree_map(lambda _: missing, problem.guess)),
        branch_end=code_array(BranchEnd.NOT_FOLLOWED),
        branch_walk_ending=code_array(0),
        nearest=jtu.tree_map(lambda leaf: np.full(np.shape(leaf), np.nan), problem.args.minimal),
        walks=code_array(0),
        searches=code_array(1),
    )


def code_array(code: int) -> PyTree:
    """A code as an array, made by NumPy: JAX would take longer."""
    return np.asarray(int(code))


def explain_search(scene: AbstractScene, gait: "Gait") -> str:
    """How a gait was found, which others were found, or where the branch of the seed's gait ended.

    Args:
        scene: the scene that was searched; not a batch.
        gait: the result of `find_gait` for it.

    Returns:
        One sentence, without a full stop.
    """
    if gait.outcome is not Search.FOUND:
        told = _tried(gait) + _branch(scene, gait) + _what_to_try(scene, gait)
        return f"no gait found: {_search_sentence(scene, gait)}{told}"
    text = f"found by {gait.found_by}"
    asked, least = len(gait.step_lengths), int(gait.cycle_footsteps)
    if least < asked:
        text += f"; it closes after {least} of the {asked} footsteps, and no longer cycle was seen"
    if gait.others:
        seen = ", ".join(
            f"{each.period:.6g} s (spectral radius {each.spectral_radius:.4g})"
            for each in gait.others
        )
        text += f"; other gaits seen: {seen}"
    if int(gait.origin.branch_end) != int(BranchEnd.NOT_FOLLOWED) and not bool(gait.stable):
        text += f"; no stable one was seen{_branch(scene, gait)}"
    told = unknown_derivatives(gait)
    return f"{text}; {told}" if told else text


def unknown_derivatives(gait: "Gait") -> str:
    """Why derivatives of a gait are not known, without a full stop; nothing where they are."""
    if times := int(gait.grazes):
        return (
            f"the gait grazes a switch {times} {'time' if times == 1 else 'times'}, as a foot that "
            "barely touches the ground or misses it, or a joint that barely reaches its stop, by "
            "less than the tolerance resolves: its multipliers are those of one side, its "
            "sensitivities are not known"
        )
    if gait.outcome is Search.FOUND and np.any(np.isnan(np.asarray(gait.sensitivities.period))):
        return (
            "the gait's sensitivities are not known: the solve that carries them was not at the "
            "end of the cycle after all the steps that it may take; ask for a looser accuracy"
        )
    return ""


def warn_of_unknown(gait: "Gait") -> None:
    """Warns of a gait whose derivatives are not known."""
    told = unknown_derivatives(gait)
    if gait.outcome is Search.FOUND and told:
        warn(told + ".")


def _search_sentence(scene: Any, gait: "Gait") -> str:
    if gait.outcome is Search.NO_RETURN:
        return f"the walk from the start ends ({gait.walk_outcome})"
    if gait.outcome is Search.NO_WALK:
        length = float(gait.measures.step_length) / len(gait.step_lengths)
        arrivals = 1.0 / scene.arrival_footsteps
        if length > 0.0 and not system_of(scene).takes_steps(scene, length, arrivals):
            return f"an orbit that returns has footsteps of {length:.2g} m, below 1 % of the height"
        return "an orbit that returns has a foot deep underground, or steps uphill"
    return "the search from the start does not converge"


def _tried(gait: "Gait") -> str:
    """What else was tried, after a semicolon; nothing where the search had but one stage."""
    walks, searches = int(gait.origin.walks), int(gait.origin.searches) - 1
    if not walks and not searches:
        return ""
    return f"; {searches} further searches and {walks} walks led to none"


def _what_to_try(scene: Any, gait: "Gait") -> str:
    """A clearance rule if legs of one body may scuff, a guess if no branch was followed."""
    always = isinstance(getattr(scene.minimal, "clearance", None), AlwaysTouching)
    stumbled = gait.outcome is Search.NO_RETURN and gait.walk_outcome is Ending.STUMBLED
    if always and stumbled:
        structure = scene.mechanism.structure
        if all(structure.parents[body] < 0 for body in structure.feet):
            return (
                "; its feet touch whenever they reach the ground: if its legs scuff at mid-swing, "
                "give the scene clearance=jaxbiped.laws.StanceRotation()"
            )
    if int(gait.origin.branch_end) != int(BranchEnd.NOT_FOLLOWED):
        return ""
    return (
        "; give a state near a gait as guess, or follow the gait of a similar walker (see "
        "jaxbiped.models) to this one with continue_gait"
    )


def _branch(scene: Any, gait: "Gait") -> str:
    """Where the branch of the seed's gait ended, after a semicolon; nothing where it came here."""
    end = BranchEnd(int(gait.origin.branch_end))
    modelled = scene.minimal
    came = gait.outcome in (Search.FOUND, Search.NO_WALK)
    if end is BranchEnd.NOT_FOLLOWED or (end is BranchEnd.REACHED and came):
        return ""
    of_seed = has_seed_bodies(scene)
    begins = "the seed's gait" if of_seed else "the relaxed walker's gait"
    if end is BranchEnd.REACHED:
        return (
            f"; the branch of {begins} comes to this scene, but a finer search from there "
            'does not converge: try accuracy="tight"'
        )
    if end is BranchEnd.NO_BEGINNING:
        said = "the seed's walker has no gait under these laws"
        relaxed = "no gait was found of the same walker relaxed (straight, passive, of legs alone)"
        return f"; {said if of_seed else relaxed}, from which one could be followed"
    place = _differing_parameters(modelled, gait.origin.nearest)
    walk = Ending(int(gait.origin.branch_walk_ending))
    verb, beyond = {
        BranchEnd.FOLD: ("turns back at a fold at", ""),
        BranchEnd.WALK_ENDS: ("ends at", f"the walk {_HOW.get(walk, f'ends ({walk})')}"),
        BranchEnd.BREAKS_OFF: ("breaks off at", "the return map is not smooth"),
    }.get(end, ("was followed as far as", ""))
    more = f": beyond, {beyond}" if beyond else ""
    return f"; the branch of {begins} {verb} {place}, the nearest scene with a gait{more}"


def _differing_parameters(scene: Any, nearest: Any) -> str:
    """The parameters of `nearest` that are not those of `scene`."""
    if type(scene.walker) is not type(nearest.walker):
        scene = dataclasses.replace(scene, walker=scene.mechanism)
    asked, there = parameter_values(scene), parameter_values(nearest)
    # A motor's share that was not written is 1.
    different = [name for name in there if float(asked.get(name, 1.0)) != float(there[name])]
    named = ", ".join(f"{name} = {float(there[name]):.6g}" for name in different[:_MOST_NAMED])
    more = len(different) - _MOST_NAMED
    return named + (f" and {more} more" if more > 0 else "")
