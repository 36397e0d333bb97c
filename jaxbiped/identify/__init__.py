"""Identification: a scene's parameters from measured gaits."""

from jaxbiped.identify._gait_fit import FitEnding as FitEnding
from jaxbiped.identify._gait_fit import GaitFit as GaitFit
from jaxbiped.identify._measured_gait import MeasuredAngles as MeasuredAngles
from jaxbiped.identify._measured_gait import MeasuredGait as MeasuredGait
from jaxbiped.identify._measured_gait import read_measured as read_measured
