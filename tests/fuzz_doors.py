"""Doors that a fuzz of features enters with a scene and a start, and what reads their results."""

import functools
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import jaxbiped as jb

Wants = Callable[[str], Any]
Door = Callable[[Any, Any, Wants], Any]


class WrongError(Exception):
    """A number that is not allowed; its kind, then words."""


def _finite(tree: Any, kind: str, wants: Wants | None = None) -> None:
    if wants is not None and wants("motor") == "NaN":
        return  # as the user's law wants it
    for leaf in jax.tree.leaves(tree):
        array = np.asarray(leaf)
        if array.dtype.kind in "fc" and not np.isfinite(array).all():
            raise WrongError(kind, str(tree)[:120])


def _field(scene: Any, state: Any, wants: Wants) -> None:
    if scene.redundant:
        state = jb.dynamics.redundant_state(scene, state)
        found = jb.dynamics.redundant_field(0.0, state, scene)
    elif scene.compliant:
        found = jb.dynamics.vector_field(0.0, state, scene)
    else:
        found = jb.dynamics.rolling_field(0.0, state, scene)
    _finite(found, "rates are not finite", wants)


def _energy(scene: Any, state: Any, wants: Wants) -> None:
    if not scene.compliant:
        _finite(jb.dynamics.whole_state(scene, state), "a state is not finite")
        return
    _finite(jb.dynamics.energies(scene, state), "energies are not finite", wants)
    _finite(jb.dynamics.powers(scene, state), "powers are not finite", wants)


def _impact(scene: Any, state: Any, wants: Wants) -> None:
    if not scene.compliant:
        _finite(jb.dynamics.impact(scene, state), "an impact is not finite", wants)
        _finite(jb.dynamics.rolling(scene, state), "a reaction is not finite", wants)
        jb.dynamics.push_off_work(scene, state)
    else:
        _finite(jb.dynamics.foot_forces(scene, state), "forces are not finite")
        _finite(jb.dynamics.feet(scene, state), "feet are not finite")


def _parameters(scene: Any, state: Any, wants: Wants) -> None:
    values = jb.parameter_values(scene)
    again = jb.with_parameters(scene, values)
    if jb.parameter_values(again) != values:
        raise WrongError("parameters change", str(values)[:80])
    jb.parameter_quantities(scene)


def _round_trip(value: Any) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "value.npz"
        jb.save(path, value)
        return jb.load(path)


def _words(value: Any) -> None:
    repr(value)
    getattr(value, "_repr_html_", lambda: None)()


def _kept(scene: Any, state: Any, wants: Wants) -> None:
    again = _round_trip({"scene": scene, "state": state})
    if not eqx.tree_equal(again, {"scene": scene, "state": state}):
        raise WrongError("what is loaded differs", "")


def _told(scene: Any, state: Any, wants: Wants) -> None:
    _words(scene)
    jb.plot.walker(scene)
    jb.measure.operation_counts(scene)


def _surfaces(scene: Any, state: Any, wants: Wants) -> None:
    jb.dynamics.exchange_legs(scene, state)
    if not scene.compliant:
        return
    jb.hybrid.switches(scene, state)
    for section in (jb.MidStance(), jb.HeelStrike()):
        section.value(scene, state)


FIELD: dict[str, Door] = {
    "field": _field,
    "energy": _energy,
    "impact": _impact,
    "parameters": _parameters,
    "surfaces": _surfaces,
    "save and load": _kept,
    "words": _told,
}


def _options(wants: Wants, *, rigid: bool) -> dict[str, Any]:
    saves: dict[str, Any] = {
        "end": "end",
        "steps": "steps",
        "strikes": jb.HeelStrike(),
        "times": np.array([0.0, 0.01, 0.02]),
        "midstance": jb.MidStance(),
        "no time": np.array([]),
    }
    ends = {
        "steps": dict(footsteps=2),
        "duration": dict(duration=0.05),
        "both": dict(footsteps=2, duration=0.05),
        "no time": dict(duration=0.0),
        "many": dict(footsteps=30),
    }[wants("ends")]
    options: dict[str, Any] = {**ends, "accuracy": wants("precision"), "max_solver_steps": 3000}
    if wants("save") != "usual":
        options["save"] = saves[wants("save")]
    if wants("save") == "times":
        options["duration"] = 0.05
    if wants("solver") != "usual":
        options["solver"] = wants("solver")
    return options


def _is_over(walk: Any, wants: Wants) -> None:
    """A walk that is told as one ended with numbers; none fails where it begins."""
    if np.ndim(walk.ending):
        for k in range(len(walk.ending)):
            _is_over(jax.tree.map(lambda leaf, k=k: leaf[k], walk), wants)
        return
    ending = jb.Ending(int(walk.ending))
    if ending is jb.Ending.SOLVER_FAILED:
        if int(walk.accepted) < 2 and wants("motor") != "NaN":
            raise WrongError("solver failed at the start", f"{walk.final}")
        return
    _finite(walk.final, f"'{ending}' with numbers that are not finite")
    _finite(walk.t[-1], f"'{ending}' at a time that is not finite")


def _walk(scene: Any, state: Any, wants: Wants) -> Any:
    how, options = wants("within"), _options(wants, rigid=not scene.compliant)
    simulate = functools.partial(jb.simulate, scene, **options)
    if how == "plain":
        walk = simulate(state)
    elif how == "jit":
        walk = jax.jit(lambda s: simulate(s))(state)
    elif how in ("vmap", "bad lane"):
        batch = jax.tree.map(lambda x: jnp.stack([jnp.asarray(x)] * 2), state)
        if how == "bad lane":
            bad = state._fields[-2]
            batch = batch._replace(**{bad: jnp.asarray(getattr(batch, bad)).at[1].set(jnp.nan)})
        walk = jax.vmap(lambda s: simulate(s))(batch)
        if how == "bad lane":
            if int(walk.ending[1]) != int(jb.Ending.SOLVER_FAILED):
                raise WrongError("a bad lane ends otherwise", str(walk.ending))
            walk = jax.tree.map(lambda leaf: leaf[:1], walk)
    else:
        mode = jax.jacfwd if how == "jacfwd" else jax.jacrev
        of = scene.minimal
        slope = lambda x: jb.simulate(
            scene.with_minimal(jb.with_parameters(of, {"slope": x})), state, **options
        ).t[-1]
        mode(slope)(jnp.asarray(of.ground.slope))
        return "differentiated"
    _is_over(walk, wants)
    return walk


def _read_walk(scene: Any, walk: Any) -> None:
    """Everything that takes a walk."""
    _words(walk)
    _round_trip(walk)
    _ = walk.outcome, walk.modes, walk.mode_durations, walk.final, walk.attempted
    readers: list[Callable[[], Any]] = [
        lambda: jb.footsteps(scene, walk),
        lambda: jb.measure.heel_strikes(scene, walk),
        lambda: jb.measure.energy_ledger(scene, walk),
        lambda: jb.measure.rigid_ledger(scene, walk),
        lambda: jb.measure.cost_of_transport(scene, walk),
        lambda: jb.measure.trajectory_dataset(scene, walk),
        lambda: walk.at(0.5 * float(walk.t[-1])),
        lambda: jb.plot.leg_angles(scene, walk),
        lambda: jb.plot.gait_strobe(scene, walk, count=3),
        lambda: jb.plot.view(scene, walk).html(),
        lambda: jb.plot.penetrations(scene, walk),
        lambda: jb.plot.contact_forces(scene, walk),
    ]
    wrong = []
    for reader in readers:
        try:
            reader()
        except (jb.ArgumentError, ValueError) as error:
            if "\n" in str(error) or not str(error).strip().endswith((".", "?", ")")):
                wrong.append(error)
        except Exception as error:
            wrong.append(error)
    if wrong:
        raise wrong[0]


def walk_and_read(scene: Any, state: Any, wants: Wants) -> Any:
    """Simulates, and reads the walk in all ways."""
    walk = _walk(scene, state, wants)
    if isinstance(walk, str):
        return walk
    if not np.ndim(walk.ending) and wants("within") == "plain":
        _read_walk(scene, walk)
        return str(walk.outcome)
    return "batch"


def _return(scene: Any, state: Any, wants: Wants) -> str:
    found = jb.return_map(scene, state, max_time=1.0)
    if int(found.code) == 0:
        _finite(found, "a return is not finite")
    return str(jb.Ending(int(found.code)))


def _same_shapes(one: Any, other: Any) -> None:
    shapes = [[np.shape(leaf) for leaf in jax.tree.leaves(tree)] for tree in (one, other)]
    if shapes[0] != shapes[1]:
        raise WrongError("a gait has other shapes under jit", str(shapes)[:150])


def _gait(scene: Any, state: Any, wants: Wants) -> Any:
    names = ("slope",) if wants("within") == "grad" else ()
    accuracy = wants("precision") if isinstance(wants("precision"), str) else "balanced"
    how = dict(parameters=names, radius_sensitivities=False, max_evaluations=12, accuracy=accuracy)
    section = {"midstance": jb.MidStance(), "strikes": jb.HeelStrike()}.get(wants("save"))
    gait = jb.find_gait(scene, state, section=section, **how)
    if gait.outcome is jb.gait.Search.FOUND:
        _finite(gait.measures, "a gait's measures are not finite")
        _finite(gait.multipliers, "a gait's multipliers are not finite")
    _words(gait)
    gait.to_dataset()
    _round_trip(gait)
    jb.plot.multipliers(gait) if gait.outcome is jb.gait.Search.FOUND else None
    if wants("within") in ("jit", "vmap"):
        again = jax.jit(lambda s: jb.find_gait(scene, s, section=section, **how))(state)
        _same_shapes(again, gait)
    return str(gait.outcome)


def _measured(scene: Any, state: Any, wants: Wants) -> Any:
    gait = jb.find_gait(scene, state, parameters=(), radius_sensitivities=False, max_evaluations=12)
    if gait.outcome is not jb.gait.Search.FOUND:
        return "no gait"
    slope = float(scene.ground.slope)
    if slope > 0.0:
        branch = jb.continue_gait(
            scene, "slope", bounds=(0.99 * slope, 1.01 * slope), guess=gait, max_points=4
        )
        _words(branch)
        branch.to_dataset()
    jb.gait_measures(scene, gait.measures.state)
    name = next((n for n in jb.parameter_names(scene) if n.endswith("mass")), None)
    if name is not None:
        value = float(jb.parameter_values(scene)[name])
        if value > 0.0:
            jb.optimise_gait(
                scene,
                vary={name: (0.99 * value, 1.01 * value)},
                maximise="speed",
                iterations=2,
                guess=gait,
            )
            seen = jb.identify.MeasuredGait({"period": (float(gait.measures.period), 1e-4)})
            jb.fit_gait(scene, (name,), seen)
    return str(gait.outcome)


def _labels(scene: Any, state: Any, wants: Wants) -> Any:
    label = jb.labelling(scene, guess=state, footsteps=5)
    starts = jax.tree.map(lambda x: np.stack([np.asarray(x, float)] * 3), state)
    found = label(starts)
    _words(found) if hasattr(found, "_repr_html_") else repr(found)
    return str(found.label)


DOORS: dict[str, dict[str, Door]] = {
    "field": FIELD,
    "walk": {"simulate": walk_and_read},
    "return": {"return_map": _return},
    "gait": {"find_gait": _gait},
    "labels": {"labelling": _labels},
    "search": {"search": _measured},
}
