"""Sensitivities of a bifurcation: how the parameter's critical value moves with the others.

At a fold the Jacobian of x − P(x, s, q) has a left null vector w, so first derivatives are enough:
ds/dq = −(w · ∂P/∂q) / (w · ∂P/∂s). Where a multiplier leaves the unit circle elsewhere the gait
itself is regular, and its critical modulus ρ, at 1, is held: ds/dq = −(dρ/dq) / (dρ/ds). Source:
Kuznetsov, Elements of Applied Bifurcation Theory (2004), sections 10.2.1 and 10.3.1.
"""

from typing import NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError, check_choice, check_type
from jaxbiped.continuation._bifurcations import BifurcationPoint, BranchEvent
from jaxbiped.continuation._branch import Branch
from jaxbiped.continuation._continuation_setup import ContinuationSetup, setup_of
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.scene._parameter_access import parameter_values, select_parameters, with_parameters
from jaxbiped.solve._accuracy import GAIT_ACCURACIES

_CRITICAL = 1e-3
"""Distance of the largest multiplier's modulus from 1 up to which it is the critical one."""


class BifurcationSensitivities(NamedTuple):
    """Derivatives of a bifurcation's critical value with respect to p parameters.

    Attributes:
        along: name of the parameter whose critical value it is.
        value: that value, SI units.
        parameters: names of the p other parameters.
        slopes: derivatives of the value, SI units, shape (p,).
        errors: estimated errors of the derivatives, from a solve at a tolerance ten times looser,
            shape (p,).
        elasticities: relative change of the value over relative change of the parameter, (p,).
    """

    along: str
    value: float
    parameters: tuple[str, ...]
    slopes: np.ndarray
    errors: np.ndarray
    elasticities: np.ndarray


def bifurcation_sensitivities(
    branch: Branch,
    bifurcation: BifurcationPoint,
    parameters: tuple[str, ...] | None = None,
    *,
    accuracy: str = "tight",
) -> BifurcationSensitivities:
    """Derivatives of a bifurcation's value with respect to the scene's other parameters.

    Args:
        branch: from `continue_gait`.
        bifurcation: one of its folds, period doublings or Neimark–Sacker points.
        parameters: names (see `parameter_names`). Default: all except the branch's own.
        accuracy: "draft", "balanced" or "tight".

    Returns:
        The derivatives, with their errors.

    Raises:
        ArgumentError: an argument is not allowed; the point is a limit; or at a doubling or
            Neimark–Sacker point, another multiplier had already left the unit circle.
    """
    check_type("branch", branch, Branch)
    check_type("bifurcation", bifurcation, BifurcationPoint)
    check_choice("accuracy", accuracy, GAIT_ACCURACIES)
    without = (BranchEvent.LIMIT, BranchEvent.BRANCH_POINT, BranchEvent.NOT_LOCATED)
    if bifurcation.kind in without:
        raise ArgumentError(
            f"bifurcation is not allowed: a {bifurcation.kind} has no derivative; choose a fold, a "
            "period doubling or a Neimark–Sacker point."
        )
    scene, along = branch.scene_at(bifurcation), branch.along
    if parameters is None:
        names, _ = select_parameters(scene, None)
        parameters = tuple(name for name in names if name != along)
    names, _ = select_parameters(scene, (*parameters, along))
    by = _of_fold if bifurcation.kind is BranchEvent.FOLD else _of_modulus
    fine, loose = (-row[:-1] / row[-1] for row in by(branch, bifurcation, names, accuracy))
    values = np.array([float(parameter_values(scene)[name]) for name in names[:-1]])
    return BifurcationSensitivities(
        along=along,
        value=bifurcation.value,
        parameters=names[:-1],
        slopes=fine,
        errors=np.abs(fine - loose),
        elasticities=fine * values / bifurcation.value,
    )


def _of_fold(
    branch: Branch, fold: BifurcationPoint, names: tuple[str, ...], accuracy: str
) -> list[np.ndarray]:
    """Of the fine and of the looser solve, each of shape (p + 1,)."""
    setup = setup_of(branch, accuracy=accuracy)
    rows = fold_forcing(setup, fold.point.recurring, fold.value, names)
    if rows is None:
        raise ArgumentError(
            f"bifurcation at {branch.along} = {fold.value:.6g} is not allowed: its gait is not "
            f"found again at accuracy {accuracy!r}."
        )
    return list(rows)


def fold_forcing(
    setup: ContinuationSetup, recurring: np.ndarray, value: float, names: tuple[str, ...]
) -> np.ndarray | None:
    """How parameters push the return map out of a fold: w · ∂P/∂q, up to a common factor.

    Args:
        setup: of the continuation.
        recurring: components of the fold's state, shape (m,).
        value: of the continued parameter there.
        names: of p parameters.

    Returns:
        Of the cycle and of a ten times looser one, shape (2, p); None where it does not return.
    """
    scene = with_parameters(setup.scene, {setup.axis.name: value})
    known = parameter_values(scene)
    _, leaves = select_parameters(scene, names)
    values = [float(known[name]) for name in names]
    seen = setup.problem.cycle(recurring, leaves, values, setup.arrivals)
    if int(seen.code[0]) != 0:
        return None
    m, sizes = len(recurring), setup.curve.sizes[:-1]
    rows = []
    for jacobian in seen.jacobian:
        left, _, _ = np.linalg.svd((jacobian[:, :m] - np.eye(m)) * sizes / sizes[:, None])
        rows.append((left[:, -1] / sizes) @ jacobian[:, m:])
    return np.stack(rows)


def _of_modulus(
    branch: Branch, point: BifurcationPoint, names: tuple[str, ...], accuracy: str
) -> list[np.ndarray]:
    """Derivatives of the critical modulus, and the same changed by their errors."""
    gait = find_gait(
        branch.scene_at(point),
        branch.state(point),
        footsteps=branch.footsteps,
        accuracy=accuracy,
        parameters=names,
        engine=branch.engine,
    )
    radius = float(gait.measures.spectral_radius)
    if not abs(radius - 1.0) < _CRITICAL:
        raise ArgumentError(
            f"bifurcation at {branch.along} = {point.value:.6g} is not allowed: its critical "
            f"multiplier is not the gait's largest, whose modulus is {radius:.6g}."
        )
    slopes = np.asarray(gait.sensitivities.spectral_radius)
    return [slopes, slopes + np.asarray(gait.sensitivity_errors.spectral_radius)]
