"""A mechanism for MuJoCo: its bodies, feet, springs and stops as MJCF, contacts by MuJoCo's law."""

import importlib.util
import math
import time
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

import jaxbiped as jb

CONTACT = "-2e4 -2e2"
"""Stiffness and damping of feet on the ground, as MuJoCo's `solref` has them."""
LIMIT = "-2e3 -2e1"
"""Those of stops."""


def is_installed() -> bool:
    return importlib.util.find_spec("mujoco") is not None


def mjcf(scene: jb.Scene, dt: float) -> str:
    """The walker of a scene; springs only from bodies on the root point to the slope's normal."""
    mechanism = scene.mechanism
    slope, g = float(scene.ground.slope), float(scene.ground.g)
    bodies = [_body(mechanism, j) for j, parent in _parents(mechanism) if parent < 0]
    return f"""<mujoco><compiler angle="radian"/>
    <option timestep="{dt}" gravity="{g * math.sin(slope)} 0 {-g * math.cos(slope)}"
            integrator="implicitfast"/>
    <worldbody><geom type="plane" size="50 50 1" contype="2" conaffinity="1" solref="{CONTACT}"/>
      <body name="root"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>
        <inertial pos="0 0 0" mass="{float(mechanism.root_mass)}" diaginertia="1e-9 1e-9 1e-9"/>
        {"".join(bodies)}
      </body></worldbody></mujoco>"""


def _parents(mechanism: jb.Mechanism) -> list[tuple[int, int]]:
    return list(enumerate(mechanism.structure.parents))


def _place(point: Any) -> str:
    """A place (along, ahead) in MuJoCo's axes, where x is ahead and z is up."""
    along, ahead = (0.0 if each is None else float(each) for each in (point.along, point.ahead))
    return f"{ahead} 0 {-along}"


def _body(mechanism: jb.Mechanism, j: int) -> str:
    body, name = mechanism.bodies[j], mechanism.structure.bodies[j]
    at = "0 0 0" if body.at is None else _place(body.at)
    inertia = " ".join([str(float(body.inertia))] * 3)
    joint = f'type="hinge" axis="0 -1 0" name={quoteattr(name)}'
    for part, angle in zip(mechanism.joints, mechanism.structure.joints, strict=True):
        if angle.weights[0] != (j, 1.0):
            continue
        if isinstance(part, jb.Stop):
            joint += f' limited="true" range="-3 {float(part.upper)}" solreflimit="{LIMIT}"'
        elif isinstance(part, jb.Spring):
            joint += f' stiffness="{float(part.stiffness)}" damping="{float(part.damping)}"'
    feet = [
        f'<geom type="sphere" size="{float(foot.radius)}" pos="{_place(foot.centre)}" '
        f'contype="1" conaffinity="2" friction="0.4" condim="3" solref="{CONTACT}"/>'
        for foot, own in zip(mechanism.feet, mechanism.structure.feet, strict=True)
        if own == j
    ]
    inside = [_body(mechanism, k) for k, parent in _parents(mechanism) if parent == j]
    return f"""<body pos="{at}"><joint {joint}/>
      <inertial pos="{_place(body.centre)}" mass="{float(body.mass)}" diaginertia="{inertia}"/>
      {"".join(feet)}{"".join(inside)}</body>"""


def rows(scene: jb.Scene, start: Any, steps: tuple[float, ...], duration: float, least: float):
    """Simulated seconds for one of the processor and the end's error, by step.

    The error is that of all angles and places against MuJoCo's own solution at a tenth of the
    smallest step, [rad and m].
    """
    exact, _ = _run(scene, start, min(steps) / 10.0, duration, 0.0)
    for dt in steps:
        end, rate = _run(scene, start, dt, duration, least)
        yield {"way": "MuJoCo", "step_s": dt, "error_median": float(np.max(np.abs(end - exact))),
               "simulated_s_per_cpu_s": rate}  # fmt: skip


def _run(
    scene: jb.Scene, start: Any, dt: float, duration: float, least: float
) -> tuple[np.ndarray, float]:
    import mujoco

    model = mujoco.MjModel.from_xml_string(mjcf(scene, dt))
    data, done, began = mujoco.MjData(model), 0, time.process_time()
    structure, half = scene.mechanism.structure, len(start) // 2
    relative = np.eye(half)
    for j, parent in enumerate(structure.parents):
        if parent >= 0:
            relative[2 + j, 2 + parent] = -1.0
    # MuJoCo numbers joints as bodies are nested.
    names = [model.joint(k).name for k in range(2, half)]
    order = [0, 1, *(2 + structure.bodies.index(name) for name in names)]
    values = np.array([float(leaf) for leaf in start])
    while done == 0 or time.process_time() - began < least:
        mujoco.mj_resetData(model, data)
        data.qpos[:] = (relative @ values[:half])[order]
        data.qvel[:] = (relative @ values[half:])[order]
        mujoco.mj_step(model, data, nstep=round(duration / dt))
        done += 1
    return data.qpos.copy(), done * duration / max(time.process_time() - began, 1e-9)
