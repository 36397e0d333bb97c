"""Derivatives of simulations through every ending, model, engine, mode and law of contact.

Writes event_derivatives.md: two tables whose cells are the largest error of a derivative, relative
to the largest entry, against central differences at "tight"; or the sentence that refuses it.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from _options import Options, parse
from tqdm import tqdm

import jaxbiped as jb

SEED, START = jb.seed_scene(), jb.seed_state()
RIGID = jb.ladder()["rigid"]
ACCURACIES = ("draft", "balanced", "tight")
ENGINES = ("lanes", "xla")


@dataclasses.dataclass(frozen=True)
class How:
    """How a simulation is computed and differentiated."""

    accuracy: str
    engine: str
    forward: bool = True


Simulated = Callable[[Any, How], Any]
"""Numbers of a simulation by what is moved, and how."""


@dataclasses.dataclass(frozen=True)
class Case:
    """A simulation, what of it is moved and how far for a difference."""

    model: str
    ends: str
    run: Simulated
    at: float
    step: float = 1e-4
    engines: tuple[str, ...] = ENGINES


# ruff: noqa: D102
class Ball(jb.gait.AbstractSystem):
    """A ball (y, v) in air with linear drag, which a paddle returns: v becomes 1 − 0.8 v."""

    def vector_field(self, t: Any, y: Any, args: Any) -> Any:
        return y[1], -9.8 - args * y[1]

    def switches(self, args: Any, y: Any) -> Any:
        return ()

    def ending(self, args: Any, y: Any) -> Any:
        return jnp.asarray(0)

    def load(self, args: Any, y: Any) -> Any:
        return None

    def reset_map(self, args: Any, y: Any) -> Any:
        return y[0], 1.0 - 0.8 * y[1]


def _slips(name: str) -> Any:
    """The friction law of a name with the seed's parameters."""
    seed = SEED.friction
    numbers = {each: getattr(seed, each) for each in ("mu_static", "mu_kinetic", "v0", "xi")}
    return jb.laws.friction_law_like(name, **numbers)


def _moments(found: Any, count: int | None = None) -> Any:
    """Times and states of a walk or of its first arrivals, one behind the other."""
    at = (found.t, found.state.hip_x, found.state.theta_1, found.state.omega_1)
    return jnp.concatenate([leaf[:count] for leaf in at])


def _walk(scene: Any, start: jb.State, **how: Any) -> Simulated:
    """Times and states of a walk by the rate of the swing leg."""

    def run(rate: Any, by: How) -> Any:
        state, given = start._replace(omega_1=rate), {"save": "end"} | how
        walk = jb.simulate(scene, state, accuracy=by.accuracy, engine=by.engine, **given)
        return _moments(walk) if walk.arrivals is None else _moments(walk.arrivals, 2)

    return run


def _rolls(start: Any, **how: Any) -> Simulated:
    """Times and states of a rigid walk by the rate of the swing leg."""

    def run(rate: Any, by: How) -> Any:
        state, strikes = start._replace(omega_1=rate), how.get("max_arrivals", 0)
        walk = jb.rigid_walk(RIGID, state, accuracy=by.accuracy, engine=by.engine, **how)
        return _moments(walk.arrivals, strikes) if strikes else _moments(walk)

    return run


def _returns(args: Any, state_at: Callable[[Any], Any], **how: Any) -> Simulated:
    """Time and state of a return by a component of the start."""

    def run(x: Any, by: How) -> Any:
        accuracy = "balanced" if by.accuracy == "draft" else by.accuracy
        gradient = jb.Forward() if by.forward else jb.Reverse()
        given = {"accuracy": accuracy, "engine": by.engine, "gradient": gradient} | how
        found = jb.return_map(args, state_at(x), **given)
        return jnp.stack([found.time, *jax.tree.leaves(found.state)])

    return run


def _gait(slope: Any, by: How) -> Any:
    """Measures of a gait by the slope."""
    gait = jb.gait_measures(jb.seed_scene(slope=slope), accuracy=by.accuracy, engine=by.engine)
    return jnp.stack([gait.period, gait.step_length, gait.state.theta_1, gait.state.omega_1])


def _swing(angle: Any, by: How) -> Any:
    """Angle and rate of a leg that swings from a pin, after a second, by its first angle."""
    body, joint = jb.constraints.Body(1.0, 0.0096), jb.constraints.Joint((0.0, 0.1), (0.0, 0.0), 0)
    linkage = jb.constraints.Linkage((body,), (joint,))
    scene = jb.LinkageScene(linkage, jb.constraints.Baumgarte())
    zero = jnp.zeros_like(angle)
    place = (0.1 * jnp.sin(angle), -0.1 * jnp.cos(angle), angle)
    start = jb.dynamics.LinkageState(place, (zero, zero, zero))
    adjoint = diffrax.ForwardMode() if by.forward else None
    given = {"times": jnp.array([1.0]), "accuracy": by.accuracy, "adjoint": adjoint}
    found = jb.swing(scene, start, **given)
    return jnp.stack([found.state.q[2][-1], found.state.v[2][-1]])


def cases() -> list[Case]:
    """Every model with every way in which it ends or saves."""
    held = dataclasses.replace(SEED, clearance=jb.laws.AlwaysTouching())
    bristles = dataclasses.replace(SEED, friction=_slips("lugre"))
    back = START._replace(omega_2=-1.3912, theta_1=-0.0072, hip_vx=0.104)
    steep = jb.seed_scene(slope=0.06)
    stop = START._replace(omega_2=-1.3137, theta_1=-0.4124, hip_vx=0.3559)
    trip = START._replace(omega_2=-0.2945, theta_1=-0.1838, hip_vx=0.7326)
    rigid = jb.dynamics.rigid_state(START)
    hinged = jb.RedundantScene(SEED, "baumgarte")
    times, strikes = jnp.array([0.2, 0.5, 0.9]), jb.HeelStrike()
    rate = float(START.omega_1)
    down = jb.Section(lambda args, y: -y[0])
    still = jb.dynamics.BristleState(*START, 0.0, 0.0)

    def started(like: Any) -> Callable[[Any], Any]:
        return lambda rate: like._replace(omega_1=rate)

    return [
        Case("compliant", "duration", _walk(SEED, START, duration=0.9), rate),
        Case("compliant", "footsteps", _walk(SEED, START, footsteps=2), rate),
        Case("compliant", "fell forward", _walk(steep, START, duration=9.0), rate),
        Case("compliant", "fell back", _walk(held, back, duration=9.0), 2.707),
        Case("compliant", "stopped", _walk(SEED, stop, duration=9.0), 0.5139),
        Case("compliant", "stumbled", _walk(SEED, trip, duration=9.0), -1.1841),
        Case("compliant", "saved times", _walk(SEED, START, duration=0.9, save=times), rate),
        Case("compliant", "arrivals", _walk(SEED, START, duration=0.9, save=strikes), rate),
        Case("compliant", "every step", _walk(SEED, START, duration=0.1, save="steps"), rate),
        Case("compliant", "return map", _returns(SEED, started(START)), rate),
        Case("compliant", "gait", _gait, 0.02),
        Case("bristle", "duration", _walk(bristles, START, duration=0.9), rate),
        Case("bristle", "footsteps", _walk(bristles, START, footsteps=2), rate),
        Case("bristle", "arrivals", _walk(bristles, START, duration=0.9, save=strikes), rate),
        Case("bristle", "return map", _returns(bristles, started(still)), rate),
        Case("rigid", "duration", _rolls(rigid, duration=0.9), rate),
        Case("rigid", "footsteps", _rolls(rigid, footsteps=2), rate),
        Case("rigid", "arrivals", _rolls(rigid, duration=0.9, max_arrivals=2), rate),
        Case("rigid", "fell forward", _rolls(rigid._replace(omega_2=-1.9), duration=9.0), rate),
        Case("rigid", "fell back", _rolls(rigid, duration=9.0), 1.5),
        Case("rigid", "return map", _returns(RIGID, started(rigid)), rate),
        Case("redundant", "footsteps", _walk(hinged, START, footsteps=1), rate),
        Case("redundant", "return map", _returns(hinged, started(START)), rate),
        Case("linkage", "swing", _swing, 0.5, engines=("xla",)),
        Case("own system", "return map", _returns(0.3, _thrown, section=down, system=Ball()), 3.0),
    ]


def _thrown(speed: Any) -> tuple[Any, Any]:
    return jnp.zeros_like(speed), speed


def _in_a_batch(function: Any) -> Any:
    """The Jacobian of the first of two equal lanes of a compiled batch."""
    return lambda x: jax.jit(jax.vmap(jax.jacfwd(function)))(jnp.stack([x, x]))[0]


MODES: dict[str, tuple[bool, Any]] = {
    "jacfwd": (True, jax.jacfwd),
    "jacrev": (False, jax.jacrev),
    "jit(vmap(jacfwd))": (True, _in_a_batch),
    "hessian": (False, jax.hessian),
}
"""Whether a gradient mode that must be chosen is the forward one, and what differentiates."""


def error_of(case: Case, mode: str, accuracy: str, engine: str) -> float | str:
    """The relative error of a derivative, or what refuses it."""
    if engine not in case.engines:
        return f"A {case.model}'s {case.ends} has no `engine`: it runs through diffrax."
    forward, differs = MODES[mode]
    how = How(accuracy, engine, forward)
    try:
        told = np.asarray(differs(lambda x: case.run(x, how))(jnp.asarray(case.at)))
    except jb.ArgumentError as error:
        return str(error)
    fine = How("tight", case.engines[0])

    def at(shift: float) -> Any:
        return np.asarray(case.run(jnp.asarray(case.at + shift), fine))

    def difference(step: float) -> Any:
        return (at(step) - at(-step)) / (2.0 * step)

    if mode == "hessian":
        step = 100.0 * case.step
        right = (at(step) - 2.0 * at(0.0) + at(-step)) / step**2
    else:
        right = (4.0 * difference(0.5 * case.step) - difference(case.step)) / 3.0
    return float(np.max(np.abs(told - right)) / np.max(np.abs(right)))


def law_cases(options: Options) -> list[Case]:
    """One heel strike and a lift-off by each law of contact."""
    found = []
    for slips in ("stribeck",) if options.quick else jb.laws.FRICTION_LAWS:
        for name in ("kelvin-voigt", "tsuji") if options.quick else jb.laws.NORMAL_LAWS:
            law = jb.laws.normal_law_like(name, K=1e6, c=1e7, n=1.5, mass=2.0)
            scene = dataclasses.replace(SEED, normal=law, friction=_slips(slips))
            run = _walk(scene, START, duration=0.6)
            found.append(Case(slips, name, run, float(START.omega_1)))
    return found


def main() -> None:
    options = parse(__doc__ or "")
    notes: list[str] = []

    def cell(value: float | str) -> str:
        if isinstance(value, float):
            return f"{value:.0e}"
        if value not in notes:
            notes.append(value)
        return f"[{notes.index(value) + 1}]"

    engines = ENGINES[:1] if options.quick else ENGINES
    modes = tuple(MODES)[:2] if options.quick else tuple(MODES)
    endings: list[dict[str, Any]] = []
    for case in tqdm(cases()[:9:2] if options.quick else cases(), desc="endings"):
        cells = {f"{e}, {m}": error_of(case, m, "balanced", e) for e in engines for m in modes}
        endings.append({"model": case.model, "ends": case.ends, "errors": cells})
    rows = [[each["model"], each["ends"], *map(cell, each["errors"].values())] for each in endings]
    tables = [_table(["model", "ends", *endings[0]["errors"]], rows)]
    laws: dict[str, dict[str, list[float | str]]] = {}
    for case in tqdm(law_cases(options), desc="laws"):
        errors = [error_of(case, "jacfwd", accuracy, "lanes") for accuracy in ACCURACIES]
        laws.setdefault(case.model, {})[case.ends] = errors
    rows = [
        [name, *(" / ".join(map(cell, errors)) for errors in row.values())]
        for name, row in laws.items()
    ]
    tables += [_table([" / ".join(ACCURACIES), *next(iter(laws.values()))], rows)]
    tables += [f"[{k}] {note}" for k, note in enumerate(notes, 1)]
    options.path("event_derivatives.md").write_text("\n\n".join(tables) + "\n")
    for table in tables:
        options.say(table)
    options.finish({"endings": endings, "laws": laws})


def _table(heads: list[str], rows: list[list[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


if __name__ == "__main__":
    main()
