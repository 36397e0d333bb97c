"""Coordinates of the state: what each is, with its symbol and unit."""

from jaxbiped._quantity import Quantity

STATE_QUANTITIES = {
    "hip_x": Quantity("hip along the slope", r"$x_S$", "m"),
    "hip_z": Quantity("hip above the slope", r"$z_S$", "m"),
    "hip_vx": Quantity("hip velocity along the slope", r"$\dot x_S$", "m/s"),
    "hip_vz": Quantity("hip velocity off the slope", r"$\dot z_S$", "m/s"),
    "theta_1": Quantity("angle of leg 1", r"$\theta_1$", "rad"),
    "theta_2": Quantity("angle of leg 2", r"$\theta_2$", "rad"),
    "omega_1": Quantity("rate of leg 1", r"$\omega_1$", "rad/s"),
    "omega_2": Quantity("rate of leg 2", r"$\omega_2$", "rad/s"),
    "bristle_1": Quantity("bristles of foot 1", r"$b_1$"),
    "bristle_2": Quantity("bristles of foot 2", r"$b_2$"),
}
"""By the names that `State`, `BristleState` and `RigidState` give them."""
