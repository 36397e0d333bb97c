"""Laws of contact as curves: normal force, friction, friction by bristles."""

import math
from collections.abc import Sequence
from typing import Any, TypeAlias

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from jaxbiped._checks import ArgumentError, check_positive, check_type
from jaxbiped._parameter_declaration import parameter_infos
from jaxbiped._types import Scalar
from jaxbiped.plot import style
from jaxbiped.plot._symbols import FORCE_RATIO, NORMAL_FORCE, PENETRATION, SLIP_SPEED, law_name
from jaxbiped.scene.laws._abstract_laws import (
    AbstractBristleLaw,
    AbstractFrictionLaw,
    AbstractNormalLaw,
)

_RATE_COLOURS = ("#56B4E9", style.GROUND_COLOUR, "#E69F00", style.LEG_COLOURS[1])
_RATE_STYLES = (*style.LEG_STYLES[3:0:-1], style.LEG_STYLES[0])
"""One rate each, from the slowest; the fifth begins anew."""
_MOST_STEPS = 16384
_LONGEST = 2.0
"""How long a drop is followed [s]: a strongly damped foot may creep for ever."""
_Drop: TypeAlias = tuple[Scalar, Scalar]


def normal_law(
    law: AbstractNormalLaw,
    *,
    depth: float = 1e-3,
    rates: Sequence[float] | None = None,
    mass: float = 2.0,
    approach_speed: float = 0.1,
    figure: Figure | SubFigure | None = None,
) -> Figure:
    """Draws a law of the normal force: against penetration, and during an impact.

    Left, the force [N] against penetration [mm] at a few rates. Right, the loop of force and
    penetration while a mass hits the ground and rebounds, without gravity. The area of the loop is
    the energy lost, and the title states the coefficient of restitution.

    Args:
        law: the law, with plain numbers as parameters.
        depth: largest penetration on the left [m].
        rates: rates of penetration on the left [m/s]. Default: −0.5, 0, 0.5 and 1 times the rate at
            which the damping force equals the force at rest at `depth`.
        mass: mass that hits the ground [kg].
        approach_speed: rate of penetration at touchdown [m/s].
        figure: empty figure or subfigure to draw into. Default: a new figure.

    Returns:
        The figure given, or the new one.

    Raises:
        ArgumentError: this is not a normal law, or depth, mass or approach_speed is not above 0.
    """
    check_type("law", law, AbstractNormalLaw)
    check_positive("depth", depth, "m")
    check_positive("mass", mass, "kg")
    check_positive("approach_speed", approach_speed, "m/s")
    abreast = 2
    if figure is None:
        abreast = style.panels_abreast(2, width=3.4)
        figure = style.new_figure(4.6 * abreast, 3.8 * (2 // abreast))
    left, right = figure.subplots(2 // abreast, abreast, squeeze=False).flat
    _draw_rates(left, law, depth, _telling_rates(law, depth) if rates is None else rates)
    _draw_drop(right, law, mass, approach_speed)
    return style.figure_of(left)


def friction_law(
    *laws: AbstractFrictionLaw,
    fastest: float | None = None,
    load: float = 20.0,
    ax: Axes | None = None,
) -> Figure:
    """Draws one law of friction, or several to compare: force over load [–] against slip speed.

    The scale of slip speeds [m/s] is linear about rest and logarithmic far from it. It changes at
    the law's own speed, at which the rise of the force from rest slackens (with several laws, at
    the lowest of these speeds).

    Args:
        laws: the laws, with plain numbers as parameters.
        fastest: highest slip speed [m/s]. Default: a thousand times the highest of the laws' own
            speeds, at most 1 m/s.
        load: normal force [N]; it matters only for a law that is not proportional to it.
        ax: axes to draw into. Default: a new figure.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ArgumentError: this is not a law of friction, or load or fastest is not above 0.
    """
    if not laws:
        raise ArgumentError("laws is empty: give a law of friction at least.")
    for law in laws:
        check_type("law", law, AbstractFrictionLaw)
    check_positive("load", load, "N")
    own = [_own_speed(law, load) for law in laws]
    end = min(1e3 * max(own), 1.0) if fastest is None else fastest
    check_positive("fastest", end, "m/s")
    bend = min(*own, end)
    slip = bend * np.sinh(np.linspace(-1.0, 1.0, 1601) * np.arcsinh(end / bend))
    ax = style.axes_or_new(ax, 6.4, 3.8)
    ax.axhline(0.0, color=style.GROUND_COLOUR, linewidth=0.6)
    for k, (law, name) in enumerate(zip(laws, names_apart(laws), strict=True)):
        ax.plot(slip, _per_load(law, load, slip), linewidth=1.4, label=name, **style.line_of(k))
    ax.set_xscale("asinh", linear_width=bend)
    _mark_speeds(ax, bend, end)
    ax.set_xlim(-end, end)
    ax.margins(y=0.08)
    title = law_name(laws[0]) if len(laws) == 1 else "Laws of friction"
    style.dress(ax, title, SLIP_SPEED.on_axis(), FORCE_RATIO.on_axis())
    if len(laws) > 1:
        style.legend_above(ax)
    return style.figure_of(ax)


def names_apart(laws: Sequence[object]) -> list[str]:
    """Names of laws in words, and of those of one kind also the parameters in which they differ."""
    names = []
    for law in laws:
        own, name = parameter_infos(type(law)), law_name(law)
        alike = [each for each in laws if type(each) is type(law)]
        for field, info in own.items():
            value = getattr(law, field)
            if value is not None and len({str(getattr(each, field)) for each in alike}) > 1:
                unit = info.quantity.unit_in_figure.replace("–", "")
                number = f"{float(value):.3g} {unit}".strip()
                name += f", {info.quantity.symbol or field} = {number}"
        names.append(name)
    return names


def _telling_rates(law: AbstractNormalLaw, depth: float) -> list[float]:
    at = (jnp.asarray(float(depth)), jnp.asarray(0.0))
    force, damper = float(law.force(*at)), float(jax.grad(law.force, 1)(*at))
    return [part * force / damper for part in (-0.5, 0.0, 0.5, 1.0)] if damper > 0.0 else [0.0]


def _draw_rates(ax: Axes, law: AbstractNormalLaw, depth: float, rates: Sequence[float]) -> None:
    # Both sides of touchdown, where a law may jump.
    depths = np.concatenate([[-0.05 * depth, 0.0], np.linspace(1e-9 * depth, depth, 400)])
    for k, rate in enumerate(rates):
        force = law.force(jnp.asarray(depths), jnp.full(depths.shape, float(rate)))
        colour, dashes = _RATE_COLOURS[k % 4], _RATE_STYLES[k % 4]
        if len(rates) == 1:
            colour, dashes = style.GROUND_COLOUR, "-"
        label = f"{rate:.3g} m/s".replace("-", "−")
        ax.plot(1e3 * depths, force, color=colour, linestyle=dashes, linewidth=1.4, label=label)
    ax.margins(x=0.0)
    style.dress(ax, law_name(law), PENETRATION.on_axis("mm"), NORMAL_FORCE.on_axis(), panel=True)
    style.legend(ax, title="rate of penetration", title_fontsize="small")


def _draw_drop(ax: Axes, law: AbstractNormalLaw, mass: float, speed: float) -> None:
    depth, rate = _drop(law, mass, speed)
    force = np.asarray(law.force(jnp.asarray(depth), jnp.asarray(rate)))
    # There is no force before touchdown, and none after it has come back to zero.
    leaving = [0.0] if force[-1] <= 0.0 else []
    depth, force = (np.concatenate([[0.0], part, leaving]) for part in (depth, force))
    turn = int(np.argmax(depth)) + 1
    ax.fill(1e3 * depth, force, color=style.LEG_COLOURS[0], alpha=0.12, linewidth=0)
    parts = {"going in": slice(None, turn), "coming out": slice(turn - 1, None)}
    look: dict[str, Any] = {"color": style.LEG_COLOURS[0], "linewidth": 1.4}
    for (label, part), dashes in zip(parts.items(), style.LEG_STYLES, strict=False):
        ax.plot(1e3 * depth[part], force[part], linestyle=dashes, label=label, **look)
    ax.margins(x=0.02)
    restitution = max(-rate[-1], 0.0) / speed
    title = f"Drop of {mass:g} kg at {speed:g} m/s: restitution {restitution:.3f}"
    style.dress(ax, title, PENETRATION.on_axis("mm"), NORMAL_FORCE.on_axis(), panel=True)
    style.legend(ax)


def _drop(law: AbstractNormalLaw, mass: float, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Penetration and its rate at the steps of a drop, from touchdown until the mass is out."""
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(_fall),
        diffrax.Tsit5(),
        t0=0.0,
        t1=_LONGEST,
        dt0=1e-7,
        # A hair inside, on the side where the force acts.
        y0=(jnp.asarray(1e-12), jnp.asarray(float(speed))),
        args=(law, jnp.asarray(float(mass))),
        stepsize_controller=diffrax.PIDController(rtol=1e-9, atol=1e-13),
        saveat=diffrax.SaveAt(t0=True, steps=True),
        event=diffrax.Event(_is_out),
        max_steps=_MOST_STEPS,
        throw=False,
    )
    assert solution.ys is not None
    depth, rate = (np.asarray(part) for part in solution.ys)
    saved = np.isfinite(depth)
    return np.maximum(depth[saved], 0.0), rate[saved]


def _fall(t: ArrayLike, y: _Drop, args: Any) -> _Drop:
    law, mass = args
    return y[1], -law.force(*y) / mass


def _is_out(t: ArrayLike, y: _Drop, args: Any, **rest: object) -> Scalar:
    return (y[0] < 0.0) | ((y[1] < 0.0) & (args[0].force(*y) <= 0.0))


def _mark_speeds(ax: Axes, bend: float, end: float) -> None:
    """Ticks at zero and at the powers of ten of both signs where the scale is logarithmic."""
    least = bend * (6.0 if style.is_narrow() else 1.5)
    first, last = math.ceil(math.log10(least)), math.floor(math.log10(end) + 1e-9)
    marks = {10.0**k: f"10^{{{k}}}" for k in range(first, last + 1)} or {end: f"{end:g}"}
    below = {-x: f"$-{text}$" for x, text in reversed(marks.items())}
    labels = below | {0.0: "0"} | {x: f"${text}$" for x, text in marks.items()}
    ax.set_xticks(list(labels), list(labels.values()))


def _own_speed(law: AbstractFrictionLaw, load: float) -> float:
    """The least slip speed up to 1 m/s from which the force grows slower than √V_T, or 1 m/s."""
    speeds = np.geomspace(1e-9, 1.0, 2000)
    sizes = np.abs(_per_load(law, load, speeds))
    speeds, sizes = speeds[sizes > 0.0], sizes[sizes > 0.0]
    slack = np.diff(np.log(sizes)) < 0.5 * np.diff(np.log(speeds))
    return float(speeds[np.argmax(slack)]) if slack.any() else 1.0


def _per_load(law: AbstractFrictionLaw, load: float, slip: np.ndarray) -> np.ndarray:
    return np.asarray(law.force(jnp.full(slip.shape, float(load)), jnp.asarray(slip))) / load


_GIVES = 5.0
"""Travel in one direction, in units of the slip over which the bristles bend."""
_POINTS = 400


def bristle_law(
    law: AbstractBristleLaw, *, slip_speed: float = 1e-4, ax: Axes | None = None
) -> Figure:
    """Draws friction over load [–] against the position of a foot that slides back and forth [mm].

    The foot slides forth from straight bristles (solid), then back and forth again (dashed), at one
    speed and in full contact: friction with a memory makes a loop.

    Args:
        law: the law, with plain numbers as parameters.
        slip_speed: speed of the slide [m/s].
        ax: axes to draw into. Default: a new figure.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ArgumentError: this is not a law with bristles, or the slip speed is not above 0.
    """
    check_type("law", law, AbstractBristleLaw)
    check_positive("slip_speed", slip_speed, "m/s")
    ax = style.axes_or_new(ax, 6.4, 3.8)
    ax.axhline(0.0, color=style.GROUND_COLOUR, linewidth=0.6)
    place, bristle = 0.0, 0.0
    passes = (("from straight bristles", 1.0), ("back", -1.0), ("there again", 1.0))
    for k, (label, direction) in enumerate(passes):
        speed = direction * slip_speed
        times, bristles = _bristle_deflection(law, speed, bristle)
        places = place + speed * times
        friction = law.coefficient(jnp.asarray(speed), jnp.asarray(bristles))
        look = style.Look(min(k, 1)).line | {"label": label if k < 2 else None}
        ax.plot(1e3 * places, friction, linewidth=1.4, **look)
        place, bristle = places[-1], bristles[-1]
    title = f"{law_name(law)} at {slip_speed:g} m/s"
    style.dress(ax, title, "place of the foot, $x$ (mm)", FORCE_RATIO.on_axis())
    style.legend_above(ax)
    return style.figure_of(ax)


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
