"""Derivatives of simulations through every ending, model, engine, mode and law of contact.

Writes event_derivatives.md: two tables whose cells are the largest error of a derivative, relative
to the largest entry, against central differences of much finer solves; or the sentence that
refuses it.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from _experiment import Options, experiment
from _quote_words import markdown
from _scenes import rigid_seed, seed_with
from tqdm import tqdm

import jaxbiped as jb

SEED, START = jb.seed_scene(), jb.seed_state()
RIGID = rigid_seed()
ACCURACIES = ("draft", "balanced", "tight")
ENGINES = ("lanes", "xla")


class How(NamedTuple):
    """How a simulation is computed and differentiated; an accuracy "finest" is that of truths."""

    accuracy: str
    engine: str
    forward: bool = True

    @property
    def tolerance(self) -> dict[str, Any]:
        """Of a simulation: at "tight" its error over the step of a difference would be seen."""
        return {"rtol": 1e-12} if self.accuracy == "finest" else {"accuracy": self.accuracy}

    @property
    def gait_accuracy(self) -> str:
        """Of a return map or a gait, for which names alone are allowed."""
        return {"draft": "balanced", "finest": "tight"}.get(self.accuracy, self.accuracy)


class Case(NamedTuple):
    """A simulation, `run(moved, how)`, what of it is moved, how far, by which engine in truth."""

    model: str
    ends: str
    run: Callable[[Any, How], Any]
    at: float
    step: float = 1e-4
    truth: str = "lanes"


# ruff: noqa: D102
class Ball(jb.hybrid.AbstractSystem):
    """A ball (y, v) in air with linear drag, which a paddle returns: v becomes 1 − 0.8 v."""

    def vector_field(self, t, y, args):
        return y[1], -9.8 - args * y[1]

    def switches(self, args, y):
        return ()

    def ending(self, args, y):
        return jnp.asarray(0)

    def load(self, args, y):
        return None

    def reset_map(self, args, y):
        return y[0], 1.0 - 0.8 * y[1]


def _moments(found, count=None):
    """Times and states of a walk or of its first arrivals, one behind the other."""
    names = ("hip_x", "x_1", "theta_1", "omega_1")  # one of the first two, by its coordinates
    state = [leaf for name, leaf in found.state._asdict().items() if name in names]
    return jnp.concatenate([leaf[:count] for leaf in (found.t, *state)])


def _walk(scene, start, **how):
    """Times and states of a walk by the rate of the swing leg."""

    def run(rate, by):
        state, given = start._replace(omega_1=rate), {"save": "end"} | how
        walk = jb.simulate(scene, state, engine=by.engine, **by.tolerance, **given)
        struck = isinstance(given["save"], jb.HeelStrike)
        return _moments(walk.arrivals, 2) if struck else _moments(walk)

    return run


def _returns(args, start, **how):
    """Time and state of a return by a component of the start."""

    def run(x, by):
        gradient = jb.gait.Forward() if by.forward else jb.gait.Reverse()
        given = {"accuracy": by.gait_accuracy, "engine": by.engine, "gradient": gradient} | how
        state = start._replace(omega_1=x) if start else (jnp.zeros_like(x), x)
        found = jb.return_map(args, state, **given)
        return jnp.stack([found.time, *jax.tree.leaves(found.state)])

    return run


def _gait(slope, by):
    """Measures of a gait by the slope."""
    gait = jb.gait_measures(jb.seed_scene(slope=slope), accuracy=by.gait_accuracy, engine=by.engine)
    return jnp.stack([gait.period, gait.step_length, gait.state.theta_1, gait.state.omega_1])


def _swing(angle, by):
    """Angle and rate of a leg that swings from a pin, after a second, by its first angle."""
    body, joint = (
        jb.constraints.LinkBody(1.0, 0.0096),
        jb.constraints.Pin((0.0, 0.1), (0.0, 0.0), 0),
    )
    linkage = jb.constraints.Linkage((body,), (joint,))
    scene = jb.dynamics.LinkageScene(linkage, jb.constraints.Baumgarte())
    zero = jnp.zeros_like(angle)
    place = (0.1 * jnp.sin(angle), -0.1 * jnp.cos(angle), angle)
    start = jb.dynamics.LinkageState(place, (zero, zero, zero))
    found = jb.simulate(scene, start, save=np.array([1.0]), engine=by.engine, **by.tolerance)
    return jnp.stack([found.state.q[2][-1], found.state.v[2][-1]])


def cases():
    """Every model with every way in which it ends or saves."""
    held = dataclasses.replace(SEED, clearance=jb.laws.AlwaysTouching())
    bristles = seed_with(friction="lugre")
    back = START._replace(omega_2=-1.3912, theta_1=-0.0072, hip_vx=0.104)
    steep = jb.seed_scene(slope=0.06)
    stop = START._replace(omega_2=-1.3137, theta_1=-0.4124, hip_vx=0.3559)
    trip = START._replace(omega_2=-0.2945, theta_1=-0.1838, hip_vx=0.7326)
    rigid = jb.dynamics.rigid_state(START)
    fast = rigid._replace(omega_2=-1.9)
    hinged = jb.RedundantScene(SEED, "baumgarte")
    times, strikes = jnp.array([0.2, 0.5, 0.9]), jb.HeelStrike()
    rate = float(START.omega_1)
    thrown = dict(section=jb.Section(lambda args, y: -y[0]), system=Ball())
    still = jb.dynamics.BristleState(*START, 0.0, 0.0)
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
        Case("compliant", "return map", _returns(SEED, START), rate),
        Case("compliant", "gait", _gait, 0.02),
        Case("bristle", "duration", _walk(bristles, START, duration=0.9), rate),
        Case("bristle", "footsteps", _walk(bristles, START, footsteps=2), rate),
        Case("bristle", "arrivals", _walk(bristles, START, duration=0.9, save=strikes), rate),
        Case("bristle", "return map", _returns(bristles, still), rate),
        Case("rigid", "duration", _walk(RIGID, rigid, duration=0.9), rate),
        Case("rigid", "footsteps", _walk(RIGID, rigid, footsteps=2), rate),
        Case("rigid", "arrivals", _walk(RIGID, rigid, duration=0.9, save=strikes), rate),
        Case("rigid", "fell forward", _walk(RIGID, fast, duration=9.0), rate),
        Case("rigid", "fell back", _walk(RIGID, rigid, duration=9.0), 1.5),
        Case("rigid", "return map", _returns(RIGID, rigid), rate),
        Case("redundant", "footsteps", _walk(hinged, START, footsteps=1), rate),
        Case("redundant", "return map", _returns(hinged, START), rate, truth="xla"),
        Case("linkage", "saved times", _swing, 0.5),
        Case("own system", "return map", _returns(0.3, None, **thrown), 3.0),
    ]


def _in_a_batch(function):
    """The Jacobian of the first of two equal lanes of a compiled batch."""
    return lambda x: jax.jit(jax.vmap(jax.jacfwd(function)))(jnp.stack([x, x]))[0]


MODES = {
    "jacfwd": (True, jax.jacfwd),
    "jacrev": (False, jax.jacrev),
    "jit(vmap(jacfwd))": (True, _in_a_batch),
    "hessian": (False, jax.hessian),
}
"""Whether a gradient mode that must be chosen is the forward one, and what differentiates."""


def error_of(case, mode, accuracy, engine):
    """The relative error of a derivative, or what refuses it."""
    forward, differs = MODES[mode]
    how = How(accuracy, engine, forward)
    try:
        told = np.asarray(differs(lambda x: case.run(x, how))(jnp.asarray(case.at)))
    except jb.ArgumentError as error:
        return str(error)
    fine = How("finest", case.truth)

    def at(shift):
        return np.asarray(case.run(jnp.asarray(case.at + shift), fine))

    def difference(step):
        return (at(step) - at(-step)) / (2.0 * step)

    if mode == "hessian":
        step = 100.0 * case.step
        right = (at(step) - 2.0 * at(0.0) + at(-step)) / step**2
    else:
        right = (4.0 * difference(0.5 * case.step) - difference(case.step)) / 3.0
    return float(np.max(np.abs(told - right)) / np.max(np.abs(right)))


def law_cases(options):
    """One heel strike and a lift-off by each law of contact."""
    for slips in options.sized(jb.laws.FRICTION_LAWS, ("stribeck",)):
        for name in options.sized(jb.laws.NORMAL_LAWS, ("kelvin-voigt", "tsuji")):
            run = _walk(seed_with(name, slips), START, duration=0.6)
            # So far that the walks' own errors, where a force jumps, are not seen at "tight".
            yield Case(slips, name, run, float(START.omega_1), step=1e-3)


@experiment
def main(options: Options):
    engines, modes = options.sized(ENGINES, ENGINES[:1]), options.sized([*MODES], [*MODES][:2])
    endings = []
    for case in tqdm(options.sized(cases(), cases()[:9:2]), desc="endings"):
        cells = {f"{e}, {m}": error_of(case, m, "balanced", e) for e in engines for m in modes}
        endings.append({"model": case.model, "ends": case.ends, "errors": cells})
    laws = {}
    for case in tqdm(law_cases(options), desc="laws"):
        errors = [error_of(case, "jacfwd", accuracy, "lanes") for accuracy in ACCURACIES]
        laws.setdefault(case.model, {})[case.ends] = errors
    text = "\n\n".join(_tables(endings, laws)) + "\n"
    options.path("event_derivatives.md").write_text(text)
    return {"endings": endings, "laws": laws}


def _tables(endings, laws):
    """Both tables for a page, and the sentences that cells refer to."""
    notes = []

    def cell(value):
        if isinstance(value, float):
            return f"{value:.0e}"
        if value not in notes:
            notes.append(value)
        return f"[{notes.index(value) + 1}]"

    rows = [[each["model"], each["ends"], *map(cell, each["errors"].values())] for each in endings]
    yield markdown(["model", "ends", *endings[0]["errors"]], rows)
    rows = [
        [name, *(" / ".join(map(cell, each)) for each in found.values())]
        for name, found in laws.items()
    ]
    yield markdown([" / ".join(ACCURACIES), *next(iter(laws.values()))], rows)
    yield from (f"[{k}] {note}" for k, note in enumerate(notes, 1))


if __name__ == "__main__":
    main()
