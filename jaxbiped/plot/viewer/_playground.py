"""Playgrounds: pages whose sliders simulate, in the page itself and without Python."""

import base64
import dataclasses
from typing import Any, NamedTuple

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
from jaxbiped.dynamics._energy import Energies, energies
from jaxbiped.dynamics._state import State
from jaxbiped.plot.style import view_colours
from jaxbiped.plot.viewer._page import AbstractPage, frame_of, page_of
from jaxbiped.plot.viewer._recording import FORCES
from jaxbiped.scene._scene import Scene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.simulate._simulation import Simulation
from jaxbiped.solve._adaptive_program import Solve

STEPS = 8192
"""Attempted steps after which a page gives up."""
RECORDED = (
    "t",
    *State._fields,
    *FORCES,
    *Energies._fields,
    "touches_1",
    "touches_2",
    "place_1",
    "place_2",
)
"""What is recorded at the end of every accepted step."""
ENDING = 1 + len(State._fields)
"""The place among a solve's outputs of how it ended."""


def played_request(scene: Scene, state: State, footsteps: int) -> Request:
    """What is asked of lanes: one walk of so many footsteps, `RECORDED` step by step."""
    run = Simulation.prepare(
        scene, state, footsteps=footsteps, max_solver_steps=STEPS, engine="lanes"
    )
    request = run.lane_request()
    assert request is not None
    return request._replace(program=_recording_program(request.program), room=STEPS)


def played_module(request: Request) -> bytes:
    """Its program as a module of WebAssembly."""
    return web_module(LANES.compile(request).kernel.graph)


def _recording_program(program: Program) -> Program:
    """The program with records for the viewer in place of the dense output."""
    steps = program.record
    assert steps is not None

    def record(solve: Solve, now: PyTree, due: Scalar) -> tuple[Scalar, list[Scalar]]:
        noted, (t, *values) = steps(solve, now, due)
        state = State(*values[: len(State._fields)])
        shown = jax.lax.cond(
            noted,
            lambda: _shown_numbers(solve.scene, state),
            lambda: [jnp.zeros_like(t)] * (len(RECORDED) - 1 - len(state)),
        )
        return noted, [t, *state, *shown]

    return dataclasses.replace(program, record=record)


def _shown_numbers(scene: Any, state: State) -> list[Scalar]:
    found, energy = contacts(scene, state), energies(scene, state)
    zero = jnp.zeros_like(state.hip_x)
    normal = [force.normal for force in found.forces]
    tangential = [
        zero if force.tangential is None else jnp.asarray(force.tangential)
        for force in found.forces
    ]
    touching = [jnp.where(touches, 1.0, 0.0) for touches in found.touching]
    places = [foot.x for foot in found.feet]
    return [zero + value for value in (*normal, *tangential, *energy, *touching, *places)]


class _Slider(NamedTuple):
    """An input that a page moves: by up to `reach`, a `factor` by 10^`reach` times."""

    leaf: str
    words: str
    unit: str
    reach: float
    factor: bool = False


_SLIDERS = (
    _Slider(".scene.ground.slope", "Slope", "rad", 0.02),
    _Slider(".scene.normal.K", "Stiffness K", "N/mⁿ", 1.0, factor=True),
    _Slider(".scene.normal.c", "Damping c", "N s/m²", 1.0, factor=True),
    _Slider(".state.theta_1", "Swing leg angle", "rad", 0.15),
    _Slider(".state.omega_1", "Swing leg rate", "rad/s", 1.5),
)


@dataclasses.dataclass(frozen=True)
class Playground(AbstractPage):
    """A page that simulates itself.

    Attributes:
        module: the solve as WebAssembly.
        inputs: its numbers as the page begins, shape (n,).
        sliders: which of them the page moves, ready for JSON.
        scene: the walker.
    """

    module: bytes
    inputs: np.ndarray
    sliders: tuple[JsonObject, ...]
    scene: Scene

    def sent(self) -> JsonObject:
        """What the page is given, ready for JSON."""
        walker = self.scene.walker
        return {
            "playground": {
                "module": base64.b64encode(self.module).decode("ascii"),
                "inputs": self.inputs.tolist(),
                "sliders": list(self.sliders),
                "recorded": RECORDED,
                "room": STEPS,
                "ending": ENDING,
                "endings": {int(each): str(each) for each in Ending},
                "l": float(walker.l),
                "r": float(walker.r),
                "weight": float(walker.total_mass * self.scene.ground.g),
            },
            "colours": view_colours(),
        }

    def html(self) -> str:
        """One page of HTML that holds everything and needs no network."""
        return page_of(self.sent(), "A walk that simulates itself", computes=True)

    def _repr_html_(self) -> str:
        return frame_of(self.html(), "a walk that simulates itself", 1000)


def playground(scene: Scene, state: State, *, footsteps: int = 5) -> Playground:
    """A page with sliders for the slope, stiffness, damping and the start, which simulates itself.

    The lanes' program of this scene is compiled to WebAssembly, which takes some seconds. Its steps
    are those that `simulate` takes by lanes, to the last bit.

    Args:
        scene: the walker; of the laws of contact those of the sliders that it has are there.
        state: where its walks start.
        footsteps: after which they end.

    Returns:
        The page: `save(path)` writes it, a notebook shows it in a frame.

    Raises:
        ArgumentError: arguments of the wrong type.
        UnknownPrimitiveError: the scene holds an operation that lanes do not have.

    Examples:
        >>> import jaxbiped as jb
        >>> page = jb.plot.playground(jb.seed_scene(), jb.seed_state(), footsteps=3)
        >>> page.module[:4]
        b'\\x00asm'
    """
    scene = check_scene(scene, Scene)
    check_type("state", state, State)
    check_count("footsteps", footsteps)
    request = played_request(scene, state, footsteps)
    paths, _ = jtu.tree_flatten_with_path(request.inputs)
    leaves = [jtu.keystr(path) for path, _ in paths]
    inputs = np.array([float(value) for _, value in paths])
    sliders = [_sent(each, leaves, inputs) for each in _SLIDERS if each.leaf in leaves]
    return Playground(played_module(request), inputs, tuple(sliders), scene)


def _sent(slider: _Slider, leaves: list[str], inputs: np.ndarray) -> JsonObject:
    place = leaves.index(slider.leaf)
    middle = float(np.log10(inputs[place])) if slider.factor else float(inputs[place])
    return {
        "leaf": slider.leaf,
        "input": place,
        "words": slider.words,
        "unit": slider.unit,
        "least": middle - slider.reach,
        "most": middle + slider.reach,
        "value": middle,
        "power": slider.factor,
    }
