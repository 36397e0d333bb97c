"""Bristle law as curves over a slip there and back."""

import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped._checks import check_positive, check_type
from jaxbiped.plot._symbols import FORCE_RATIO, law_name
from jaxbiped.plot.style import (
    GROUND_COLOUR,
    LEG_COLOURS,
    LEG_STYLES,
    axes_or_new,
    dress,
    figure_of,
    legend_above,
)
from jaxbiped.scene.laws._abstract_laws import AbstractBristleLaw

_GIVES = 5.0
"""Travel in one direction, in units of the slip over which the bristles bend."""
_POINTS = 400


def bristle_law(
    law: AbstractBristleLaw, *, slip_speed: float = 1e-4, ax: Axes | None = None
) -> Figure:
    """Draws friction over load [–] against the place of a foot that slides there and back [mm].

    From straight bristles (solid), then back and there again (dashed): the loop that friction with
    a memory makes, all at one speed and under full contact.

    Args:
        law: the law, its parameters plain numbers.
        slip_speed: of the slide [m/s].
        ax: axes to draw into; a new figure unless given.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ArgumentError: no law with bristles, or a slip speed not above 0.
    """
    check_type("law", law, AbstractBristleLaw)
    check_positive("slip_speed", slip_speed, "m/s")
    ax = axes_or_new(ax, 6.4, 3.8)
    ax.axhline(0.0, color=GROUND_COLOUR, linewidth=0.6)
    place, bristle = 0.0, 0.0
    passes = (("from straight bristles", 1.0), ("back", -1.0), ("there again", 1.0))
    for k, (label, direction) in enumerate(passes):
        speed = direction * slip_speed
        times, bristles = _bristle_deflection(law, speed, bristle)
        places = place + speed * times
        friction = law.coefficient(jnp.asarray(speed), jnp.asarray(bristles))
        look = dict(color=LEG_COLOURS[min(k, 1)], linestyle=LEG_STYLES[min(k, 1)])
        ax.plot(1e3 * places, friction, linewidth=1.4, label=label if k < 2 else None, **look)
        place, bristle = places[-1], bristles[-1]
    title = f"{law_name(law)} at {slip_speed:g} m/s"
    dress(ax, title, "place of the foot, $x$ (mm)", FORCE_RATIO.on_axis())
    legend_above(ax)
    return figure_of(ax)


def _bristle_deflection(
    law: AbstractBristleLaw, speed: float, bristle: float
) -> tuple[np.ndarray, np.ndarray]:
    """Times and bristles in a slide at one speed: the law is linear in the bristle."""
    at = jnp.asarray(speed)
    straight = float(law.rate(at, jnp.asarray(0.0)))
    decay = straight - float(law.rate(at, jnp.asarray(1.0)))
    times = np.linspace(0.0, _GIVES / decay, _POINTS)
    end = straight / decay
    return times, end + (bristle - end) * np.exp(-decay * times)
