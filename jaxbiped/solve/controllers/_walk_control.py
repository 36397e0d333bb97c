"""Walk control: how the steps of a walk with contact are chosen, the same by every engine."""

from jaxbiped._types import RealScalarLike
from jaxbiped.solve._units import Units
from jaxbiped.solve.controllers._crossed_switches import CrossedSwitches
from jaxbiped.solve.controllers._error_control import ErrorControl
from jaxbiped.solve.controllers._shallow_contact import ShallowContact
from jaxbiped.solve.controllers._touchdown_ahead import TouchdownAhead
from jaxbiped.solve.controllers._wrapped_control import StepControl


def walk_control(
    rtol: RealScalarLike, atol: RealScalarLike, units: Units, *, switch_weight: float = 1.0
) -> StepControl:
    """The controller of a walk's steps; the solve's `args` must be the scene.

    Args:
        rtol, atol: tolerances; the absolute one in units of each leaf.
        units: of the state's leaves and of time.
        switch_weight: of the errors of steps that cross a switch (see `weigh_crossed`).
    """
    control: StepControl = ErrorControl(rtol, atol, units)
    if switch_weight != 1.0:
        control = CrossedSwitches(control, switch_weight)
    return ShallowContact(TouchdownAhead(control))
