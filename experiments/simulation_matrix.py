"""What `simulate` does for each kind of scene: every option, every engine, against a finer walk.

Writes simulation_matrix.md: a table with a row for each option and a column for each kind. A cell
is the largest difference of what the option returns from the same of a walk at the tight accuracy,
by default options otherwise, in SI units; for derivatives, from central differences, relative to
these. Or it is the number of the sentence that refuses it, below the table.
"""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from _experiment import Options, experiment
from _quote_words import markdown
from tqdm import tqdm

import jaxbiped as jb

HEEL_STRIKE = jb.HeelStrike()


@dataclasses.dataclass(frozen=True)
class Kind:
    """A scene with a start, and how its walks are asked for.

    Attributes:
        start: the start by the number that derivatives are with respect to.
        at: that number.
        duration: of a walk with two heel strikes or more [s].
        passes: rises through zero where a standing leg or a pendulum passes the normal of the
            slope, or where a ball is highest.
        solver: another solver that fits.
        dt: size of steps that resolve its motion [s].
        reset: where its state is reset: at heel strikes, or where a ball meets the table.
    """

    scene: Any
    start: Callable[[Any], Any]
    at: float
    duration: float
    passes: Callable[[Any], Any]
    solver: str
    dt: float
    reset: Any = HEEL_STRIKE

    @property
    def section(self) -> jb.Section:
        """The section of the user's own."""
        return jb.Section(lambda scene, state: self.passes(state))

    def walk(self, value: Any = None, **how: Any) -> Any:
        """A walk; `save` is the end unless something else is asked for."""
        state = self.start(self.at if value is None else value)
        limits = {} if "footsteps" in how else {"duration": self.duration}
        return jb.simulate(self.scene, state, **({"save": "end"} | limits | how))


def walker(
    scene: Any, state: Any, duration: float, solver: str, dt: float, *, moved: str, stands: str
) -> Kind:
    """A walker with the name of the number that is moved, and of the angle that passes zero."""
    return Kind(
        scene,
        lambda value: state._replace(**{moved: value}),
        float(getattr(state, moved)),
        duration,
        lambda state: -getattr(state, stands),
        solver,
        dt,
    )


class Flight(NamedTuple):
    """Height [m] and speed [m/s] of a ball."""

    height: float
    speed: float


class Ball(jb.hybrid.HybridSystem):
    """A ball in air that drags it, on a table."""

    state_type = Flight
    drag: float = jb.laws.parameter("drag", "$c$", "1/s", default=0.3)

    def rates(self, y: Any) -> Flight:
        """Free fall with linear drag."""
        return Flight(y.speed, -9.81 - self.drag * y.speed)

    def bounce(self, y: Any) -> Flight:
        """The state behind an impact, by a restitution of 0.8."""
        return y._replace(speed=-0.8 * y.speed)

    def guards(self) -> tuple[jb.hybrid.Guard, ...]:
        """The table."""
        return (jb.hybrid.Guard("table", lambda y: y.height, reset=self.bounce),)


def published(name: str, gait: str, duration: float) -> Kind:
    """A published walker on rigid feet near a gait."""
    model = jb.models.MODELS[name]
    scene = model.make()
    state = scene.state(**model.starts[gait])
    moved, *_, stands = (field for field in state._fields if field.startswith("theta"))
    return walker(scene, state, duration, "tsit5", duration / 400, moved=moved, stands=stands)


def pendulum() -> Kind:
    """A body that swings from a pin, 0.1 m off its centre, by the constraint method "index1"."""
    body = jb.constraints.LinkBody(1.0, 0.0096)
    pin = jb.constraints.Pin((0.0, 0.1), (0.0, 0.0), 0)
    linkage = jb.constraints.Linkage((body,), (pin,))
    scene = jb.dynamics.LinkageScene(linkage, jb.constraints.Index1())

    def start(rate: Any) -> jb.dynamics.LinkageState:
        x, z = 0.1 * np.sin(0.5), -0.1 * np.cos(0.5)
        return jb.dynamics.LinkageState((x, z, 0.5), (-z * rate, x * rate, rate))

    return Kind(scene, start, 1.0, 1.0, lambda state: -state.q[2], "tsit5", 1e-3)


def kinds() -> dict[str, Kind]:
    """One of each kind."""
    scene, state = jb.seed_scene(slope=0.02), jb.seed_state()
    seed = functools.partial(
        walker, state=state, duration=1.0, solver="rodas5p", dt=2e-5,
        moved="omega_1", stands="theta_1",
    )  # fmt: skip
    return {
        "compliant": seed(scene),
        "rigid": published("garcia", "long", 9.0),
        "rigid, pushed": published("kuo", "gait", 9.0),
        "rigid, knees": published("hsu-chen", "gait", 1.3),
        "redundant": seed(jb.RedundantScene(scene, "index1")),
        "linkage": pendulum(),
        "own system": Kind(
            Ball(),
            lambda speed: Flight(0.3, speed),
            0.4,
            1.2,
            lambda state: -state.speed,
            "tsit5",
            1e-3,
            jb.hybrid.At("table"),
        ),
    }


def _end(kind: Kind, **how: Any) -> Any:
    return kind.walk(**how).final


def _number(walk: Any) -> Any:
    """The second number of a walk's end."""
    return jax.tree.leaves(walk.final)[1]


def _times(kind: Kind, **how: Any) -> Any:
    return kind.walk(save=kind.duration * np.linspace(0.05, 0.95, 7), **how).state


def _steps(kind: Kind, **how: Any) -> Any:
    walk = kind.walk(save="steps", **how)
    return walk.at(kind.duration * np.linspace(0.05, 0.95, 7))


def _arrivals(section: Callable[[Kind], Any]) -> Callable[..., Any]:
    def arrivals(kind: Kind, **how: Any) -> Any:
        passages = kind.walk(save=section(kind), **how).arrivals
        return passages.t[: int(passages.total)]

    return arrivals


def _footsteps(kind: Kind, **how: Any) -> Any:
    return kind.walk(footsteps=2, **how).t


def _extremes(kind: Kind, **how: Any) -> Any:
    walk = kind.walk(extremes=lambda scene, state: jax.tree.leaves(state)[0], **how)
    return walk.lowest, walk.highest


def _slope(differentiate: Callable[..., Any]) -> Callable[..., Any]:
    def slope(kind: Kind, **how: Any) -> Any:
        return differentiate(lambda value: _number(kind.walk(value, **how)))(jnp.asarray(kind.at))

    return slope


def _difference(kind: Kind, **how: Any) -> Any:
    step = 1e-5
    ends = [_number(kind.walk(kind.at + shift, **how)) for shift in (step, -step)]
    return (ends[0] - ends[1]) / (2.0 * step)


def _jitted(kind: Kind, **how: Any) -> Any:
    return jax.jit(lambda value: kind.walk(value, **how).final)(kind.at)


def _batched(kind: Kind, **how: Any) -> Any:
    values = kind.at * jnp.array([1.0, 0.99])
    ends = jax.vmap(lambda value: kind.walk(value, **how).final)(values)
    return jax.tree.map(lambda leaf: leaf[0], ends)


ROWS: dict[str, tuple[Callable[..., Any], Callable[[Kind], dict[str, Any]], Callable[..., Any]]] = {
    'save="end"': (_end, lambda kind: {}, _end),
    "save=times": (_times, lambda kind: {}, _times),
    'save="steps", at times': (_steps, lambda kind: {}, _times),
    "save=HeelStrike() or At(…)": (_arrivals(lambda kind: kind.reset), lambda kind: {}, None),
    "save=MidStance()": (_arrivals(lambda kind: jb.MidStance()), lambda kind: {}, None),
    "save=Section(…)": (_arrivals(lambda kind: kind.section), lambda kind: {}, None),
    "footsteps=2": (_footsteps, lambda kind: {}, _footsteps),
    "extremes": (_extremes, lambda kind: {}, _extremes),
    "watch=()": (_end, lambda kind: {"watch": ()}, _end),
    "solver": (_end, lambda kind: {"solver": kind.solver}, _end),
    "dt": (_end, lambda kind: {"dt": kind.dt}, _end),
    "accuracy=1e-5": (_end, lambda kind: {"accuracy": 1e-5}, _end),
    "jit": (_jitted, lambda kind: {}, _end),
    "vmap": (_batched, lambda kind: {}, _end),
    "jacfwd": (_slope(jax.jacfwd), lambda kind: {}, _difference),
    "jacrev": (_slope(jax.jacrev), lambda kind: {}, _difference),
    'engine="xla"': (_end, lambda kind: {"engine": "xla"}, _end),
    'engine="xla", times': (_times, lambda kind: {"engine": "xla"}, _times),
    'engine="xla", HeelStrike() or At(…)': (
        _arrivals(lambda kind: kind.reset),
        lambda kind: {"engine": "xla"},
        None,
    ),
}  # fmt: skip
"""Of each row what is returned, by which options, and what it should be; None: the same."""


def cell_of(kind: Kind, name: str) -> float | str:
    """The largest difference from a tight walk, or the sentence that refuses it."""
    asked, how, truth = ROWS[name]
    try:
        returned = asked(kind, **how(kind))
    except jb.ArgumentError as error:
        return str(error)
    right = (truth or asked)(kind, accuracy="tight")
    gaps = jax.tree.map(lambda a, b: np.max(np.abs(np.asarray(a) - np.asarray(b))), returned, right)
    size = float(abs(right)) if name.startswith("jac") else 1.0
    return float(max(jax.tree.leaves(gaps))) / size


@experiment
def main(options: Options):
    """Fills the table; the quick one has three rows of the kinds that compile soonest."""
    chosen = kinds()
    names = options.sized([*ROWS], [*ROWS][:4])
    columns = options.sized([*chosen], ["compliant", "rigid"])
    cells = {
        kind: {name: cell_of(chosen[kind], name) for name in tqdm(names, desc=kind)}
        for kind in columns
    }
    notes: list[str] = []

    def written(value: float | str) -> str:
        if isinstance(value, float):
            return f"{value:.0e}"
        if value not in notes:
            notes.append(value)
        return f"[{notes.index(value) + 1}]"

    rows = [[f"`{name}`", *(written(cells[kind][name]) for kind in columns)] for name in names]
    table = markdown(["option", *columns], rows)
    text = [table, *(f"[{k}] {note}" for k, note in enumerate(notes, 1))]
    options.path("simulation_matrix.md").write_text("\n\n".join(text) + "\n")
    return {"cells": cells}


if __name__ == "__main__":
    main()
