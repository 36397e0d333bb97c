"""Labelling of starts: what becomes of each, found again more tightly where that is in doubt.

A label is a category, whose error is no small number: near a boundary any tolerance may lead to
either side. So each start is solved three times, and again more tightly where these disagree.
"""

from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._identity import identity
from jaxbiped._types import JsonObject
from jaxbiped.basins._labels import Doubt, Label, Witness
from jaxbiped.dynamics._state import without_whole_turns
from jaxbiped.hybrid._scales import resolve_slip_speed
from jaxbiped.scene._parameter_access import scene_identity, with_parameters
from jaxbiped.scene._scene import AbstractScene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.solve._error_estimate import LOOSER
from jaxbiped.solve._solvers import solver_named
from jaxbiped.solve.rosenbrock._rodas_tableaux import Rodas5P
from jaxbiped.sweep._follow_starts import Effort, broadcast_leaves, follow_starts
from jaxbiped.sweep._gait_family import Family
from jaxbiped.sweep._label_recorders import Labelled

_FINER = 10.0
"""From one tolerance to the next."""
_FINEST = {True: 1e-10, False: 1e-13}
"""Finest tolerance that is tried, by whether the motion is stiff."""
_LEAST = 2.0
"""How many times looser the looser tolerance is at least."""
_STEPS = 2
"""How many times more steps a finer tolerance may take."""

Follow = Callable[[np.ndarray, Effort], Labelled]
"""Labels of the starts with these numbers, by one solve of each."""


def relabel_doubtful(follow: Follow, count: int, effort: Effort, scene: AbstractScene) -> Labelled:
    """Labels of n starts, solved again where they are in doubt; no start's depends on another's.

    In doubt is what a ten times looser tolerance or another method of steps labels otherwise, and
    what grazes the ground: whether there was a contact may decide. It is solved by both methods at
    ten times finer tolerances, until all four labels of two tolerances in a row agree; where they
    never do the doubt remains. The effort is that of the first solve.
    """
    every = np.arange(count)
    first, other = follow(every, effort), follow(every, _by_other_method(effort))
    # One that leaves slip unresolved doubts three times more labels, and finds no more wrong ones.
    loose = max(float(resolve_slip_speed(LOOSER * effort.rtol, scene)), _LEAST * effort.rtol)
    looser = follow(every, effort._replace(rtol=loose))
    agree = ~_differ(first, other)
    disagreed = np.where(_differ(first, looser), int(Witness.LOOSER), 0)
    disagreed = disagreed + np.where(agree, 0, int(Witness.OTHER))
    # A copy: what is settled is written into it.
    label = jtu.tree_map(np.array, first)
    label.attempted[:] += looser.attempted + other.attempted
    doubtful = disagreed > 0 if first.grazes is None else (disagreed > 0) | (first.grazes > 0)
    doubt = np.where(doubtful, int(Doubt.REMAINS), int(Doubt.NONE))
    open_ = np.flatnonzero(doubtful)
    agree, finer, finest = agree[open_], effort, _FINEST[scene.stiff]
    while len(open_) and finer.rtol > 1.001 * finest:
        finer = finer._replace(rtol=max(finer.rtol / _FINER, finest))
        finer = finer._replace(max_attempts=_STEPS * finer.max_attempts)
        found, check = follow(open_, finer), follow(open_, _by_other_method(finer))
        agree_now = ~_differ(found, check)
        before: Labelled = jtu.tree_map(lambda leaf, rows=open_: leaf[rows], label)
        settled = agree & agree_now & ~_differ(found, before)
        found.attempted[:] += check.attempted + before.attempted
        for into, values in zip(jtu.tree_leaves(label), jtu.tree_leaves(found), strict=True):
            into[open_] = values
        doubt[open_[settled]] = int(Doubt.SETTLED)
        open_, agree = open_[~settled], agree_now[~settled]
    return label._replace(
        doubt=doubt.astype(np.int8),
        disagreed=disagreed.astype(np.int8),
        changed=_differ(label, first).astype(np.int8),
    )


def _by_other_method(effort: Effort) -> Effort:
    """Another method of steps: where rates are smooth, the embedded one."""
    name = "rodas4p" if isinstance(effort.solver, Rodas5P) else "rodas5p"
    solver: Any = solver_named(name)
    return effort._replace(solver=solver, embedded=True)


def _differ(one: Labelled, another: Labelled) -> np.ndarray:
    """Whether starts have other labels, gaits or cycles (boolean)."""
    differ = one.label != another.label
    return differ | (one.gait != another.gait) | (one.cycle_footsteps != another.cycle_footsteps)


class Labelling(eqx.Module):
    """A function from starts to labels, made by `labelling`. Call it with many starts at once.

    Attributes:
        scene: the walker, or a hybrid system.
        family: the gaits, for every value of the scene parameters in which the starts differ.
        effort: how far and how accurately starts are followed.
    """

    scene: AbstractScene
    family: Family
    effort: Effort = eqx.field(static=True)

    def __repr__(self) -> str:
        kind, gaits = type(self.scene).__name__, sum(map(len, self.family.rows))
        return f"Labelling({kind}, {gaits} gaits, engine={self.effort.engine})"

    def __call__(
        self, states: PyTree, *, parameters: Mapping[str, np.ndarray] | None = None
    ) -> Labelled:
        """Labels n starts.

        Each is followed until its label is certain: until it comes within a known gait's radius,
        and nearer than a cycle before; until it falls, stops, stumbles or slides; or until all the
        footsteps are walked. A hybrid system is followed until one of its endings, and its arrivals
        at the section count as footsteps. No start's result depends on another's; one that is not
        a number is labelled "solver failed". To an accuracy that is a number, see
        `relabel_doubtful`.

        Args:
            states: leaves of shape (n,).
            parameters: parameters of the scene that differ from start to start, shape (n,). Where
                the family was not made for them, a start walks that repeats a cycle several times,
                whatever its gait.

        Raises:
            ArgumentError: a state of another kind, leaves of different shapes, a parameter that
                is not allowed.
        """
        states = _check_states(self.scene, states)
        count = len(states[0])
        values = {} if parameters is None else parameters
        given = {name: _column(name, value, count) for name, value in values.items()}

        def follow(places: np.ndarray, effort: Effort) -> Labelled:
            some, own = jtu.tree_map(lambda leaf: leaf[places], (states, given))
            return self._label_once(some, own, effort)

        if self.effort.wanted is None:
            found = follow(np.arange(count), self.effort)
        else:
            found = relabel_doubtful(follow, count, self.effort, self.scene)
        return found._replace(endings=self.scene.endings)

    def _label_once(
        self, states: PyTree, given: Mapping[str, np.ndarray], effort: Effort
    ) -> Labelled:
        """Labels of starts that are checked, by one solve of each."""
        count = len(states[0])
        scene = with_parameters(self.scene, {k: jnp.asarray(v) for k, v in given.items()})
        scene = check_scene(scene, AbstractScene)
        goals, cycles = self.family.goals(given, count)
        found = follow_starts(scene, states, goals, cycles, effort)
        if not given or self.family.names:
            return found
        # No gait is known to compare with: a cycle that repeats itself has to do.
        repeats = (found.label == int(Label.UNRESOLVED)) & (found.cycle_footsteps > 0)
        return found._replace(label=np.where(repeats, np.int8(Label.WALKING), found.label))

    def base(self, parameters: Mapping[str, np.ndarray], count: int) -> PyTree:
        """The gait's state for n starts with these parameters, for coordinates that the starts do
        not name.

        If a combination has no gait, the state is that of the nearest one that has.
        """
        states = self.family.states
        if not self.family.names:
            return broadcast_leaves(states[0], count)
        rows = self.family.row_of(parameters)
        columns = zip(*states, strict=True)
        leaves = [np.array([float(leaf) for leaf in column]) for column in columns]
        return type(states[0])(*[leaf[rows] for leaf in leaves])

    def settings(self) -> JsonObject:
        """Everything on which the labels depend, ready for JSON."""
        own = scene_identity(self.scene)
        effort = self.effort._asdict() | {"solver": type(self.effort.solver).__name__}
        # All engines give the same labels.
        del effort["engine"], effort["may_move"], effort["embedded"]
        section = effort.pop("section")
        if effort["wanted"] is None:
            del effort["wanted"]
        models = {"scene": own["model"], "solver": identity(self.effort.solver)}
        if not section.names_legs:  # which a walker leaves no choice of
            models["section"] = identity(section)
        return {
            "model": self.scene.model,
            "scene": own["scene"],
            "effort": effort,
            "models": models,
            "gaits": self.family.described(),
        }


def _check_states(scene: AbstractScene, states: PyTree) -> PyTree:
    kind, bristles = scene.state_type, scene.bristles
    if (*getattr(states, "_fields", ()), *bristles) == kind._fields:
        straight = np.zeros_like(np.asarray(states[0]))
        states = kind(*states, *[straight] * len(bristles))
    check_type("states", states, kind)
    whole: PyTree = kind(*[np.asarray(leaf, dtype=np.float64) for leaf in states])
    check_leaves_of_starts(whole)
    return jtu.tree_map(np.asarray, without_whole_turns(scene, whole))


def check_leaves_of_starts(states: PyTree) -> None:
    """Raises `ArgumentError` unless all leaves are of one shape (n,)."""
    shapes = {np.shape(leaf) for leaf in states}
    if len(shapes) > 1 or len(min(shapes)) != 1:
        raise ArgumentError(
            f"states has leaves of shapes {sorted(shapes)}: all of them must be (n,)."
        )


def _column(name: str, value: npt.ArrayLike, count: int) -> np.ndarray:
    column = np.asarray(value, dtype=np.float64)
    if column.shape != (count,):
        raise ArgumentError(
            f"parameters[{name!r}] has shape {column.shape}: one value for each of the {count} "
            "starts is needed."
        )
    return column
