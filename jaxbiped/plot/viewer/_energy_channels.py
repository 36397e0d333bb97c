"""Energies of a walk as the viewer charts them: held, given by gravity and motors, and lost."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
import numpy.typing as npt

from jaxbiped._types import Scalar
from jaxbiped.dynamics._energy import powers
from jaxbiped.dynamics._impact import push_off_work
from jaxbiped.measure._samples import NODES, Samples, evaluate_along
from jaxbiped.plot._samples import RigidMotion, state_at
from jaxbiped.plot.viewer._knots import Channels
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.solve._trajectory import Trajectory

ENERGIES = ("kinetic", "elastic", "supplied", "driven", "lost")


def energy_channels(
    kinetic: np.ndarray,
    supplied: np.ndarray,
    elastic: np.ndarray,
    driven: np.ndarray | None,
    held: npt.ArrayLike,
) -> Channels:
    """The curves of a chart of energies [J], shape (n,).

    Args:
        kinetic: energy of the motion.
        supplied: work of gravity.
        elastic: energy of what is elastic.
        driven: work of motors and actuators; None for a passive walker.
        held: kinetic and elastic energy at first.
    """
    lost = held + supplied - kinetic - elastic
    curves = {"kinetic": kinetic, "elastic": elastic, "supplied": supplied, "lost": lost}
    return curves if driven is None else curves | {"driven": driven, "lost": lost + driven}


def driving_work(scene: Scene, trajectory: Trajectory, edges: np.ndarray) -> np.ndarray:
    """Work of motors and actuators since the first of increasing times [J], shape (n,)."""

    def power(t: np.ndarray) -> np.ndarray:
        driving: np.ndarray = evaluate_along(scene, state_at(trajectory, t), powers).actuation
        return driving

    return _work_since(edges, power)


def rigid_driving_work(motion: RigidMotion, t: np.ndarray) -> np.ndarray:
    """The same of a rigid walk, with the push-off of each heel strike; the times see all jumps."""
    pushes, strikes = np.zeros(len(t)), np.searchsorted(t, motion.began[1:])
    pushes[strikes] = motion.along(_push_off, t[strikes - 1])["work"]
    return _work_since(t, lambda at: motion.along(_power, at)["actuation"]) + np.cumsum(pushes)


def _work_since(edges: np.ndarray, power: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    times = edges[:-1, None] + 0.5 * np.diff(edges)[:, None] * (1.0 + NODES)
    sampled = power(times.ravel()).reshape(times.shape)
    return np.append(0.0, np.cumsum(Samples(edges, None).integral(sampled)))


def _power(scene: RigidScene, state: Any) -> dict[str, Scalar]:
    return {"actuation": jnp.asarray(powers(scene, state).actuation)}


def _push_off(scene: RigidScene, state: Any) -> dict[str, Scalar]:
    return {"work": push_off_work(scene, state)}
