"""The seed's walker with the smooth twins of its laws of contact."""

import dataclasses

import jaxbiped as jb


def smoothed_seed() -> jb.Scene:
    """The seed's scene, both laws replaced, their parameters kept."""
    seed = jb.seed_scene()
    normal, friction = seed.normal, seed.friction
    return dataclasses.replace(
        seed,
        normal=jb.laws.SmoothRistowSchafer(K=normal.K, c=normal.c, n=normal.n),
        friction=jb.laws.SmoothBengisuAkay(
            friction.mu_static, friction.mu_kinetic, friction.v0, friction.xi
        ),
    )
