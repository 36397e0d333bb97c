"""Labelling of starts: what becomes of each."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._identity import identity
from jaxbiped._types import JsonObject, as_float
from jaxbiped.basins._labels import Label
from jaxbiped.dynamics._state import BristleState, State, state_type, within_a_turn
from jaxbiped.scene._parameter_access import scene_identity, with_parameters
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.sweep._doubtful_labels import relabel_doubtful
from jaxbiped.sweep._follow_starts import Effort, broadcast_leaves, follow_starts
from jaxbiped.sweep._gait_family import Family
from jaxbiped.sweep._labelling_loop import Labelled


class Labelling(eqx.Module):
    """How starts are labelled. Call it with many of them; `labelling` makes one.

    Attributes:
        scene: the walker.
        family: its gaits, for every value of the scene's parameters that the starts differ in.
        effort: how far and how accurately starts are followed.
    """

    scene: Scene | RigidScene
    family: Family
    effort: Effort = eqx.field(static=True)

    def __call__(
        self, states: PyTree, *, parameters: Mapping[str, np.ndarray] | None = None
    ) -> Labelled:
        """Labels n starts.

        Each is followed until its label is certain: until it comes within a known gait's radius,
        and nearer than a cycle before; until it falls, stops, stumbles or slides; or until all the
        footsteps are walked. No start's result depends on another's; one that is no number is
        labelled "solver failed". To an accuracy that is a number, see `relabel_doubtful`.

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
        count = len(states.hip_x)
        values = {} if parameters is None else parameters
        given = {name: _column(name, value, count) for name, value in values.items()}

        def follow(places: np.ndarray, effort: Effort) -> Labelled:
            some, own = jtu.tree_map(lambda leaf: leaf[places], (states, given))
            return self._label_once(some, own, effort)

        if self.effort.wanted is None:
            return follow(np.arange(count), self.effort)
        return relabel_doubtful(follow, count, self.effort, self.scene)

    def _label_once(
        self, states: PyTree, given: Mapping[str, np.ndarray], effort: Effort
    ) -> Labelled:
        """Labels of starts that are checked, by one solve of each."""
        count = len(states.hip_x)
        scene = with_parameters(self.scene, {k: jnp.asarray(v) for k, v in given.items()})
        scene = check_scene(scene, Scene, RigidScene)
        scene = jtu.tree_map(lambda leaf: np.broadcast_to(as_float(leaf), (count,)), scene)
        goals, cycles = self.family.goals(given, count)
        found = follow_starts(scene, states, goals, cycles, effort)
        if not given or self.family.names:
            return found
        # No gait is known to compare with: a cycle that repeats itself has to do.
        repeats = (found.label == int(Label.UNRESOLVED)) & (found.cycle_footsteps > 0)
        return found._replace(label=np.where(repeats, np.int8(Label.WALKING), found.label))

    def base(self, parameters: Mapping[str, np.ndarray], count: int) -> PyTree:
        """For n starts with these parameters, the gait's state: what they do not name themselves.

        Where there is no gait it is that of the nearest combination that has one.
        """
        states = self.family.states
        if not self.family.names:
            return broadcast_leaves(states[0], count)
        rows = self.family.row_of(parameters)
        columns = zip(*states, strict=True)
        leaves = [np.array([float(leaf) for leaf in column]) for column in columns]
        return type(states[0])(*[leaf[rows] for leaf in leaves])

    def settings(self) -> JsonObject:
        """Everything that the labels depend on, ready for JSON."""
        own = scene_identity(self.scene)
        effort = self.effort._asdict() | {"solver": type(self.effort.solver).__name__}
        # All engines give the same labels.
        del effort["engine"], effort["may_move"], effort["embedded"]
        if effort["wanted"] is None:
            del effort["wanted"]
        return {
            "model": "compliant" if self.scene.compliant else "rigid",
            "scene": own["scene"],
            "effort": effort,
            "models": {"scene": own["model"], "solver": identity(self.effort.solver)},
            "gaits": self.family.described(),
        }


def _check_states(scene: Scene | RigidScene, states: PyTree) -> PyTree:
    kind = state_type(scene)
    if kind is BristleState and isinstance(states, State):
        straight: Any = np.zeros_like(np.asarray(states.hip_x))
        states = BristleState(*states, *[straight] * 2)
    check_type("states", states, kind)
    leaves = [np.asarray(leaf, dtype=np.float64) for leaf in states]
    whole: PyTree = kind(*leaves)
    check_leaves_of_starts(whole)
    return whole._replace(
        theta_1=np.asarray(within_a_turn(whole.theta_1)),
        theta_2=np.asarray(within_a_turn(whole.theta_2)),
    )


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
