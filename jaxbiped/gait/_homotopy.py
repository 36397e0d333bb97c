"""Homotopy in the parameters: the line from the seed's scene to another of the same laws.

A search that fails from its start follows a known gait along this line.
"""

import dataclasses
from typing import NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu

from jaxbiped._types import Scalar, as_float
from jaxbiped.scene._ready_scenes import seed_scene
from jaxbiped.scene._scene import AbstractScene, RigidScene, Scene
from jaxbiped.scene.actuation._abstract_actuator import Actuation
from jaxbiped.scene.laws._catalogue import (
    FRICTION_LAWS,
    NORMAL_LAWS,
    friction_law_like,
    normal_law_like,
)

_Law = TypeVar("_Law", bound=eqx.Module)


class Homotopy(NamedTuple):
    """Scenes between two of one kind: geometric in what is positive in both, linear in the rest.

    Attributes:
        first, last: the scenes at s = 0 and at s = 1.
    """

    first: AbstractScene
    last: AbstractScene

    def at(self, s: Scalar | float) -> AbstractScene:
        """The scene at s; beyond 1 the line goes on."""
        return jtu.tree_map(lambda a, b: _interpolate(a, b, s)[0], self.first, self.last)

    def slopes(self, s: Scalar | float) -> Scalar:
        """Derivatives of the scene's leaves with respect to s, shape (leaves,)."""
        pairs = zip(jtu.tree_leaves(self.first), jtu.tree_leaves(self.last), strict=True)
        return jnp.stack([_interpolate(a, b, s)[1] for a, b in pairs])


def _interpolate(a: Scalar, b: Scalar, s: Scalar | float) -> tuple[Scalar, Scalar]:
    """The number at s between `a` and `b`, and its derivative with respect to s."""
    geometric = (a > 0.0) & (b > 0.0)
    ratio = jnp.where(geometric, b, 1.0) / jnp.where(geometric, a, 1.0)
    # Exactly the last number at s = 1.
    power = jnp.where(s == 1.0, b, a * ratio**s)
    value = jnp.where(geometric, power, (1.0 - s) * a + s * b)
    return value, jnp.where(geometric, power * jnp.log(ratio), b - a)


def homotopy_to(scene: AbstractScene) -> Homotopy:
    """The line to `scene` from the seed's scene, its laws made to resemble the seed's.

    Numbers of laws that are not in the catalogue stay those of `scene`. Its actuators are idle.
    """
    return Homotopy(scene.with_minimal(_seed_like(scene.minimal)), scene)


def _seed_like(scene: Scene | RigidScene) -> Scene | RigidScene:
    with jax.ensure_compile_time_eval():
        own = jtu.tree_map(float, seed_scene())
        if isinstance(scene, RigidScene):
            rigid = dataclasses.replace(
                scene, walker=own.walker, ground=own.ground, actuation=_idle(scene)
            )
            return jtu.tree_map(as_float, rigid)
        normal, friction = own.normal, own.friction
        normals = {
            law: normal_law_like(
                name, K=normal.K, c=normal.c, n=normal.n, mass=own.walker.total_mass, g=own.ground.g
            )
            for name, law in NORMAL_LAWS.items()
            if law is type(scene.normal)
        }
        frictions = {
            law: friction_law_like(
                name,
                mu_static=friction.mu_static,
                mu_kinetic=friction.mu_kinetic,
                v0=friction.v0,
                xi=friction.xi,
            )
            for name, law in FRICTION_LAWS.items()
            if law is type(scene.friction)
        }
        begin = dataclasses.replace(
            scene,
            walker=own.walker,
            ground=own.ground,
            normal=_numbers_of(normals.get(type(scene.normal)), scene.normal),
            friction=_numbers_of(frictions.get(type(scene.friction)), scene.friction),
            actuation=_idle(scene),
        )
        return jtu.tree_map(as_float, begin)


def _idle(scene: Scene | RigidScene) -> Actuation:
    """The scene's actuators at strength zero: the seed's walker is passive."""
    return None if scene.actuation is None else tuple(part.idle() for part in scene.actuation)


def _numbers_of(alike: eqx.Module | None, law: _Law) -> _Law:
    """`law` with the numbers of `alike`; its own static fields, and numbers that this lacks."""
    if alike is None:
        return law
    fields = [field.name for field in dataclasses.fields(law)]
    static = [field.name for field in dataclasses.fields(law) if field.metadata.get("static")]
    numbers = {
        name: getattr(alike, name)
        for name in fields
        if name not in static
        and getattr(law, name) is not None
        and getattr(alike, name) is not None
    }
    return dataclasses.replace(law, **numbers)
