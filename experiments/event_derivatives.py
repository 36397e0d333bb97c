"""Derivatives of simulations through every ending, model, engine, mode and law of contact.

Writes event_derivatives.md: two tables whose cells are the largest error of a derivative, relative
to the largest entry, against central differences at "tight"; or the sentence that refuses it.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from _options import Options, parse
from tqdm import tqdm

import jaxbiped as jb

SEED, START = jb.seed_scene(), jb.seed_state()
RIGID = jb.ladder()["rigid"]
MODES = {"jacfwd": jax.jacfwd, "jacrev": jax.jacrev, "hessian": jax.hessian}
NORMAL = ("ristow-schafer", "kelvin-voigt", "hunt-crossley", "tsuji", "kuwabara-kono", "hertz")
FRICTION = ("stribeck", "coulomb", "andersson", "brown-mcphee", "viscous")
ACCURACIES = ("draft", "balanced", "tight")
Simulated = Callable[[Any, str, str], Any]
"""Numbers of a simulation by what is moved, the accuracy and the engine."""


@dataclasses.dataclass(frozen=True)
class Case:
    """A simulation, what of it is moved and how far for a difference."""

    model: str
    ends: str
    run: Simulated
    at: float
    step: float = 1e-5


def _slips(name: str) -> Any:
    """The friction law of a name with the seed's parameters."""
    seed = SEED.friction
    numbers = {each: getattr(seed, each) for each in ("mu_static", "mu_kinetic", "v0", "xi")}
    return jb.laws.friction_law_like(name, **numbers)


def _walk(scene: Any, start: jb.State, **how: Any) -> Simulated:
    """Time and end of a walk by the rate of the swing leg."""

    def run(rate: Any, accuracy: str, engine: str) -> Any:
        state = start._replace(omega_1=rate)
        walk = jb.simulate(
            scene, state, accuracy=accuracy, engine=engine, **({"save": "end"} | how)
        )
        if walk.arrivals is not None:
            count = 2
            return jnp.stack([*walk.arrivals.t[:count], *walk.arrivals.state.theta_1[:count]])
        return jnp.stack([*walk.t, *walk.state.hip_x, *walk.state.theta_1, *walk.state.omega_1])

    return run


def _rolls(start: Any, **how: Any) -> Simulated:
    """Time and end of a rigid walk by the rate of the swing leg."""

    def run(rate: Any, accuracy: str, engine: str) -> Any:
        state = start._replace(omega_1=rate)
        walk = jb.rigid_walk(RIGID, state, accuracy=accuracy, engine=engine, **how)
        return jnp.stack([*walk.t, *walk.state.hip_x, *walk.state.theta_1, *walk.state.omega_1])

    return run


def cases() -> list[Case]:
    """Every model with every way in which it ends or saves."""
    held = dataclasses.replace(SEED, clearance=jb.laws.AlwaysTouching())
    bristles = dataclasses.replace(SEED, friction=_slips("lugre"))
    back = START._replace(omega_2=-1.3912, theta_1=-0.0072, hip_vx=0.104)
    steep = jb.seed_scene(slope=0.06)
    stop = START._replace(omega_2=-1.3137, theta_1=-0.4124, hip_vx=0.3559)
    trip = START._replace(omega_2=-0.2945, theta_1=-0.1838, hip_vx=0.7326)
    rigid = jb.dynamics.rigid_state(START)
    times, strikes = jnp.array([0.2, 0.5, 0.9]), jb.HeelStrike()
    rate = float(START.omega_1)
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
        Case("bristle", "duration", _walk(bristles, START, duration=0.9), rate),
        Case("bristle", "footsteps", _walk(bristles, START, footsteps=2), rate),
        Case("rigid", "duration", _rolls(rigid, duration=0.9), rate),
        Case("rigid", "footsteps", _rolls(rigid, footsteps=2), rate),
        Case("rigid", "fell forward", _rolls(rigid._replace(omega_2=-1.9), duration=9.0), rate),
        Case("rigid", "fell back", _rolls(rigid, duration=9.0), 1.5),
    ]


def error_of(case: Case, mode: str, accuracy: str, engine: str) -> float | str:
    """The relative error of a derivative, or what refuses it."""
    differs = MODES[mode]
    try:
        told = np.asarray(differs(lambda x: case.run(x, accuracy, engine))(jnp.asarray(case.at)))
    except jb.ArgumentError as error:
        return str(error)
    ends = [np.asarray(case.run(case.at + s * case.step, "tight", "lanes")) for s in (1, -1)]
    right = (ends[0] - ends[1]) / (2.0 * case.step)
    return float(np.max(np.abs(told - right)) / np.max(np.abs(right)))


def law_cases(options: Options) -> list[Case]:
    """One heel strike and a lift-off by each law of contact."""
    normal, friction = (NORMAL[1:4], FRICTION[:1]) if options.quick else (NORMAL, FRICTION)
    found = []
    for name in normal:
        law = jb.laws.normal_law_like(name, K=1e6, c=1e7, n=1.5, mass=2.0)
        for slips in friction:
            scene = dataclasses.replace(SEED, normal=law, friction=_slips(slips))
            run = _walk(scene, START, duration=0.6)
            found.append(Case(name, slips, run, float(START.omega_1), 1e-4))
    return found


def main() -> None:
    options = parse(__doc__ or "")
    rows: list[dict[str, Any]] = []
    engines = ("lanes",) if options.quick else ("lanes", "xla")
    modes = ("jacfwd", "jacrev") if options.quick else tuple(MODES)
    every = cases()[:9:2] if options.quick else cases()
    for case in tqdm(every, desc="endings"):
        cells = {f"{e}, {m}": error_of(case, m, "balanced", e) for e in engines for m in modes}
        rows.append({"model": case.model, "ends": case.ends, "errors": cells})
    laws: list[dict[str, Any]] = []
    for case in tqdm(law_cases(options), desc="laws"):
        cells = {a: error_of(case, "jacfwd", a, "lanes") for a in ACCURACIES}
        laws.append({"normal": case.model, "friction": case.ends, "errors": cells})
    tables = [_table(("model", "ends"), rows), _table(("normal", "friction"), laws)]
    options.path("event_derivatives.md").write_text("\n\n".join(tables) + "\n")
    for table in tables:
        options.say(table)
    options.finish({"endings": rows, "laws": laws})


def _table(names: tuple[str, str], rows: list[dict[str, Any]]) -> str:
    heads = [*names, *rows[0]["errors"]]
    notes: list[str] = []

    def cell(value: float | str) -> str:
        if isinstance(value, float):
            return f"{value:.0e}"
        if value not in notes:
            notes.append(value)
        return f"refused [{notes.index(value) + 1}]"

    lines = [f"| {' | '.join(heads)} |", "|" + "---|" * len(heads)]
    for row in rows:
        cells = [row[name] for name in names] + [cell(each) for each in row["errors"].values()]
        lines.append(f"| {' | '.join(cells)} |")
    lines += [f"\n[{k}] {note}" for k, note in enumerate(notes, 1)]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
