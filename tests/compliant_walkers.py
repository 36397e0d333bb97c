"""Walkers on compliant ground that tests share."""

import dataclasses

import jax.numpy as jnp

import jaxbiped as jb


def held_walker(**numbers):
    """The seed's walker on ground that always holds, the swinging foot included."""
    return dataclasses.replace(jb.seed_scene(**numbers), clearance=jb.laws.AlwaysTouching())


def frictionless_walker(K, **numbers):
    """The seed's walker on Hertz feet without friction, on ground that always holds."""
    parts = dict(normal=jb.laws.Hertz(K=K), friction=jb.laws.Frictionless())
    return dataclasses.replace(held_walker(**numbers), **parts)


def seed_state(**values):
    """The seed's start, some of its leaves replaced."""
    return jb.seed_state()._replace(**{name: jnp.asarray(x) for name, x in values.items()})


def astride_at_rest():
    """A walker let down on both feet of level, rough ground, legs astride, and its start."""
    rough = jb.laws.RegularisedCoulomb(mu=0.8, v_d=1e-3)
    scene = dataclasses.replace(held_walker(slope=0.0), friction=rough)
    height = float(jb.dynamics.standing_height(scene, jnp.asarray(0.3), 4e-4))
    still = dict.fromkeys(("omega_1", "omega_2", "hip_vx", "hip_vz"), 0.0)
    return scene, seed_state(theta_1=0.3, theta_2=-0.3, hip_z=height, **still)
