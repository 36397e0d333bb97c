"""Playgrounds: pages with sliders that simulate in the page itself, without Python."""

import base64
import dataclasses
from collections.abc import Iterator
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import check_count, check_type
from jaxbiped._ending import Ending
from jaxbiped._types import JsonObject, Scalar
from jaxbiped.compiler import LANES, Program, Request, web_module
from jaxbiped.dynamics._contacts import contacts
from jaxbiped.dynamics._energy import Energies, energies, is_driven, powers
from jaxbiped.plot import style
from jaxbiped.plot._skeleton import body_motion, motion_names, names_by_foot, skeleton_of
from jaxbiped.plot.viewer._view import AbstractPage
from jaxbiped.scene._scene import Scene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.simulate._simulation import Simulation
from jaxbiped.solve._adaptive_program import Solve

STEPS = 8192
"""Attempted steps after which a page gives up."""


def recorded_names(scene: Scene) -> tuple[str, ...]:
    """What is recorded at the end of every accepted step."""
    structure = scene.mechanism.structure
    contact = names_by_foot(structure, "touches", "place")
    forces = names_by_foot(structure, "normal", "tangential")
    power = ("power",) if is_driven(scene) else ()
    return ("t", *motion_names(structure), *forces, *Energies._fields, *power, *contact)


def played_request(scene: Scene, state: Any, footsteps: int) -> Request:
    """What is asked of lanes: one walk of so many footsteps, recorded step by step."""
    run = Simulation.prepare(
        scene, state, footsteps=footsteps, max_solver_steps=STEPS, engine="lanes"
    )
    request = run.lane_request()
    assert request is not None
    program = _recording_program(request.program, type(state))
    return request._replace(program=program, room=STEPS)


def _recording_program(program: Program, kind: Any) -> Program:
    """The program with records for the viewer in place of the dense output."""
    steps = program.record
    assert steps is not None

    def record(solve: Solve, now: PyTree, due: Scalar) -> tuple[Scalar, list[Scalar]]:
        noted, (t, *values) = steps(solve, now, due)
        state = kind(*values[: len(kind._fields)])
        count = len(recorded_names(solve.scene)) - 1
        shown = jax.lax.cond(
            noted,
            lambda: _shown_numbers(solve.scene, state),
            lambda: [jnp.zeros_like(t)] * count,
        )
        return noted, [t, *shown]

    return dataclasses.replace(program, record=record)


def _shown_numbers(scene: Any, state: Any) -> list[Scalar]:
    motion, found = body_motion(scene, state), contacts(scene, state)
    named = [motion[name] for name in motion_names(scene.mechanism.structure)]
    zero = jnp.zeros_like(named[0])
    normal = [force.normal for force in found.forces]
    tangential = [
        zero if force.tangential is None else jnp.asarray(force.tangential)
        for force in found.forces
    ]
    touching = [jnp.where(touches, 1.0, 0.0) for touches in found.touching]
    places = [foot.x for foot in found.feet]
    driving = powers(scene, state).actuation
    power = () if driving is None else (driving,)
    rest = (*normal, *tangential, *energies(scene, state), *power, *touching, *places)
    return [*named, *(zero + value for value in rest)]


_OF_SCENE = (
    (".scene.ground.slope", "Slope", "rad", 0.02, False),
    (".scene.normal.K", "Stiffness K", "N/mⁿ", 1.0, True),
    (".scene.normal.c", "Damping c", "N s/m²", 1.0, True),
)
_OF_START = (("theta", "Angle", "rad", 0.15), ("omega", "Rate", "rad/s", 1.5))
"""Inputs that a page moves by up to so much, or with True by the tenth or ten times."""


def _sliders(scene: Scene, inputs: dict[str, float]) -> Iterator[JsonObject]:
    """Of the scene, and of the angles and rates of what swings at first: one of each pair."""
    structure = scene.mechanism.structure
    swinging = {pair[0] for pair in structure.pairs} or {structure.feet[0]}
    names = [structure.bodies[j] for j in structure.free if j in swinging]
    of_start = [
        (f".state.{word}_{name}", f"{words} of {style.label_of(name, 'leg')}", unit, reach, False)
        for name in names
        for word, words, unit, reach in _OF_START
    ]
    places = {leaf: place for place, leaf in enumerate(inputs)}
    for leaf, words, unit, reach, power in (*_OF_SCENE, *of_start):
        if leaf in inputs:
            middle = float(np.log10(inputs[leaf])) if power else inputs[leaf]
            yield {
                "leaf": leaf,
                "input": places[leaf],
                "words": words,
                "unit": unit,
                "least": middle - reach,
                "most": middle + reach,
                "value": middle,
                "power": power,
            }


@dataclasses.dataclass(frozen=True)
class Playground(AbstractPage):
    """A page that simulates walks by itself.

    Attributes:
        module: the compiled solve as WebAssembly.
        inputs: initial inputs of the solve, shape (n,).
        sliders: inputs that the page's sliders change, ready for JSON.
        scene: the walker.
        ending: position of the ending among the outputs of a solve.
    """

    _computes: ClassVar[bool] = True
    module: bytes
    inputs: np.ndarray
    sliders: tuple[JsonObject, ...]
    scene: Scene
    ending: int

    def sent(self) -> JsonObject:
        """Data of the page, ready for JSON."""
        mechanism = self.scene.mechanism
        return {
            "playground": {
                "module": base64.b64encode(self.module).decode("ascii"),
                "inputs": self.inputs.tolist(),
                "sliders": list(self.sliders),
                "recorded": recorded_names(self.scene),
                "room": STEPS,
                "ending": self.ending,
                "endings": {int(each): str(each) for each in Ending},
                "skeleton": skeleton_of(mechanism).numbers(),
                "weight": float(mechanism.total_mass) * float(self.scene.ground.g),
            },
            "colours": style.view_colours(),
        }

    def _frame(self) -> tuple[str, int]:
        return "A walk that simulates itself", 1000

    _repr_html_ = AbstractPage._in_frame


def playground(scene: Scene, state: Any, *, footsteps: int = 5) -> Playground:
    """A page that simulates walks, with sliders for the slope, stiffness, damping and the start.

    The lanes program of this scene is compiled to WebAssembly, which takes some seconds. Its steps
    are bit-for-bit those of `simulate` with the lanes engine.

    Args:
        scene: the walker. There are sliders only for the parameters that its laws of contact have.
        state: start of the walks.
        footsteps: number of footsteps after which a walk ends.

    Returns:
        The page: `save(path)` writes it, and a notebook shows it in a frame.

    Raises:
        ArgumentError: an argument has the wrong type.
        UnknownPrimitiveError: the scene contains an operation that lanes do not support.

    Examples:
        >>> import jaxbiped as jb
        >>> page = jb.plot.playground(jb.seed_scene(), jb.seed_state(), footsteps=3)
        >>> page.module[:4]
        b'\\x00asm'
    """
    scene = check_scene(scene, Scene)
    kind = scene.state_type
    check_type("state", state, kind)
    check_count("footsteps", footsteps)
    request = played_request(scene, state, footsteps)
    paths, _ = jtu.tree_flatten_with_path(request.inputs)
    inputs = {jtu.keystr(path): float(value) for path, value in paths}
    sliders = tuple(_sliders(scene, inputs))
    ending = 1 + len(kind._fields)
    module = web_module(LANES.compile(request).kernel.graph)
    return Playground(module, np.array(list(inputs.values())), sliders, scene, ending)
