"""Actuation: what drives a walker beside gravity.

A part enters `ACTUATORS` by its `name` as it is defined. The command line has those of the lines
below.
"""

from jaxbiped.scene.actuation._actuators import ACTUATORS as ACTUATORS
from jaxbiped.scene.actuation._actuators import AbstractActuator as AbstractActuator
from jaxbiped.scene.actuation._actuators import AbstractHipActuator as AbstractHipActuator
from jaxbiped.scene.actuation._actuators import AbstractPhaseTorque as AbstractPhaseTorque
from jaxbiped.scene.actuation._actuators import AbstractStanceTorque as AbstractStanceTorque
from jaxbiped.scene.actuation._actuators import HipMotion as HipMotion

# At the hip.
from jaxbiped.scene.actuation._actuators import HipSpring as HipSpring
from jaxbiped.scene.actuation._actuators import HipTorque as HipTorque
from jaxbiped.scene.actuation._actuators import HipPulse as HipPulse
from jaxbiped.scene.actuation._actuators import HipSpline as HipSpline

# At the feet: rigid ones, compliant ones.
from jaxbiped.scene.actuation._actuators import PushOff as PushOff
from jaxbiped.scene.actuation._actuators import FootPreload as FootPreload

# At the hip, and for motors: laws of the time since the last strike, and a limit for any law.
from jaxbiped.scene.actuation._time_laws import TimePolynomial as TimePolynomial
from jaxbiped.scene.actuation._time_laws import TimeSpline as TimeSpline
from jaxbiped.scene.actuation._time_laws import Limited as Limited

# Laws of motors at the joints of a mechanism.
from jaxbiped.scene.actuation._motor_laws import AbstractMotorLaw as AbstractMotorLaw
from jaxbiped.scene.actuation._motor_laws import Constant as Constant
from jaxbiped.scene.actuation._motor_laws import PD as PD
from jaxbiped.scene.actuation._motor_laws import Pulse as Pulse
from jaxbiped.scene.actuation._motor_laws import Spline as Spline
from jaxbiped.scene.actuation._motor_laws import VirtualConstraint as VirtualConstraint
