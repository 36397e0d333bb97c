"""A slice through the basin of the seed's walker: labels on a grid, and what they say."""

from typing import Any

import numpy as np

import jaxbiped as jb

THETA, OMEGA = (-0.5, 0.8), (-4.0, 5.0)
"""The slice: angle [rad] and rate [rad/s] of the swing leg at mid-stance, all else the gait's."""
AXES = ("angle of the swing leg at mid-stance, θ", "its rate, ω")
UNITS = ("rad", "rad/s")


def axes(side: int) -> dict[str, np.ndarray]:
    """Values along the two axes; the angle runs fastest."""
    return {"omega_swing": np.linspace(*OMEGA, side), "theta_swing": np.linspace(*THETA, side)}


def codes_on_grid(labelling: jb.Labelling, side: int) -> tuple[np.ndarray, np.ndarray]:
    """Labels and cycles' footsteps of a square grid, shape (side, side)."""
    found = jb.sweep(labelling, jb.starts.grid(labelling.scene, axes(side)))
    return found["label"].values, found["cycle_footsteps"].values


def in_words(fractions: dict[str, jb.basins.Fraction]) -> dict[str, dict[str, float]]:
    """Fractions ready for JSON."""
    return {
        name: {"estimate": float(part.estimate), "low": part.low, "high": part.high}
        for name, part in fractions.items()
    }


def boundary_measures(codes: np.ndarray) -> dict[str, dict[str, Any]]:
    """Dimension, uncertainty exponent and entropy: of all labels, and of walking or not."""
    walks = (codes != int(jb.basins.Label.WALKING)).astype(int)
    return {"all labels": _measures(codes), "walking or not": _measures(walks)}


def _measures(codes: np.ndarray) -> dict[str, Any]:
    dimension = jb.basins.boundary_dimension(codes)
    uncertainty = jb.basins.uncertainty_exponent(codes)
    entropy = jb.basins.entropy(codes)
    return {
        "dimension": float(dimension.estimate),
        "dimension_error": float(dimension.error),
        "uncertainty_exponent": float(uncertainty.exponent),
        "uncertainty_error": float(uncertainty.error),
        "basin_entropy": entropy.basin,
        "boundary_entropy": entropy.boundary,
        "fractal_by_entropy": entropy.fractal,
    }


def refined(labelling: jb.Labelling, cells: int, levels: int) -> jb.basins.RefinedBoundary:
    """The slice's boundaries, halved so many times from a coarse grid."""
    lower, upper = zip(THETA, OMEGA, strict=True)
    return jb.basins.refine_boundary(
        jb.label_at(labelling, ("theta_swing", "omega_swing")),
        lower,
        upper,
        (cells, cells),
        levels=levels,
        batch=16384,
    )


def tolerances(scene: jb.Scene, side: int) -> list[dict[str, Any]]:
    """How labels change with the tolerance, against the finest: which share, and where."""
    efforts = {name: jb.ACCURACIES[name].walk for name in ("draft", "balanced")}
    efforts |= {"1e-7": 1e-7, "1e-8": 1e-8}
    found = {
        name: codes_on_grid(jb.labelling(scene, rtol=rtol), side)[0]
        for name, rtol in efforts.items()
    }
    exact = found["1e-8"]
    rows = []
    for name, codes in found.items():
        changed = codes != exact
        walks, walked = codes == int(jb.basins.Label.WALKING), exact == int(jb.basins.Label.WALKING)
        rows.append(
            {
                "accuracy": name,
                "changed": float(changed.mean()),
                "changed_beside_boundary": _share(changed & beside_boundary(exact), changed),
                "walking": float(walks.mean()),
                "walking_changed": float((walks != walked).mean()),
            }
        )
    return rows


def beside_boundary(codes: np.ndarray) -> np.ndarray:
    """Whether one of the eight points around a grid point has another label (boolean)."""
    padded = np.pad(codes, 1, mode="edge")
    rows, columns = codes.shape
    around = [padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)]
    return np.any([each != codes for each in around], axis=0)


def _share(part: np.ndarray, whole: np.ndarray) -> float | None:
    return float(part.sum() / whole.sum()) if whole.any() else None
