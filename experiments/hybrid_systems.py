"""Hybrid systems of the literature: their cycles by `find_gait`, beside SciPy's.

Six systems that are no walkers, written in `_hybrid_systems.py` as users write them: a ball on a
vibrating table, an impact oscillator, a mass on a belt, a runner on a spring leg, a relay and van
der Pol's oscillator. Each cycle's state is followed by SciPy, with its events, at a relative
tolerance of 1e-11; the row tells by how much it does not return. Writes hybrid_systems.md,
and draws the cycles in a plane of their states.
"""

import dataclasses
import time
from collections.abc import Callable
from typing import Any

import _hybrid_systems as systems
import jax
import jax.numpy as jnp
import numpy as np
from _experiment import Options, experiment, label
from _quote_words import markdown
from scipy.integrate import solve_ivp

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

At = jb.hybrid.At


@dataclasses.dataclass(frozen=True)
class Case:
    """A system, and where its cycle is sought.

    Attributes:
        x, y: coordinates of the picture.
        method: of SciPy's solve.
    """

    system: jb.hybrid.HybridSystem
    guess: Any
    section: Any
    x: str
    y: str
    method: str = "DOP853"


BALL = systems.BouncingBall()
CASES = {
    "ball on a vibrating table": Case(BALL, BALL.one_period(), At("impact"), "phase", "height"),
    "impact oscillator": Case(
        systems.ImpactOscillator(),
        systems.Oscillation(1.461, -1.0842, 0.0),
        At("phase"),
        "place",
        "speed",
    ),
    "mass on a belt": Case(
        systems.BeltFriction(),
        systems.Sliding(1.0, 0.2, 0.0),
        At("slips"),
        "place",
        "speed",
        "Radau",
    ),
    "spring-leg runner": Case(
        systems.SpringLegRunner(),
        systems.Running(0.0, 1.0, 5.0, 0.0, 0.0, 0.0),
        systems.APEX,
        "x",
        "height",
    ),
    "relay feedback": Case(
        systems.RelayFeedback(), systems.Relayed(0.1, 0.0, -1.0), At("falls"), "slow", "fast"
    ),
    "van der Pol, μ = 1000": Case(
        systems.VanDerPol(),
        systems.Voltage(1.5, -0.001),
        systems.RELAXED,
        "value",
        "rate",
        "Radau",
    ),
}


@experiment
def main(options: Options) -> dict[str, Any]:
    rows, drawn = {}, []
    chosen = options.sized(list(CASES), list(CASES)[::4])
    for name in chosen:
        case, began = CASES[name], time.perf_counter()
        gait = jb.find_gait(case.system, case.guess, section=case.section, accuracy="tight")
        seconds = time.perf_counter() - began
        rows[name] = {
            "outcome": str(gait.outcome),
            "period": float(gait.measures.period),
            "period_error": float(gait.measure_errors.period),
            "spectral_radius": float(gait.measures.spectral_radius),
            "off_by_scipy": followed_by_scipy(case, gait),
            "first_s": seconds,
        }
        drawn.append((name, case, gait))
    table = [
        [
            name,
            f"{row['period']:.9g}",
            f"{row['spectral_radius']:.4g}",
            f"{row['off_by_scipy']:.0e}",
        ]
        for name, row in rows.items()
    ]
    heads = ["system", "period", "spectral radius", "off after a period by SciPy"]
    options.path("hybrid_systems.md").write_text(markdown(heads, table) + "\n")
    return {"systems": rows, "picture": draw(options, drawn)}


def followed_by_scipy(case: Case, gait: Any) -> float:
    """How far a cycle's state is from itself when SciPy comes to the section, or a period later.

    Of each number in units of its largest size on the cycle, of the time in periods.
    """
    system, kind, period = case.system, type(gait.state), float(gait.measures.period)
    guards = [guard for guard in system.every_guard if guard.reset is not None]
    rates = jax.jit(lambda y: jnp.stack([*map(jnp.asarray, system.rates(kind(*y)))]))
    resets = [
        jax.jit(lambda y, g=g: jnp.stack([*map(jnp.asarray, g.reset(kind(*y)))])) for g in guards
    ]

    def event(guard: Any) -> Callable[[float, np.ndarray], float]:
        armed = jax.jit(lambda y: jnp.where(guard.is_armed(kind(*y)), guard.value(kind(*y)), 1.0))

        def value(_: float, y: np.ndarray) -> float:
            return float(armed(y))

        value.terminal, value.direction = True, -1  # type: ignore[attr-defined]
        return value

    events, last = [event(guard) for guard in guards], None
    if isinstance(case.section, At):
        last = next(k for k, guard in enumerate(guards) if guard.name == case.section.guard)
    t, y = 0.0, np.array([float(number) for number in gait.state])
    sizes, end = np.maximum(np.abs(y), 1e-3), period * (1.0 if last is None else 1.5)
    while t < end * (1.0 - 1e-9):
        leg = solve_ivp(
            lambda _, y: np.asarray(rates(y)),
            (t, end),
            y,
            case.method,
            events=events,
            rtol=1e-11,
            atol=1e-13 * sizes,
        )
        t, y = leg.t[-1], leg.y[:, -1]
        sizes = np.maximum(sizes, np.abs(leg.y).max(axis=1))
        met = [k for k, times in enumerate(leg.t_events or []) if len(times)]
        for k in met:
            y = np.asarray(resets[k](y))
        if last in met:
            break
    off, came = [abs(t - period) / period], system.image(kind(*y))
    periods, cyclic = getattr(kind, "periodic", {}), getattr(kind, "cyclic", ())
    for name, size in zip(kind._fields, sizes, strict=True):
        apart = float(getattr(came, name)) - float(getattr(gait.state, name))
        if name in periods:
            apart -= periods[name] * round(apart / periods[name])
        off.append(0.0 if name in cyclic else abs(apart) / size)
    return max(off)


def draw(options: Options, drawn: list[tuple[str, Case, Any]]) -> str:
    """Each cycle in a plane of its states, with the state on the section."""
    figure = new_figure(12.0, 7.0)
    axes = figure.subplots(2, 3).ravel()
    for ax in axes[len(drawn) :]:
        ax.set_visible(False)
    for ax, (name, case, gait) in zip(axes, drawn, strict=False):
        lasts = 2.0 * float(gait.measures.period)
        motion = jb.simulate(case.system, gait.state, duration=lasts)
        course = motion.at(np.union1d(np.linspace(0.0, lasts, 800), motion.t))
        x, y = (np.asarray(getattr(course, coordinate)) for coordinate in (case.x, case.y))
        turned = np.abs(np.diff(x)) > 0.9 * np.ptp(x)
        x = np.where(np.append(turned, False), np.nan, x)
        ax.plot(x, y)
        begin = [np.asarray(getattr(gait.state, coordinate)) for coordinate in (case.x, case.y)]
        ax.plot(*begin, "o", label="on the section")
        units = getattr(type(gait.state), "own_units", {})
        words = [f"{each} ({units.get(each, '–')})" for each in (case.x, case.y)]
        label(ax, *words, name)
    axes[0].legend()
    return options.save(figure, "hybrid_systems.png")


if __name__ == "__main__":
    main()
