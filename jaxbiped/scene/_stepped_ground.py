"""Stepped ground: level with the slope behind a step, lower or higher in front of it.

What a gait's response to uneven floors is asked of; nothing of it is in any other scene.
"""

import equinox as eqx

from jaxbiped._types import Parameter, Scalar


class SteppedGround(eqx.Module):
    """A slope on which leg 1's foot comes down behind a step, where the ground lies lower.

    Attributes (scalar leaves):
        slope: angle of the slope, downhill positive [rad].
        g: gravitational acceleration [m/s²].
        drop: depth of the step along the slope's normal [m].
    """

    slope: Parameter
    g: Parameter
    drop: Scalar


def drop_under(ground: object, leg: int) -> Scalar | None:
    """How much lower the ground under a leg's foot lies than the slope [m]; None for even."""
    return ground.drop if isinstance(ground, SteppedGround) and leg == 1 else None
