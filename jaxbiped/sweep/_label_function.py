"""Labels as a function of coordinates, as the analyses of basins ask for them."""

import warnings
from collections.abc import Sequence

import numpy as np

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped.basins._label_oracle import LabelOf
from jaxbiped.basins._labels import Doubt, Label
from jaxbiped.sweep._labelling import Labelling
from jaxbiped.sweep.starts._coordinates import check_coordinates
from jaxbiped.sweep.starts._starts import Completion, batch_at


def label_at(
    labelling: Labelling,
    names: Sequence[str],
    *,
    failing: bool = False,
    place: bool = False,
    follow: Completion | None = None,
) -> LabelOf:
    """The labelling as a function of points, for the analyses in `jaxbiped.basins`.

    Args:
        labelling: see there.
        names: of the points' coordinates (see `coordinate_names`), d of them.
        failing: whether to tell only walking (0) from all else (1).
        place, follow: as in `grid`.

    Returns:
        A function of points, shape (n, d), to codes of `Label`, shape (n,). Where the labelling's
        accuracy is a number, labels that remain in doubt are told by a `RuntimeWarning`.

    Raises:
        ArgumentError: an unknown coordinate; points of another number of coordinates.
    """
    check_type("labelling", labelling, Labelling)
    check_coordinates(labelling.scene, names)

    def label_of(points: np.ndarray) -> np.ndarray:
        points = np.asarray(points, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != len(names):
            raise ArgumentError(
                f"points has shape {points.shape}: it must be (n, {len(names)}), one column for "
                f"each of {', '.join(names)}."
            )
        columns = {name: points[:, i] for i, name in enumerate(names)}
        batch = batch_at(labelling, columns, place=place, follow=follow)
        labelled = labelling(batch.states, parameters=batch.parameters)
        remain = np.sum(labelled.doubt == int(Doubt.REMAINS)) if labelled.doubt is not None else 0
        if remain:
            warnings.warn(
                f"{remain} of {len(points)} labels remain in doubt at the finest tolerance.",
                RuntimeWarning,
                stacklevel=2,
            )
        found = labelled.label.astype(int)
        return (found != int(Label.WALKING)).astype(int) if failing else found

    return label_of
