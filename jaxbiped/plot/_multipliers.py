"""Floquet multipliers of a gait in the complex plane."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from jaxbiped._checks import ArgumentError
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._stability import Bifurcation
from jaxbiped.plot.style import GROUND_COLOUR, LEG_COLOURS, SHADE_COLOUR, axes_or_new, figure_of

_NEAR_ZERO = 0.03
"""Multipliers closer to zero than this are named together."""
_VISIBLE = 0.005
"""Errors below this hide behind a dot."""


def check_drawable(gait: Gait) -> None:
    """Raises `ArgumentError` for a batch of gaits, or where no gait was found."""
    if np.ndim(gait.ending) != 0:
        raise ArgumentError("this is a batch of gaits: draw one of them.")
    if gait.outcome is not Search.FOUND:
        raise ArgumentError(f"the search ended {str(gait.outcome)!r}: there is no gait to draw.")


def multipliers(gait: Gait, *, ax: Axes | None = None) -> Figure:
    """Draws the Floquet multipliers, without the trivial one, and the unit circle.

    A disc about a multiplier is its estimated error, where that is larger than the dot. Those
    near zero lie on top of each other and are named together.

    Args:
        gait: a gait that was found.
        ax: axes to draw into; a new figure unless given.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ValueError: no gait was found, or this is a batch.
    """
    check_drawable(gait)
    values, errors = np.asarray(gait.multipliers), np.asarray(gait.multiplier_errors)
    ax = axes_or_new(ax, 5.6, 5.6)
    inside = Circle((0.0, 0.0), 1.0, facecolor="#F6F6F6", edgecolor=GROUND_COLOUR, zorder=0)
    ax.add_patch(inside)
    for value, error in zip(values, errors, strict=True):
        if error > _VISIBLE:
            place = (value.real, value.imag)
            ax.add_patch(Circle(place, error, facecolor=LEG_COLOURS[1], alpha=0.25))
    ax.plot(values.real, values.imag, "o", color=LEG_COLOURS[0], markersize=5, label="multipliers")
    _name(ax, values)
    _frame(ax, max(1.0, float(np.max(np.abs(values) + errors))))
    largest = float(np.max(errors))
    ax.text(
        0.02,
        0.02,
        f"largest error {largest:.1e}" + ("" if largest > _VISIBLE else ": within the dots"),
        transform=ax.transAxes,
        fontsize="small",
        color=GROUND_COLOUR,
    )
    ax.set_title(_title(gait), loc="left", fontsize="medium")
    return figure_of(ax)


def _title(gait: Gait) -> str:
    verdict = "stable" if bool(gait.stable) else "not stable"
    if gait.critical is not Bifurcation.NONE:
        verdict += f", at a bifurcation ({gait.critical})"
    radius = float(gait.measures.spectral_radius)
    return f"Floquet multipliers: spectral radius {radius:.4f}\n{verdict}"


def _frame(ax: Axes, reach: float) -> None:
    """Equal scales, both axes through zero, room for the names."""
    ax.axhline(0.0, color=SHADE_COLOUR, linewidth=0.8, zorder=0.5)
    ax.axvline(0.0, color=SHADE_COLOUR, linewidth=0.8, zorder=0.5)
    ax.set_aspect("equal")
    ax.set_xlim(-1.15 * reach, 1.15 * reach)
    ax.set_ylim(-1.15 * reach, 1.15 * reach)
    ax.set_xlabel(r"real part, Re $\lambda$ (–)")
    ax.set_ylabel(r"imaginary part, Im $\lambda$ (–)")
    ax.spines[["top", "right"]].set_visible(False)


def _name(ax: Axes, values: np.ndarray) -> None:
    """Writes each multiplier beside its dot; of a complex pair once, those near zero together."""
    small = np.abs(values) < _NEAR_ZERO
    reals = 0
    for value in values[~small & (values.imag >= 0.0)]:
        if value.imag > 0.0:
            text, shift, anchor = f"{value.real:.3f} ± {value.imag:.3f} i", 6, "bottom"
        else:
            # Neighbours on the real axis are written at different depths.
            text, shift, anchor = f"{value.real:.3f}", -6 - 12 * (reals % 2), "top"
            reals += 1
        right = value.real > 0.6
        _write(ax, value, text, (-6 if right else 6, shift), "right" if right else "left", anchor)
    if small.any():
        largest = float(np.max(np.abs(values[small])))
        text = f"{int(small.sum())} near 0\n" + rf"($|\lambda| \leq$ {largest:.1e})"
        _write(ax, 0j, text, (-8, -8), "right", "top")


def _write(
    ax: Axes, value: complex, text: str, shift: tuple[int, int], across: str, along: str
) -> None:
    ax.annotate(
        text,
        (value.real, value.imag),
        xytext=shift,
        textcoords="offset points",
        ha=across,
        va=along,
        fontsize="small",
    )
