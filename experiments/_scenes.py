"""Scenes that several experiments walk: the seed's under other laws, and on rigid feet."""

import dataclasses

import jaxbiped as jb

SMOOTH = {"normal": "smooth-ristow-schafer", "friction": "smooth-bengisu-akay"}
"""The smooth counterparts of the seed's laws."""


def seed_with(
    normal: str = "ristow-schafer", friction: str = "bengisu-akay", **parameters: float
) -> jb.Scene:
    """The seed's scene, each law replaced by that of a name, like the seed's own."""
    scene = jb.seed_scene(**parameters)
    own, slips = scene.normal, scene.friction
    if normal != "ristow-schafer":
        of_mass = dict(mass=scene.walker.total_mass, g=scene.ground.g)
        own = jb.laws.normal_law_like(normal, K=own.K, c=own.c, n=own.n, **of_mass)
    if friction != "bengisu-akay":
        names = ("mu_static", "mu_kinetic", "v0", "xi")
        values = {name: getattr(slips, name) for name in names}
        slips = jb.laws.friction_law_like(friction, **values)
    return dataclasses.replace(scene, normal=own, friction=slips)


def rigid_seed(slope: float = 0.02) -> jb.RigidScene:
    """The seed's walker on rigid feet."""
    return jb.RigidScene(walker=jb.seed_scene().walker, ground=jb.Ground(slope=slope))
