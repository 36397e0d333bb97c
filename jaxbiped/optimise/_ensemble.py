"""Ensembles: one design under scatter of parameters, its gaits found as one batch by lanes."""

from collections.abc import Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._cached_jit import cached_jit
from jaxbiped._checks import ArgumentError, check_choice, check_count, check_within
from jaxbiped.dynamics._formulation import state_type
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.optimise._cycle_functionals import Functionals, cycle_functionals
from jaxbiped.optimise._jacobian_functionals import jacobian_functionals
from jaxbiped.optimise._objectives import Evaluation, evaluate, functionals_for
from jaxbiped.scene._parameters import parameter_names, parameter_values, with_parameters
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.scene._scene import Scene

CRITERIA = ("mean", "worst")


class GaitSettings(NamedTuple):
    """How gaits are found; see `find_gait`."""

    footsteps: int = 1
    accuracy: str = "balanced"
    engine: str = "auto"


class Ensemble(NamedTuple):
    """Members that differ from a design by factors of some parameters.

    Attributes:
        names: of the parameters.
        factors: shape (n, k).
        criterion: "mean" or "worst".
        larger_is_worse: of each measure that plays a part, for "worst".
    """

    names: tuple[str, ...]
    factors: np.ndarray
    criterion: str
    larger_is_worse: dict[str, bool]


def ensemble_of(
    scene: Scene | RigidScene,
    scatter: Mapping[str, float],
    members: int,
    criterion: str,
    larger_is_worse: dict[str, bool],
    seed: int,
) -> Ensemble:
    """Members evenly spread over factors 1 − s to 1 + s of each parameter.

    Raises:
        ArgumentError: an unknown parameter or criterion, one that is zero, or a scatter not
            between 0 and 1.
    """
    from scipy.stats import qmc

    check_choice("criterion", criterion, CRITERIA)
    check_count("members", members)
    own = parameter_values(scene)
    for name, share in scatter.items():
        check_choice("scatter", name, own)
        check_within(f"scatter of {name}", share, 0.0, 1.0)
        if float(own[name]) == 0.0:
            raise ArgumentError(
                f"scatter of {name} is not allowed: it is relative, and {name} = 0."
            )
    spread = 2.0 * qmc.Sobol(len(scatter), seed=seed).random(int(members)) - 1.0
    factors = 1.0 + spread * np.asarray(list(scatter.values()))
    return Ensemble(tuple(scatter), factors, criterion, larger_is_worse)


def evaluate_ensemble(
    ensemble: Ensemble,
    scene: Scene | RigidScene,
    nominal: Evaluation,
    wanted: tuple[str, ...],
    settings: GaitSettings,
) -> Evaluation | None:
    """The nominal design's evaluation with the measures wanted taken over all members.

    None where any of them has no gait.
    """
    names, own = parameter_names(scene), parameter_values(scene)
    count, places = len(ensemble.factors), [names.index(name) for name in ensemble.names]
    values = np.asarray([float(own[name]) for name in ensemble.names]) * ensemble.factors
    changes = values - values / ensemble.factors
    points = nominal.state + changes @ nominal.state_slopes[:, places].T
    try:
        scenes = with_parameters(
            scene, {name: jnp.asarray(values[:, i]) for i, name in enumerate(ensemble.names)}
        )
    except ArgumentError:  # parameters that do not go together
        return None
    scenes = jtu.tree_map(lambda leaf: jnp.broadcast_to(jnp.asarray(leaf), (count,)), scenes)
    starts = state_type(scene)(jnp.zeros(count), *map(jnp.asarray, points.T))
    found = jax.device_get(_members(scenes, starts, wanted, settings))
    gaits: Gait = found[0]
    if not np.all((gaits.ending == int(Search.FOUND)) & gaits.sound):
        return None
    each = []
    for k in range(count):
        scene_k, (gait, *functionals) = jtu.tree_map(lambda leaf, k=k: leaf[k], (scenes, found))
        known = evaluate(scene_k, gait, wanted, settings.accuracy, tuple(functionals))
        each.append(_by_nominal(known, ensemble.factors[k], places))
    return _together(ensemble, nominal, each)


@cached_jit
def _members(
    scenes: Scene | RigidScene, starts: PyTree, wanted: tuple[str, ...], settings: GaitSettings
) -> tuple[Gait, Functionals | None, Functionals | None]:
    of_jacobian, of_cycle = functionals_for(wanted)
    steps, accuracy = settings.footsteps, settings.accuracy

    def one(
        scene: Scene | RigidScene, start: PyTree
    ) -> tuple[Gait, Functionals | None, Functionals | None]:
        gait = find_gait(scene, start, radius_sensitivities=False, **settings._asdict())
        state, engine, first, second = gait.measures.state, gait.engine, None, None
        if of_jacobian:
            first = jacobian_functionals(
                scene, state, of_jacobian, footsteps=steps, accuracy=accuracy, engine=engine
            )
        if of_cycle:
            second = cycle_functionals(
                scene, state, footsteps=steps, accuracy=accuracy, engine=engine
            )
        return gait, first, second

    return jax.vmap(one)(scenes, starts)


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
        for name in chosen:
            values = [known.values[name] for known in each]
            larger = ensemble.larger_is_worse.get(name, True)
            place = int(np.argmax(values) if larger else np.argmin(values))
            chosen[name] = [each[place]]

    def number(name: str, field: str) -> float:
        return float(np.mean([getattr(known, field)[name] for known in chosen[name]]))

    def row(name: str, field: str) -> np.ndarray:
        return np.mean([getattr(known, field)[name] for known in chosen[name]], axis=0)

    return nominal._replace(
        values={name: number(name, "values") for name in chosen},
        errors={name: number(name, "errors") for name in chosen},
        slopes={name: row(name, "slopes") for name in chosen},
        slope_errors={name: row(name, "slope_errors") for name in chosen},
        beyond_range=tuple(
            name for name in chosen if any(name in known.beyond_range for known in chosen[name])
        ),
    )
