"""The ground: a plane slope in gravity, with or without a step."""

import math
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxbiped._checks import ArgumentError, are_zero_together, warn
from jaxbiped._parameter_declaration import AbstractPart, parameter
from jaxbiped._types import Parameter, Scalar, is_traced


class Ground(AbstractPart):
    """An inclined plane that descends towards positive x.

    Attributes (leaves of any batch shape):
        slope: angle of the slope α, downhill positive [rad].
        g: gravitational acceleration [m/s²].

    Raises:
        ArgumentError: the slope is a right angle or more, or g is below 0.
    """

    slope: Parameter = parameter("slope", r"$\alpha$", "rad", size_below=math.pi / 2)
    g: Parameter = parameter("gravity", "$g$", "m/s^2", minimum=0.0, default=9.8)


def check_pulls(ground: Any) -> None:
    """Raises `ArgumentError` where g is known to be 0, for what waits in units of √(l/g)."""
    if are_zero_together(ground.g, 0.0):
        raise ArgumentError(
            "g = 0 is not allowed here: footsteps are waited for in units of √(l/g), which has no "
            "end; give g above 0, or for a walk a duration."
        )


def gravity_on(ground: Any) -> tuple[Scalar, Scalar]:
    """Gravity along the slope, downhill, and onto it [m/s²]."""
    return ground.g * jnp.sin(ground.slope), ground.g * jnp.cos(ground.slope)


class SteppedGround(eqx.Module):
    """A slope on which one leg comes down behind a step, where the ground lies lower.

    Attributes (scalar leaves):
        slope: angle of the slope, downhill positive [rad].
        g: gravitational acceleration [m/s²].
        drop: depth of the step along the slope's normal [m].
        leg: number of that leg, from 0 on.
    """

    slope: Parameter
    g: Parameter
    drop: Scalar
    leg: int = eqx.field(static=True)


def warn_if_steep(ground: Ground, friction: object) -> None:
    """Warns of a slope whose tangent exceeds every coefficient of friction: a walker slides."""
    known = (getattr(friction, name, None) for name in ("mu", "mu_static", "mu_kinetic"))
    largest = [mu for mu in known if mu is not None]
    if not largest or is_traced((ground.slope, *largest)):
        return
    # By NumPy alone: what is traced around a known scene would trace these, too.
    slope, *most = (np.max(np.abs(np.asarray(each))) for each in (ground.slope, *largest))
    mu = max(most)
    if 0.0 < mu < np.tan(slope):
        warn(
            f"slope = {slope:g} rad is steeper than friction can hold, whose coefficient is at "
            f"most {mu:g} (up to {np.arctan(mu):.3g} rad): every walker slides; is the slope in "
            "degrees?"
        )
