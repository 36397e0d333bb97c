"""Derivatives of walks of nine mechanisms with respect to every parameter of their scenes.

Writes mechanism_derivatives.md: for each mechanism and way of ending the largest error at each
accuracy, relative to the largest entry of its column, and whose it is. Truths are central
differences of much finer walks at three steps; columns whose truth is not known to 1e-6 are
counted apart, unless the error is far above what is known. NaN: at this accuracy an event grazes.
"""

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from _experiment import Options, experiment
from _mechanisms import SIDES, Case, cases
from _quote_words import markdown
from tqdm import tqdm

import jaxbiped as jb

ACCURACIES = ("draft", "balanced", "tight")
ENDS: dict[str, dict[str, Any]] = {
    "a footstep": dict(footsteps=1, save="end"),
    "a time": dict(duration=0.3, save="end"),
    "heel strikes": dict(duration=0.7, save=jb.HeelStrike()),
}
KNOWN = 1e-6
"""How well a column must be known to be judged."""
STEP, LONGEST = 1e-5, 3e-3
"""Relative step of a difference where a column is the largest, and of the smallest columns."""


def with_stops(case: Case) -> Case:
    """Flat feet that also hit stops at the ankles, whose forces jump."""
    walker = case.scene.walker
    law = jb.laws.KelvinVoigt(K=200.0, D=0.5)
    stops = [jb.Stop(f"foot_{i}", upper=0.02, lower=-0.02, law=law) for i in SIDES]
    given = walker.arguments() | {"joints": (*walker.joints, *stops)}
    return case._replace(scene=dataclasses.replace(case.scene, walker=jb.Mechanism(**given)))


class Columns(NamedTuple):
    """Jacobians of times and states by relative changes of parameters, and how they are known."""

    names: tuple[str, ...]
    jacobians: dict[str, np.ndarray]
    truth: np.ndarray
    doubt: np.ndarray
    """Of each column, relative to its largest entry."""


def columns(case: Case, how: dict[str, Any]) -> Columns | None:
    """All parameters' columns, or None where the walk arrives nowhere."""
    values = jb.parameter_values(case.scene)
    names = tuple(name for name, value in values.items() if np.ndim(value) == 0 and value != 0.0)
    given = np.array([float(values[name]) for name in names])
    plain = jb.simulate(case.scene, case.guess, **how, accuracy="tight").arrivals
    count = 1 if plain is None else int(np.isfinite(np.asarray(plain.t)).sum())
    if not count:
        return None

    def moments(changes, **tolerance):
        moved = dict(zip(names, given * (1.0 + changes), strict=True))
        walk = jb.simulate(jb.with_parameters(case.scene, moved), case.guess, **tolerance, **how)
        found = walk if walk.arrivals is None else walk.arrivals
        return jnp.concatenate([leaf[:count] for leaf in (found.t, *jax.tree.leaves(found.state))])

    def jacobian(accuracy):
        return np.asarray(
            jax.jacfwd(lambda changes: moments(changes, accuracy=accuracy))(jnp.zeros(len(names)))
        )

    jacobians = {accuracy: jacobian(accuracy) for accuracy in ACCURACIES}
    sizes = np.abs(jacobians["tight"]).max(axis=0)
    steps = np.minimum(STEP * np.sqrt(np.nanmax(sizes) / np.maximum(sizes, 1e-30)), LONGEST)

    def differences(share):
        to = share * np.diag(steps)
        ends = jax.vmap(lambda changes: moments(changes, rtol=1e-12))(jnp.concatenate([to, -to]))
        ahead, behind = np.split(np.asarray(ends), 2)
        return ((ahead - behind) / (2.0 * share * steps[:, None])).T

    wide, middle, narrow = (differences(share) for share in (2.0, 1.0, 0.5))
    truth, other = (4.0 * narrow - middle) / 3.0, (4.0 * middle - wide) / 3.0
    return Columns(names, jacobians, truth, _relative(other, truth))


def _relative(found: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """The largest error of each column, relative to its largest entry; 0 where both are zero."""
    size, error = np.abs(truth).max(axis=0), np.abs(found - truth).max(axis=0)
    return np.divide(error, size, out=np.where(error == 0.0, 0.0, np.inf), where=size > 0.0)


def row(mechanism: str, ends: str, found: Columns) -> dict[str, Any]:
    """The worst columns at each accuracy, and how many could be judged."""
    told: dict[str, Any] = {"mechanism": mechanism, "ends": ends, "parameters": len(found.names)}
    for accuracy, jacobian in found.jacobians.items():
        error = _relative(jacobian, found.truth)
        judged = (found.doubt < KNOWN) | (error > np.maximum(5.0 * found.doubt, KNOWN))
        worst = int(np.argmax(np.where(judged, error, 0.0)))
        told |= {accuracy: float(error[worst]), f"{accuracy}: of": found.names[worst]}
        told[f"{accuracy}: judged"] = int(judged.sum())
    return told


@experiment
def main(options: Options):
    every = cases()
    every["flat feet, ankle stops"] = with_stops(every["flat feet"])
    chosen = options.sized(every, {"torso coupled": every["torso coupled"]})
    ends = options.sized(ENDS, {"a time": ENDS["a time"]})
    rows = []
    for name, case in tqdm(chosen.items(), desc="mechanisms"):
        found = {each: columns(case, how) for each, how in ends.items()}
        rows += [row(name, each, those) for each, those in found.items() if those is not None]
    lines = []
    for each in rows:
        worst = ((each[a], each[f"{a}: of"]) for a in ACCURACIES)
        cells = [f"{error:.0e} ({of})" if np.isfinite(error) else "NaN" for error, of in worst]
        judged = min(each[f"{a}: judged"] for a in ACCURACIES)
        count = f"{judged} of {each['parameters']}"
        lines.append([each["mechanism"], each["ends"], count, *cells])
    text = markdown(("mechanism", "ends or saved", "parameters", *ACCURACIES), lines)
    options.path("mechanism_derivatives.md").write_text(text + "\n")
    return {"rows": rows}


if __name__ == "__main__":
    main()
