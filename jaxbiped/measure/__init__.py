"""Measures of a trajectory: footsteps, energy ledger, samples, datasets."""

from jaxbiped.measure._energy_ledger import EnergyLedger as EnergyLedger
from jaxbiped.measure._footsteps import Footsteps as Footsteps
from jaxbiped.measure._footsteps import HeelStrikes as HeelStrikes
from jaxbiped.measure._operation_counts import operation_counts as operation_counts
