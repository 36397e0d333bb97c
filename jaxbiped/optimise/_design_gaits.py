"""Gaits of designs: of one, of many as one batch of lanes, of an ensemble under scatter."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice, check_within
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._state import state_of_recurring
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.hybrid._sections import AbstractSection
from jaxbiped.optimise._jacobian_functionals import CLUSTER
from jaxbiped.optimise._objective_values import (
    AllFunctionals,
    Evaluation,
    evaluate,
    functionals_of,
)
from jaxbiped.optimise._objectives import Measures
from jaxbiped.scene._parameter_access import parameter_names, parameter_values, with_parameters
from jaxbiped.scene._scene import WalkerScene
from jaxbiped.scene._state_types import WalkerState

CRITERIA = ("mean", "worst")
_CORNERS = 6
"""Scattered parameters up to which the worst case is sought at all corners of their box."""
_WIDTHS = (1.0, 0.5, 0.25, 0.1)
"""Half-widths, as shares of the box's, about the worst member so far in which others are tried."""
_WORSE = 1e-4
"""Relative difference by which another member counts as worse."""


class GaitSettings(NamedTuple):
    """How gaits are found; see `find_gait`."""

    footsteps: int | None = None
    accuracy: str = "balanced"
    engine: str = "auto"
    section: AbstractSection | None = None
    radius_sensitivities: bool = False

    def find(self, scene: WalkerScene, start: PyTree | None) -> Gait:
        """The gait of a scene near a state; from nothing for None."""
        return find_gait(scene, start, **self._asdict())

    def find_near(self, scene: WalkerScene, point: np.ndarray) -> Gait:
        return self.find(scene, self.state_of(scene, point))

    def state_of(self, scene: WalkerScene, point: np.ndarray) -> WalkerState:
        return jtu.tree_map(np.float64, state_of_recurring(scene.state_type, point))


def are_walks(gaits: Gait) -> np.ndarray:
    """Whether a gait was found, and is a walk: of one or of a batch."""
    return (np.asarray(gaits.ending) == int(Search.FOUND)) & np.asarray(gaits.sound)


def gaits_near(
    scene: WalkerScene,
    values: Mapping[str, np.ndarray],
    points: np.ndarray,
    settings: GaitSettings,
    wanted: Measures = MappingProxyType({}),
) -> tuple[WalkerScene, Gait, AllFunctionals]:
    """Gaits of n scenes that differ in some parameters.

    The parameters' values by name have the shape (n,), and the points, guesses of the recurring
    components, (n, m). Functionals are those of the `wanted` measures.

    Returns:
        The scenes, the gaits and their functionals, leaves (n, …).

    Raises:
        ArgumentError: parameters that do not go together.
    """
    count = len(points)
    scenes = with_parameters(scene, {name: jnp.asarray(each) for name, each in values.items()})
    scenes = jtu.tree_map(lambda leaf: jnp.broadcast_to(jnp.asarray(leaf), (count,)), scenes)
    starts = state_of_recurring(scene.state_type, map(jnp.asarray, points.T), jnp.zeros(count))
    return jax.device_get((scenes, *_find_each(scenes, starts, dict(wanted), settings)))


@cached_jit
def _find_each(
    scenes: WalkerScene, starts: PyTree, wanted: Measures, settings: GaitSettings
) -> tuple[Gait, AllFunctionals]:
    def one(scene: WalkerScene, start: PyTree) -> tuple[Gait, AllFunctionals]:
        gait = settings.find(scene, start)
        return gait, functionals_of(scene, gait, wanted, settings.accuracy)

    return jax.vmap(one)(scenes, starts)


class Ensemble(NamedTuple):
    """Members that differ from a design by factors of some parameters.

    Attributes:
        names: of the parameters.
        factors: shape (n, k).
        criterion: "mean" of the members, which are a sample; or "worst" of the box, whose corners
            are the last of them.
        larger_is_worse: of each measure that plays a part, for "worst".
        spread: half-widths of the box, shape (k,).
    """

    names: tuple[str, ...]
    factors: np.ndarray
    criterion: str
    larger_is_worse: dict[str, bool]
    spread: np.ndarray

    @property
    def words(self) -> str:
        """What a worst case is the worst of."""
        k = len(self.names)
        corners = f"the {2**k} corners" if k <= _CORNERS else f"no corners, which are {2**k},"
        return f"Worst of the box of {k} scattered parameters: {corners}, a sample and a search."


def ensemble_of(
    scene: Any,
    scatter: Mapping[str, float],
    members: int,
    criterion: str,
    larger_is_worse: dict[str, bool],
    seed: int,
) -> Ensemble:
    """Members evenly spread over factors 1 − s to 1 + s of each parameter.

    For the worst case the corners of this box come along.

    Raises:
        ArgumentError: an unknown parameter, one that is zero, or a scatter not
            between 0 and 1.
    """
    from scipy.stats import qmc

    own = parameter_values(scene)
    for name, share in scatter.items():
        check_choice("scatter", name, own)
        check_within(f"scatter of {name}", share, 0.0, 1.0)
        if float(own[name]) == 0.0:
            raise ArgumentError(
                f"scatter of {name} is not allowed: it is relative, and {name} = 0."
            )
    k, spread = len(scatter), np.asarray(list(scatter.values()))
    shares = 2.0 * qmc.Sobol(k, seed=seed).random(int(members)) - 1.0
    if criterion == "worst" and k <= _CORNERS:
        shares = np.concatenate([shares, list(itertools.product((-1.0, 1.0), repeat=k))])
    return Ensemble(tuple(scatter), 1.0 + shares * spread, criterion, larger_is_worse, spread)


def with_worse_members(
    ensemble: Ensemble,
    evaluate: Callable[[Ensemble], Sequence[Evaluation | None]],
    wanted: Measures,
    seed: int,
) -> Ensemble | None:
    """The ensemble with worse members than it has, which a search in its box comes upon.

    They take the places of members that are sampled. None where nothing worse is found.
    """
    random, found = np.random.default_rng(seed), []
    low, high = 1.0 - ensemble.spread, 1.0 + ensemble.spread
    for name in wanted:
        sign = 1.0 if ensemble.larger_is_worse.get(name, True) else -1.0
        factors, worst, centre = ensemble.factors, [-np.inf], ensemble.factors[0]
        for width in (*_WIDTHS, 0.0):
            each = evaluate(ensemble._replace(factors=factors))
            # A member without a gait is worse than any that has one.
            told = [np.inf if known is None else sign * known.values[name] for known in each]
            values = np.nan_to_num(told, nan=np.inf, posinf=np.inf, neginf=-np.inf)
            place = int(np.argmax(values))
            if values[place] > worst[-1]:
                worst, centre = [*worst, values[place]], factors[place]
            aside = random.uniform(-1.0, 1.0, factors.shape)
            factors = np.clip(centre + width * ensemble.spread * aside, low, high)
        if worst[-1] > worst[1] + _WORSE * abs(worst[1]):
            found.append(centre)
    if not found:
        return None
    return ensemble._replace(factors=np.concatenate([ensemble.factors[len(found) :], found]))


def evaluate_ensemble(
    ensemble: Ensemble,
    scene: WalkerScene,
    nominal: Evaluation,
    wanted: Measures,
    settings: GaitSettings,
) -> Evaluation | None:
    """The nominal design's evaluation with the measures wanted taken over all members.

    None where any of them has no gait.
    """
    each = evaluate_members(ensemble, scene, nominal, wanted, settings)
    known = [one for one in each if one is not None]
    return _together(ensemble, nominal, known) if len(known) == len(each) else None


def evaluate_members(
    ensemble: Ensemble,
    scene: WalkerScene,
    nominal: Evaluation,
    wanted: Measures,
    settings: GaitSettings,
) -> list[Evaluation | None]:
    """Of each member the measures wanted; None where it has no gait."""
    names, own = parameter_names(scene), parameter_values(scene)
    places = [names.index(name) for name in ensemble.names]
    values = np.asarray([float(own[name]) for name in ensemble.names]) * ensemble.factors
    changes = values - values / ensemble.factors
    points = nominal.state + changes @ nominal.state_slopes[:, places].T
    columns = dict(zip(ensemble.names, values.T, strict=True))
    try:
        found = gaits_near(scene, columns, points, settings, wanted)
    except ArgumentError:  # parameters that do not go together
        return [None] * len(values)
    each: list[Evaluation | None] = []
    for k, factors in enumerate(ensemble.factors):
        scene_k, gait, functionals = jtu.tree_map(lambda leaf, k=k: leaf[k], found)
        known = None
        if are_walks(gait):
            known = evaluate(scene_k, gait, wanted, settings.accuracy, functionals)
            known = _by_nominal(known, factors, places)
        each.append(known)
    return each


def _by_nominal(known: Evaluation, factors: np.ndarray, places: list[int]) -> Evaluation:
    """Derivatives with respect to the nominal parameters, of which a member's are multiples."""
    scales = np.ones(known.state_slopes.shape[1])
    scales[places] = factors
    return known._replace(
        slopes={name: row * scales for name, row in known.slopes.items()},
        slope_errors={name: row * scales for name, row in known.slope_errors.items()},
    )


def _together(ensemble: Ensemble, nominal: Evaluation, each: list[Evaluation]) -> Evaluation:
    chosen = {name: each for name in each[0].values}
    if ensemble.criterion == "worst":
        for name in [name for name in chosen if name not in CLUSTER[1:]]:
            values = [known.values[name] for known in each]
            larger = ensemble.larger_is_worse.get(name, True)
            place = int(np.argmax(values) if larger else np.argmin(values))
            chosen[name] = [each[place]]
            if name == CLUSTER[0]:  # one member's multipliers
                chosen |= {other: chosen[name] for other in CLUSTER[1:] if other in chosen}

    def means(field: str) -> dict[str, Any]:
        return {
            name: np.mean([getattr(known, field)[name] for known in those], axis=0)
            for name, those in chosen.items()
        }

    return nominal._replace(
        values={name: float(value) for name, value in means("values").items()},
        errors={name: float(value) for name, value in means("errors").items()},
        slopes=means("slopes"),
        slope_errors=means("slope_errors"),
        beyond_range=tuple(
            name for name, those in chosen.items() if any(name in k.beyond_range for k in those)
        ),
    )
