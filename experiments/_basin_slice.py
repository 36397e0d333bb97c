"""A slice through the basin of the seed's walker, and labels on a grid over it."""

import numpy as np

import jaxbiped as jb

THETA, OMEGA = (-0.5, 0.8), (-4.0, 5.0)
"""The slice: angle [rad] and rate [rad/s] of the swing leg at mid-stance, all else the gait's."""
AXES = ("angle of the swing leg at mid-stance, θ", "its rate, ω")
UNITS = ("rad", "rad/s")
WALKING = int(jb.basins.Label.WALKING)


def axes(side):
    """Values along the two axes; the angle runs fastest."""
    return {"omega_swing": np.linspace(*OMEGA, side), "theta_swing": np.linspace(*THETA, side)}


def codes_on_grid(labelling, side):
    """Labels and cycles' footsteps of a square grid, shape (side, side)."""
    found = jb.sweep(labelling, jb.starts.grid(labelling.scene, axes(side)))
    return found["label"].values, found["cycle_footsteps"].values
