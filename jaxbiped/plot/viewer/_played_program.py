"""Program that a page runs: a solve whose every step records what the viewer shows."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.compiler import LANES, Program, Request, web_module
from jaxbiped.dynamics._contacts import contacts
from jaxbiped.dynamics._energy import Energies, energies
from jaxbiped.dynamics._state import State
from jaxbiped.plot.viewer._recording import FORCES
from jaxbiped.scene._scene import Scene
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
    return request._replace(program=_played(request.program), room=STEPS)


def played_module(request: Request) -> bytes:
    """Its program as a module of WebAssembly."""
    return web_module(LANES.compile(request).graph)


def _played(program: Program) -> Program:
    """The program with records for the viewer in place of the dense output."""
    steps = program.record
    assert steps is not None

    def record(solve: Solve, now: PyTree, due: Scalar) -> tuple[Scalar, list[Scalar]]:
        noted, (t, *values) = steps(solve, now, due)
        state = State(*values[: len(State._fields)])
        shown = jax.lax.cond(
            noted,
            lambda: _shown(solve.scene, state),
            lambda: [jnp.zeros_like(t)] * (len(RECORDED) - 1 - len(state)),
        )
        return noted, [t, *state, *shown]

    return dataclasses.replace(program, record=record)


def _shown(scene: Any, state: State) -> list[Scalar]:
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
