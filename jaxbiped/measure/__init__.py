"""Measures of a trajectory: footsteps, energy ledger, samples, datasets; and tables of datasets."""

from jaxbiped._tables import to_csv as to_csv
from jaxbiped._tables import to_dataframe as to_dataframe
from jaxbiped._tables import to_latex as to_latex
from jaxbiped.measure._costs import CostOfTransport as CostOfTransport
from jaxbiped.measure._costs import cost_of_transport as cost_of_transport
from jaxbiped.measure._costs import operation_counts as operation_counts
from jaxbiped.measure._dataset import trajectory_dataset as trajectory_dataset
from jaxbiped.measure._energy_ledger import EnergyLedger as EnergyLedger
from jaxbiped.measure._energy_ledger import RigidLedger as RigidLedger
from jaxbiped.measure._energy_ledger import energy_ledger as energy_ledger
from jaxbiped.measure._energy_ledger import rigid_ledger as rigid_ledger
from jaxbiped.measure._footsteps import Footsteps as Footsteps
from jaxbiped.measure._footsteps import HeelStrikes as HeelStrikes
from jaxbiped.measure._footsteps import heel_strikes as heel_strikes
from jaxbiped.simulate._trajectory import Arrivals as Arrivals
